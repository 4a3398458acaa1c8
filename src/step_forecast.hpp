// Whether a fixed step is beyond the stability limit of its method, foreseen from the linearised operator.
//
// Uniform motion at velocity psi splits into waves exp(ikx); each is a system of dof equations with
// K = K0 + K1 kappa^2(k). The method itself advances a set of them - kappa^2 from 0 to the grid's largest, friction at
// its least and largest slope - by one step from every unit vector, so that the propagator P over one step is known
// for any method, split as it will be. A wave explodes when the excess of its growth over the exact one,
// ln rho(P) - max(0, dt Re lambda), multiplies errors by more than a million in the time asked for.
#pragma once

#include <string>
#include <vector>

#include "stickslip/handle.hpp"
#include "stickslip/time.hpp"

namespace stickslip {

class StepForecast {
 public:
  // For the method of `like`. Multistep methods have no propagator: nothing is foreseen for them. Collective.
  StepForecast(const Model& model, Vec u, Implicit implicit, TS like);

  bool explodes(double dt, double duration);
  // The largest step found, up to dt, that does not explode.
  double limit(double dt, double duration);

 private:
  struct Wave {
    std::vector<double> explicit_part, implicit_part;  // dof x dof, row-major
    double growth;                                     // largest real part of the whole, not below 0
  };
  double excess_rate(double dt);  // largest over the waves, per unit time

  static PetscErrorCode RHSFunction(TS, PetscReal, Vec, Vec, void*);
  static PetscErrorCode IFunction(TS, PetscReal, Vec, Vec, Vec, void*);
  static PetscErrorCode IJacobian(TS, PetscReal, Vec, Vec, PetscReal, Mat, Mat, void*);

  int dof_;
  bool propagates_ = true;
  std::vector<Wave> waves_;
  TsHandle ts_;
  VecHandle u_;
  MatHandle J_;
};

// Largest real part and largest modulus of the eigenvalues of a 2 x 2 or 3 x 3 matrix (row-major).
struct SpectralBounds {
  double real_part, modulus;
};
SpectralBounds spectral_bounds(int dim, const std::vector<double>& matrix);

}  // namespace stickslip
