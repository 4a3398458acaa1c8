// The parts of an Integrator: each knows its own business, and the loop over steps brings them together.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/time/time.hpp"
#include "time/choice.hpp"
#include "time/dense_output.hpp"
#include "time/drive.hpp"
#include "time/stepper.hpp"
#include "time/stick_steps.hpp"

namespace stickslip {

struct Integrator::Impl {
  const Model& model;
  std::string prefix;
  std::unique_ptr<Stepper> stepper;  // before the TS that calls it, to outlive it
  FusedStepper* fused = nullptr;     // the same, where the steps are not PETSc's
  DmHandle dm;
  TsHandle ts;  // options; PETSc's own steps
  const Method* method = nullptr;
  Implicit implicit = Implicit::none;
  Tolerances tolerances;
  bool adaptive = false;
  double fixed_dt = 0;        // where it is not
  double floor = 0;           // ts_adapt_dt_min
  bool clock_limits = false;  // and no step of its own is shorter than the round-off of the time
  int steps_at_floor = 0;     // one after the other
  FiniteTest all_finite;
  std::unique_ptr<DenseOutput> dense;  // where the method has no polynomial of its own
  ShorterStep shorter;                 // in place of polynomials where these mean nothing
  std::unique_ptr<StickSteps> stick;
  Drive drive;
  std::function<double(double)> next_output_time;
  bool from_checkpoint = false;

  Impl(const Model& m, const std::string& p)
      : model(m), prefix(p), all_finite(m), shorter(m), drive(m) {}

  // ---- set-up (set_up.cpp) ----
  void set_up(const MethodSpec& spec, Vec u);
  void create_ts(Vec u);
  void set_subtype(const std::string& type, const std::string& name) const;
  std::string given_subtype(const std::string& type) const;
  std::string subtype_now(const std::string& type) const;
  Tolerances tolerances_of(const MethodSpec& spec) const;
  void set_tolerances(const Tolerances& given);
  void set_step_control(const MethodSpec& spec, const Rates& rates) const;
  bool will_fuse(const Choice& choice) const;
  void fuse(const Choice& choice, const std::string& subtype);
  Stepper::Loop loop();
  void read_adaptivity(bool step_given, Vec u);
  PetscInt most_rejections() const;  // of one step: ts_max_reject
  void warn_of_fixed_step(bool step_given) const;
  void refuse_below_round_off(Vec u) const;
  void set_dense_output();

  // ---- steps (time.cpp) ----
  void start(Vec u, double t, double t_end, const Observer& observer, std::int64_t max_steps);
  void solve(Vec u);
  void begin_piece(Vec u);
  void pass_corner(Vec u, double t) const;
  void begin_step();
  void after_step(const Stepper::Outcome& outcome);
  [[noreturn]] void fail(const Stepper::Outcome& outcome) const;
  void monitor() const;
  void view(const char* option) const;
  void set_floor() const;
  bool reaches_balance(const Step& step, bool was_rejected) const;
  std::string instead() const;  // of this method, for messages
  void check_floor(const Step& step);
  Step step_now();
  bool output_due(double until);
  void interpolate(double at, Vec into);
  std::string advice(double dt) const;
};

}  // namespace stickslip
