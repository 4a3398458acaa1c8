// The system as PETSc's time steppers ask for it, udot - G(u) = F(u), and how its implicit part G is solved.
#pragma once

#include <limits>
#include <string>

#include "stickslip/time/time.hpp"

namespace stickslip {

class Equations {
 public:
  Equations(const Model& model, Implicit implicit) : model_(model), implicit_(implicit) {}
  Equations(const Equations&) = delete;
  Equations& operator=(const Equations&) = delete;

  // Gives `ts`, whose type stands, its callbacks and the defaults of its solvers. This object must outlive
  // `ts`. Collective.
  void attach(TS ts, MethodKind kind, const std::string& prefix);
  // Its equations are solved to `target`, in parts of the scales and values.
  void solve_to(const Tolerances& tolerances, double target) {
    tolerances_ = tolerances;
    target_ = target;
  }

  Implicit implicit() const { return implicit_; }
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
  static bool shares_jacobian(TS ts, MethodKind kind, const std::string& prefix);
  void set_newton(SNES snes, const std::string& prefix);
  void set_linear_solver(KSP ksp) const;
  Part explicit_part() const;
  Part implicit_part() const;

  const Model& model_;
  Implicit implicit_;
  MatHandle J_;
  bool shares_jacobian_ = false;  // one for all stages of a step, see Converged
  Tolerances tolerances_;
  double target_ = 1e-9;
  bool as_user_has_it_ = false;  // snes_rtol, ...
  double last_shift_ = std::numeric_limits<double>::quiet_NaN(), last_miss_ = 0;
};

}  // namespace stickslip
