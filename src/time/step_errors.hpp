// What takes a whole step of a method for the types of TS of stepper.hpp.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "model/kernel.hpp"
#include "model/law_columns.hpp"
#include "stickslip/base/handle.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/time/tolerances.hpp"

namespace stickslip {

// How errors are weighed: |error_i|/(absolute + relative |u_i|), root mean square or the largest.
struct ErrorNorm {
  Tolerances tolerances;
  NormType type;
};

class StepTaker {
 public:
  virtual ~StepTaker() = default;

  struct Outcome {
    bool finite;
    double error;  // as ErrorNorm weighs it; -1 without an estimate
    bool solved;   // every implicit equation, by the root that the step leads to
  };
  // `u_new` = u after a step dt; u and u_new differ. `slopes`: empty, or a Vec for every slope of the method,
  // to keep them for values between steps. `last_slope`: nullptr, or takes the last of them. `t`: where the
  // step begins, which a load alone asks for. Collective; no allocation.
  virtual Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                       const std::vector<VecHandle>& slopes, Vec last_slope = nullptr,
                       double t = 0) const = 0;
  // With friction that sticks (stick.hpp): 1, -1 or 0 for every node of this rank, from now on. Collective.
  virtual void set_direction(const std::vector<double>& direction) = 0;
  // The last stage is taken at the new u: its slope is the right-hand side there.
  virtual bool last_is_solution() const { return false; }
  virtual int stages() const = 0;
};

// What a step errs by: its new values weighed as ErrorNorm says.
class StepErrors {
 public:
  struct Sums {
    double squares = 0, largest = 0, not_finite = 0;
    double unsolved = 0;  // equations without a solution
  };
  StepErrors();
  // Adds `count` new values u of an unknown (psi 0, eta 1, the state 2) with their errors; without an
  // estimate only whether they are finite.
  void add(int unknown, const double* u, const double* errors, PetscInt count, const ErrorNorm& norm,
           bool estimate, Sums& sums) const;
  // Over all ranks, of so many unknowns. Collective.
  static StepTaker::Outcome over_ranks(MPI_Comm comm, const Sums& sums, const ErrorNorm& norm, bool estimate,
                                       double unknowns);

 private:
  std::function<double(const kernel::Weighted&)> square_;
};

// What psi and the state err by in a step where friction goes by ln psi (laws that are `steep`), so that they
// are slaves of the force.
//
// What a slave has been off by at the start of a step is gone after it, however short it is; an estimate e
// that counts it asks for ever shorter steps in vain. So (L. F. Shampine and L. S. Baca, SIAM J. Numer. Anal.
// 21 (1984) 736) the estimate goes through the equations of a stage, with h the step times their diagonal,
//     x + h A [(B + F_psi) x + F_state y] = e_psi + h A e_eta,   y - h (g_psi x + g_state y) = e_state
// which leaves e where friction is not stiff, and else says by how much psi has to differ for the force to be
// that of eta.
class SlaveErrors {
 public:
  SlaveErrors() = default;  // none
  // Of nodes by their numbers.
  SlaveErrors(const Scene& scene, const FrictionPlaces& places);

  bool any() const { return law_.steep; }
  struct Columns {
    const double *psi, *state;  // the new values
    const double* amplitude;    // as in kernel::Columns
    double* of_psi;             // errors, in and out
    const double* of_eta;
    double* of_state;
    double h;
    PetscInt count, number;  // number: of the first node
  };
  // `coefficients`: of the i-th of them.
  void operator()(const Columns& c, const std::function<NodeCoefficients(PetscInt i)>& coefficients) const;

 private:
  kernel::LawColumns law_;
  mutable std::array<std::vector<double>, 6> columns_;
};

}  // namespace stickslip
