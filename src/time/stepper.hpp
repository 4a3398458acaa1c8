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
#include <string>
#include <vector>

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
  // u at a time inside, the part `part` of the step, by the method's own polynomial.
  virtual void interpolate(double at, double part, Vec into) = 0;
  // How far it has come, for -ts_view.
  virtual void view(PetscViewer viewer, std::int64_t rejections) const = 0;
};

// All stages of a step tile by tile or in bands. Its TS holds options and names the type, fusedrk,
// fusedarkimex or leapfrog, but takes no steps.
class FusedStepper : public Stepper {
 public:
  // Memory of a node whose unknowns take `unknowns` bytes: u before the step, and the slopes that are kept.
  static double bytes_a_node(double unknowns, int slopes) { return (1 + slopes) * unknowns; }

  // `type`, `subtype`: as FusedMethod takes them.
  FusedStepper(const Model& model, TS ts, const std::string& type, const std::string& subtype,
               Implicit implicit, bool sticking, Loop loop);
  void set_tolerances(const Tolerances& tolerances) override { tolerances_ = tolerances; }
  void set_up(const Method& method, bool adaptive, PetscInt most_rejections) override;
  Outcome step(Vec u, const Asked& asked) override;
  Vec before() const override { return before_; }
  bool solved() const override { return outcome_.solved; }
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

}  // namespace stickslip
