// Leapfrog (Stoermer and Verlet) with friction implicit at the node, tile by tile.
//
//     eta* = eta_n + dt/2 K1 D2 psi_n                                     half a kick by the neighbours
//     (psi, eta, state) from (psi_n, eta*, state_n) through dt by the     everything pointwise: friction, the
//                                                                         free block,
//         midpoint rule: y = z + dt/2 g(y), new = 2 y - z                 damping, the state
//     eta_(n+1) = eta + dt/2 K1 D2 psi_(n+1)                              the other half
//
// Symmetric in time, of order 2. Waves of the grid are stable up to dt = 2/sqrt(A K1 kappa^2_max), kappa^2
// the symbol of -D2: as far as one evaluation a step can reach. The node's equation
// (model/implicit_kernel.hpp) has one root while dt A max(-F') < 2. The second half kick is the first one of
// the next step; it is computed again there, since to keep it would take as much memory traffic as the step
// itself. Viscosity between neighbours, which a kick cannot hold stable at order 2, is refused (choice.cpp).
// No estimate of the error: steps are fixed.
#pragma once

#include "numerics/stage_program.hpp"

namespace stickslip {

constexpr const char* leapfrog_type = "leapfrog";  // -ts_type

// As an additive method: f once at either end, g by the midpoint rule between.
const StageProgram& leapfrog();

}  // namespace stickslip
