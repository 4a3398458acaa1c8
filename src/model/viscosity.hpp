// Viscosity between neighbours in the loops over nodes.
//
// It enters by what drives a node alone, e = eta + N D2 psi in place of eta:
//     psi_t = A (e - B psi - F),     eta_t = K0 (v - psi) + K1 D2 psi - s delta (e - F)
// So a loop of a viscous scene is the pointwise one that every scene has, given e, with K1 D2 psi added to
// what it says of eta. The pointwise loops, which know the laws, know nothing of it, and a scene without
// viscosity does not come here.
#pragma once

#include "model/loops.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

class Viscosity {
 public:
  Viscosity(const Scene& scene, int dof);

  // Part::full of the loop for Part::pointwise, Part::wave of that for Part::wave with no stencil (weights
  // 0).
  RangeLoop around(RangeLoop pointwise) const;
  // Part::stencil; nodes at rest, where a direction is given, feel nothing of viscosity.
  RangeLoop alone() const;
  // N D2 psi, as the rate of eta.
  RangeLoop force() const;

 private:
  double A_, K1_, N_, s_delta_;
  int dof_;
  kernel::Coefficients d2_;  // with the weights of D2
  RangeLoop stencil_;
};

}  // namespace stickslip
