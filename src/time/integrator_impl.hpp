// What takes the steps of a run one by one for the loop over them (Integrator::Impl::solve): a method with
// all its stages taken tile by tile or in bands (FusedStepper), or one of PETSc's own types (PetscStepper).
// Everything is collective.
#pragma once

#include <petscts.h>

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/process.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/stick.hpp"
#include "stickslip/time/time.hpp"
#include "time/methods.hpp"

namespace stickslip {

// The system as PETSc's time steppers ask for it, udot - G(u) = F(u), and how its implicit part G is solved.
class Equations {
 public:
  Equations(const Model& model, Implicit implicit)
      : model_(model), implicit_(implicit), parts_(parts_of(implicit)) {}
  Equations(const Equations&) = delete;
  Equations& operator=(const Equations&) = delete;

  // Gives `ts`, whose type stands, its callbacks and the defaults of its solvers. This object must outlive
  // `ts`. Collective.
  void attach(TS ts, const Capabilities& can, const std::string& prefix);
  // Its equations are solved to `target`, in parts of the scales and values.
  void solve_to(const Tolerances& tolerances, double target) {
    tolerances_ = tolerances;
    target_ = target;
  }

  bool has_implicit() const { return implicit_ != Implicit::none; }
  // At the beginning of a step, and of its repetition: what was kept for the stages of the last one goes.
  void begin_step(TS ts);

 private:
  static PetscErrorCode RHSFunction(TS, PetscReal, Vec, Vec, void*);
  static PetscErrorCode IFunction(TS, PetscReal, Vec, Vec, Vec, void*);
  static PetscErrorCode IJacobian(TS, PetscReal, Vec, Vec, PetscReal, Mat, Mat, void*);
  static PetscErrorCode TameStep(SNESLineSearch, Vec, Vec, PetscBool*, void*);
  static PetscErrorCode Search(SNESLineSearch, void*);
  static PetscErrorCode Converged(SNES, PetscInt, PetscReal, PetscReal, PetscReal, SNESConvergedReason*,
                                  void*);
  void search(SNESLineSearch search) const;
  struct Sizes {
    double rows = 0, changes = 0;
  };
  Sizes sizes_of(Vec u, Vec residual) const;
  double slope_of_friction(PetscInt i, const double* at) const;
  double largest_miss(Vec u, Vec residual) const;
  static bool shares_jacobian(const Capabilities& can, const std::string& prefix);
  void set_newton(SNES snes, const std::string& prefix);
  void set_linear_solver(KSP ksp) const;
  // where nothing is implicit a matrix of the pointwise pattern, for methods that ask for one
  Part jacobian_part() const { return parts_.of_implicit.value_or(Part::pointwise); }

  const Model& model_;
  Implicit implicit_;
  PartsOfStep parts_;
  MatHandle J_;
  bool shares_jacobian_ = false;  // one for all stages of a step, see Converged
  Tolerances tolerances_;
  double target_ = 1e-9;
  bool as_user_has_it_ = false;  // snes_rtol, ...
  double last_shift_ = std::numeric_limits<double>::quiet_NaN(), last_miss_ = 0;
};

// How long steps are that PETSc does not take itself: by the rules of its TSAdapt `basic`, `dsp` and `none`,
// and by the same options (-ts_adapt_...).
class StepControl {
 public:
  // What `ts` has been told is read when it is asked for; `usual_norm`: of errors, where no option names one.
  StepControl(TS ts, const std::string& prefix, NormType usual_norm);

  bool adapts() const { return kind_ != none; }
  NormType norm() const { return norm_; }  // NORM_2: root mean square over all unknowns; NORM_INFINITY
  double after_failure(double h) const;    // where equations were not solved

  struct Tried {
    const char *type, *subtype;  // of the method
    int order;
    double t, h, t_end;  // where the step begins, its length, and the time to be hit
    std::int64_t index;  // steps before it
    double error;        // over what is allowed; negative: there is no estimate
    bool again;          // it had been tried longer
    bool steady;         // the next one is not to be longer
    bool restarts;       // what is remembered of earlier steps means nothing
  };
  struct Choice {
    bool accepted;
    double h;  // of the next one, or of the same one tried again
  };
  Choice choose(const Tried& tried);

 private:
  enum Kind { none, basic, dsp };
  Choice by_error(const Tried& tried) const;
  Choice by_filter(const Tried& tried);
  void read_filter(const std::string& prefix);
  void monitor(const Tried& tried, const Choice& choice) const;

  TS ts_;
  TSAdapt adapt_;
  Kind kind_;
  NormType norm_;
  bool always_accepts_ = false, monitors_ = false;
  // Of dsp (G. Soederlind, ACM Trans. Math. Software 29 (2003) 1): parameters; errors and ratios of steps.
  std::array<double, 3> beta_{}, errors_{1, 1, 1}, ratios_{1, 1, 1};
  std::array<double, 2> alpha_{};
};

// Whether every entry of u is finite, and so far from overflow that friction and error estimates of it are.
class FiniteTest {
 public:
  explicit FiniteTest(const Model& model);
  bool operator()(Vec u) const;

 private:
  const Model& model_;
  double overflows_[3];  // times psi, eta, the state: what is cubed
};

class Stepper {
 public:
  // What the loop is asked within a step.
  struct Loop {
    // Will a value inside a step be asked for, up to `until`? What that takes is kept.
    std::function<bool(double until)> keeps;
    std::function<void()> repeats;  // a step was rejected and is tried again
  };
  struct Asked {
    double t, h, t_end;  // where the step begins, its length if that does, and the time that steps hit
    std::int64_t index;  // steps before it
    bool restarts;       // what is remembered of earlier steps means nothing
    bool first;          // of a run
  };
  struct Outcome {
    enum Kind { taken, rejected, not_solved, not_finite } kind;  // rejected: too often
    double t, next_h;  // where it ends, and what is proposed for the next one
    int rejections;
    bool finite;  // the new u is known to be
  };

  virtual ~Stepper() = default;
  virtual void set_tolerances(const Tolerances& tolerances) = 0;
  // The method and its tolerances stand. `most_rejections`: of one step.
  virtual void set_up(const Method& method, bool adaptive, PetscInt most_rejections) = 0;
  // u after a step, through rejections. Where none is taken u is what it was.
  virtual Outcome step(Vec u, const Asked& asked) = 0;

  // Of the last step.
  virtual Vec before() const = 0;   // u where it begins; nullptr where that was not kept
  virtual bool solved() const = 0;  // its implicit equations
  // Whether u comes with the psi of a massless chain.
  virtual bool puts_psi() const { return false; }
  // u at a time inside, the part `part` of the step, by the method's own polynomial.
  virtual void interpolate(double at, double part, Vec into) = 0;
  // How far it has come, for -ts_view.
  virtual void view(PetscViewer viewer, std::int64_t rejections) const = 0;
};

// All stages of a step tile by tile or in bands. Its TS holds options and names the type, fusedrk,
// fusedarkimex or leapfrog, but takes no steps.
class FusedStepper : public Stepper {
 public:
  // `type`, `subtype`: as FusedMethod takes them.
  FusedStepper(const Model& model, TS ts, const std::string& type, const std::string& subtype,
               Implicit implicit, bool sticking, Loop loop);
  void set_tolerances(const Tolerances& tolerances) override { tolerances_ = tolerances; }
  void set_up(const Method& method, bool adaptive, PetscInt most_rejections) override;
  Outcome step(Vec u, const Asked& asked) override;
  Vec before() const override { return before_; }
  bool solved() const override { return outcome_.solved; }
  bool puts_psi() const override { return true; }
  void interpolate(double at, double part, Vec into) override;
  void view(PetscViewer viewer, std::int64_t rejections) const override;

  // u at the part `part` of the last step by a step that ends there; false where it finds no solution.
  bool shorter(double part, Vec into) const;
  const std::string& subtype() const { return method_.subtype(); }
  void control_by(StepControl control) { control_ = std::make_unique<StepControl>(control); }
  // The last stage, where it is taken at the new u, leaves its slope in the Vec that this returns.
  bool last_is_solution() const { return taker_->last_is_solution(); }
  void leave_slope_in(std::function<Vec()> slope) { slope_at_end_ = std::move(slope); }
  void set_direction(const std::vector<double>& direction) { taker_->set_direction(direction); }

 private:
  void make_slopes();

  const Model& model_;
  TS ts_;
  std::string type_;  // the library's
  FusedMethod method_;
  Implicit implicit_;
  Loop loop_;
  std::unique_ptr<StepTaker> taker_;
  std::unique_ptr<StepControl> control_;
  std::function<Vec()> slope_at_end_;
  VecHandle before_;
  StepTaker::Outcome outcome_{};
  std::vector<VecHandle> slopes_;
  bool adaptive_ = false, slopes_kept_ = false;  // slopes: those of the last step
  PetscInt most_rejections_ = 0;
  double t_ = 0, dt_ = 0;  // of the last step: where it begins, its length
  Tolerances tolerances_;
  ErrorNorm norm_{};
};

// PETSc's own types of TS, and what they let pass: stages and steps that are not finite, and rejected steps
// undone by subtraction.
class PetscStepper : public Stepper {
 public:
  // Gives `ts`, whose type stands, its callbacks; must outlive it. `prefix`: of PETSc's options.
  PetscStepper(const Model& model, TS ts, Implicit implicit, const Capabilities& can,
               const std::string& prefix, Loop loop);
  void set_tolerances(const Tolerances& tolerances) override;
  void set_up(const Method& method, bool adaptive, PetscInt most_rejections) override;
  Outcome step(Vec u, const Asked& asked) override;
  Vec before() const override { return has_kept_ ? kept_.get() : nullptr; }
  bool solved() const override;
  void interpolate(double at, double part, Vec into) override;
  void view(PetscViewer viewer, std::int64_t rejections) const override;

 private:
  static PetscErrorCode PreStage(TS ts, PetscReal);
  static PetscErrorCode PostStage(TS ts, PetscReal, PetscInt index, Vec*);
  static PetscErrorCode DomainError(TS ts, PetscReal, Vec u, PetscBool* accept);
  void narrow_errors(Vec u);
  void begin(Vec u, const Asked& asked);
  bool attempt();
  void repeat();
  bool accepts(Vec u);  // a stage
  int new_rejections();

  const Model& model_;
  TS ts_;
  std::string prefix_;
  Loop loop_;
  Equations equations_;
  FiniteTest all_finite_;
  Tolerances tolerances_;
  bool adaptive_ = false, narrows_ = false;
  bool undoes_ = false;          // puts back u itself before a step is tried again
  bool first_same_as_last_ = false;
  VecHandle kept_, work_;        // kept: u where the step begins
  bool has_kept_ = false;
  VecHandle allowed_, no_part_;  // of errors, absolute and relative, where psi's judge eta's
  bool started_ = false;         // a step has been accepted
  bool checked_last_ = false;    // the new u, as the last stage
  PetscInt stage_ = 0;           // the one that was computed last
  PetscInt last_stage_ = -1;     // of rk
  PetscInt rejections_ = 0;      // seen so far
};

// The other parts of an Integrator: each knows its own business, and the loop over steps brings them
// together.

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
  double same_time = 0;  // what is no later than that is at one time (base/process.hpp)

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
