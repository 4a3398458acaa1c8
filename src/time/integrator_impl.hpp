// The parts of an Integrator: each knows its own business, and the loop over steps brings them together.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/idling.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/stick.hpp"
#include "stickslip/time/time.hpp"
#include "time/methods.hpp"
#include "time/stepper.hpp"

namespace stickslip {

// Where a run stands: how far it has come, the step that comes next, who watches and when it ends.
struct Drive {
  const Integrator::Observer* observer = nullptr;
  Vec u = nullptr;
  double t = 0, t_before = 0;       // reached, and the beginning of the last step
  double h = 0;                     // the next step, as it is proposed
  double t_end = 0, run_end = 0;    // to be hit exactly: the next corner of the load or the end, and the end
  std::int64_t steps = 0, max_steps = 0;
  bool restarts = true, first = true;  // the next step: forgets what came before; is the first of a run
  bool stop_asked = false, plate_is_over = false;  // the latter: Plate::end has come
  Plate own_plate, *plate = &own_plate;
  TimeReport report;
  long evaluations_before = 0;
  Idling idling;
  double same_time = 0;  // what is no later than that is at one time (base/idling.hpp)

  explicit Drive(const Model& model) : idling(model.comm()) {
    if (const double frequency = model.wave_frequency(); frequency > 0) same_time = 1e-14 / frequency;
  }

  bool goes_on() const { return t < run_end && !stop_asked && steps < max_steps; }
  bool at_corner() const { return t >= t_end; }

  // The next step starts anew, at `from` and of length `length`, unless what was to be hit is reached: then
  // that stays for who goes on with it.
  void go_on_from(double from, double length) {
    t = from;
    h = t < t_end ? std::min(length, t_end - t) : length;
    restarts = true;
  }

  Integrator::Verdict tell(const Integrator::Step& step) {
    if (!*observer) return Integrator::Verdict::go_on;
    const Integrator::Verdict verdict = (*observer)(step);
    if (verdict == Integrator::Verdict::restart) restarts = true;
    if (verdict == Integrator::Verdict::stop && step.t < run_end) stop_asked = true;
    return verdict;
  }

  // Behind every step that counts, and every start and stop: `changed`, the nodes that began to slip or
  // stopped at its end. Where it took no time nobody is told of it but, after a signal, who ends the run.
  void done(const Integrator::Step& step, const std::vector<PetscInt>& changed = {}) {
    if (!idling.at(step.t, changed, same_time)) return;
    Integrator::Step standing(step);
    standing.t_before = step.t;
    tell(standing);
  }

  void update_report(const Model& model) {
    report.t = t;
    report.steps = steps;
    report.rhs_evaluations = model.rhs_evaluations() - evaluations_before;
  }
};

// Values between the steps of a method that has no polynomial of its own for them.
//
// The cubic through u and its slopes at both ends of the step errs by dt^4. Slopes of that cubic inside the
// step err by as much, times dt in their integral: the quartic through them errs by dt^5, and so on, one
// order for each round of new slopes. Degrees above 3 only for explicit methods, whose steps are short enough
// for it.
class DenseOutput {
 public:
  // `degree`: as Capabilities has it.
  DenseOutput(const Model& model, int degree)
      : model_(model), degree_(degree), work_(model.create_vector()) {}
  // Memory of a node whose unknowns take `unknowns` bytes: slopes only once values are asked for.
  static double bytes_a_node(double unknowns, int degree, bool asked) {
    return (1 + (asked ? 2 * degree : 0)) * unknowns;
  }
  // A new step, of which nothing is known.
  void forget() { degree_now_ = 0; }
  // u at the part s of the step of length dt from `before`, at the time t, to `after`. Collective; costs
  // evaluations of the right-hand side the first time in a step.
  void interpolate(Vec before, Vec after, double t, double dt, double s, Vec into);

 private:
  void refine(Vec before, Vec after, double t, double dt);
  void polynomial(Vec before, Vec after, double dt, double s, Vec into) const;

  const Model& model_;
  int degree_;
  int degree_now_ = 0;                             // of the polynomial that slopes_ stand for; 0: none yet
  std::vector<VecHandle> slopes_, better_slopes_;  // at equal distances over the step
  VecHandle work_;
};

// Values between the steps where no polynomial is as good as the steps: those of a step that ends there.
//
// The polynomial of arkimex:5 is of one order less than its steps. And polynomials through slopes mean
// nothing where what is taken implicitly acts many times within a step. The end of a step misses the
// balance that a stiff unknown keeps by the error e of the step, harmless there since the next step leads
// back to it; but its slope as the right-hand side has it is then off by the rate times e, for a light
// block by A e = f0/m e, and a cubic through slopes by up to 4/27 dt rate e. There, from where that is more
// than e itself, values are those of a step of the same method from the same start: as stable as the step,
// and no less accurate.
class ShorterStep {
 public:
  explicit ShorterStep(const Model& model) : model_(model) {}

  // What takes the steps: `fused`, or where there is none the library's steps of `method` with `implicit`.
  void set_up(FusedStepper* fused, const Method& method, Implicit implicit, bool adaptive);
  // Whether u is needed at the beginning of each step that is asked for values within.
  bool may_be_asked() const { return asks_; }

  void forget() { looked_ = false; }  // a new step
  bool is_needed(Vec before, Vec after, double dt);
  // u at the part s of the step from `before` at the time t to `after`; `tolerances`: of the steps.
  // Collective.
  void take(Vec before, Vec after, double t, double dt, double s, const Tolerances& tolerances,
            Vec into);

 private:
  double rate(Vec u) const;
  bool take_by_library(Vec before, double t, double length, const Tolerances& tolerances, Vec u);

  const Model& model_;
  FusedStepper* fused_ = nullptr;
  MethodSpec spec_;
  Implicit implicit_ = Implicit::none;
  bool always_ = false, asks_ = false, adaptive_ = false;
  bool looked_ = false, stiff_ = false;
  std::unique_ptr<Integrator> own_;  // the library's, of such steps
};

// Steps of friction that sticks (stick.hpp): cut where a node starts or stops, and one step from rest to
// release.
class StickSteps {
 public:
  // `stepper`: what takes the steps; `fused`: the same where it is none of PETSc's, else nullptr.
  StickSteps(const Model& model, const Stepper& stepper, FusedStepper* fused, Drive& drive);

  void engage() const { stick_.engage(); }
  // At the start of a run, at u. `fixed_dt`: of a method of fixed steps, else 0.
  void start(Vec u, double fixed_dt);
  // After an accepted step, in place of telling the observer: cuts the step at the first change
  // between rest and sliding, and passes over times when everything rests. Collective.
  void after(Integrator::Step step);

 private:
  void decide(Vec u, double t);
  void decide_with_plate(Vec u, double t);
  void take_back(const Integrator::Step& step, double dt);
  void pass_rest(Vec u);

  const Model& model_;
  bool halts_;  // the plate does (Plate)
  const Stepper& stepper_;
  FusedStepper* fused_;
  Drive& drive_;
  Stick stick_;
  VecHandle landed_;  // u where the step is cut
  double fixed_dt_ = 0;
};

struct Integrator::Impl {
  const Model& model;
  std::string prefix;
  std::unique_ptr<Stepper> stepper;  // before the TS that calls it, to outlive it
  FusedStepper* fused = nullptr;     // the same, where the steps are not PETSc's
  DmHandle dm;
  TsHandle ts;  // options; PETSc's own steps
  const Method* method = nullptr;
  Capabilities can;  // of it
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
  std::string given_subtype(const std::string& type) const;
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
