// What psi and the state err by in a step where friction goes by ln psi (laws that are `steep`), so that they
// are slaves of the force.
//
// What a slave has been off by at the start of a step is gone after it, however short it is; an estimate e
// that counts it asks for ever shorter steps in vain. So (L. F. Shampine and L. S. Baca, SIAM J. Numer. Anal.
// 21 (1984) 736) the estimate goes through the equations of a stage, with h the step times their diagonal,
//     x + h A [(B + F_psi) x + F_state y] = e_psi + h A e_eta,   y - h (g_psi x + g_state y) = e_state
// which leaves e where friction is not stiff, and else says by how much psi has to differ for the force to be
// that of eta.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include "model/law_columns.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

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
