// Steady sliding: psi_i with K0 (v - psi) + K1 D2 psi = 0, the state at its steady value for psi_i, and eta =
// B psi + F - N D2 psi. Friction does not enter the equation for psi (B and delta are never both non-zero),
// so it is linear: psi = v without held ends, one banded solve for the boundary layers with them.
//
// Every rank holds the whole line. Not collective.
#pragma once

#include <vector>

#include "stickslip/model/linear_point.hpp"

namespace stickslip {

struct SteadySliding {
  // Throws Failure where the scene has no steady sliding (a threshold or a contact age at psi = 0).
  explicit SteadySliding(const Scene& scene);

  Scene scene;
  // At every node, held ones included: psi in length/time; the state as stored (friction.hpp), empty without
  // a state law; and the slopes of friction there.
  std::vector<double> psi, eta, state;
  std::vector<FrictionSlopes> slopes;
  // largest |eta_t|, |state_t| over the nodes solved for (psi_t = 0 by the choice of eta)
  double residual = 0;
};

}  // namespace stickslip
