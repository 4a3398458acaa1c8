// The parts of an Integrator: each knows its own business, and the callbacks of the TS bring them together.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/time/time.hpp"
#include "time/advance.hpp"
#include "time/choice.hpp"
#include "time/dense_output.hpp"
#include "time/equations.hpp"
#include "time/fused_ts.hpp"
#include "time/step_guard.hpp"
#include "time/stick_steps.hpp"

namespace stickslip {

struct Integrator::Impl {
  const Model& model;
  std::string prefix;
  std::unique_ptr<Equations> equations;  // before the TS that calls them, to outlive it
  DmHandle dm;
  TsHandle ts;
  FusedTs* fused = nullptr;  // what takes the steps, where PETSc's own types do not
  const Method* method = nullptr;
  Tolerances tolerances;
  bool adaptive = false;
  double fixed_dt = 0;  // where it is not
  double floor = 0;           // ts_adapt_dt_min
  bool clock_limits = false;  // and no step of its own is shorter than the round-off of the time
  int steps_at_floor = 0;     // one after the other
  std::int64_t rejections_before = 0;  // at the beginning of the step
  StepGuard guard;
  std::unique_ptr<DenseOutput> dense;  // where the method has no polynomial of its own
  ShorterStep shorter;                 // in place of polynomials where these mean nothing
  std::unique_ptr<StickSteps> stick;
  Advance advance;
  VecHandle kept;  // u at the beginning of the step, see begin_step
  bool has_kept = false;
  VecHandle allowed, no_part;  // of errors, absolute and relative, where psi's judge eta's (narrow_errors)
  std::function<double(double)> next_output_time;
  struct Checkpoint {
    std::int64_t step;
    double dt;
  };
  std::optional<Checkpoint> checkpoint;  // to go on from

  Impl(const Model& m, const std::string& p)
      : model(m), prefix(p), guard(m), shorter(m), advance(m) {}

  // ---- set-up (set_up.cpp) ----
  void set_up(const MethodSpec& spec, Vec u);
  void create_ts(Vec u);
  void set_subtype(const std::string& type, const std::string& name) const;
  void check_subtype_option(const std::string& type) const;
  std::string subtype_now(const std::string& type) const;
  Tolerances tolerances_of(const MethodSpec& spec) const;
  void set_tolerances(const Tolerances& given);
  void set_step_control(const MethodSpec& spec, const Rates& rates) const;
  bool will_fuse(const Choice& choice) const;
  void fuse(const Choice& choice);
  void read_adaptivity(bool step_given, Vec u);
  void allow_rejections() const;
  PetscInt most_rejections() const;  // of one step: ts_max_reject
  void warn_of_fixed_step(bool step_given) const;
  void refuse_below_round_off(Vec u) const;
  void set_dense_output();

  // ---- steps (time.cpp) ----
  static Impl& of(TS ts);
  static PetscErrorCode PreStep(TS ts);
  static PetscErrorCode PreStage(TS ts, PetscReal);
  static PetscErrorCode PostStage(TS ts, PetscReal, PetscInt index, Vec*);
  static PetscErrorCode DomainError(TS ts, PetscReal, Vec u, PetscBool* accept);
  static PetscErrorCode PostStep(TS ts);
  void start(Vec u, double t, double t_end, const Observer& observer, std::int64_t max_steps);
  void pass_corner(Vec u, double t) const;
  TSConvergedReason solve(Vec u);
  void solve_finite(Vec u);
  TSConvergedReason solve_piece(Vec u);
  [[noreturn]] void fail(TSConvergedReason reason) const;
  void begin_step();
  void narrow_errors();
  void set_floor() const;
  void after_step();
  bool reaches_balance(const Step& step) const;
  std::string instead() const;  // of this method, for messages
  void check_floor(const Step& step);
  Step step_now();
  bool output_due(double until);
  Vec before() const { return fused ? fused->before() : kept.get(); }
  void interpolate(double at, Vec into);
  std::string advice(double dt) const;
};

}  // namespace stickslip
