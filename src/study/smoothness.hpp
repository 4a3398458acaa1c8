// What friction that is made of pieces costs methods of high order.
#pragma once

#include "stickslip/base/error.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// With k continuous derivatives of friction the rates have k, and where a motion passes from piece to piece
// the error of one step in time is of order k + 2, that of differences along x integrates to the same: so
// passages, whose number does not grow with that of the steps, leave order k + 2.
inline void warn_of_pieces(const Scene& scene) {
  const FrictionParameters& friction = scene.friction;
  if (friction.piecewise())
    warn("friction_law " + to_string(friction.law) + ": its slope has corners, at which every method of a " +
         "higher order is of order " + std::to_string(friction.law->continuous_derivatives + 2) +
         ", in time and along x");
}

}  // namespace stickslip
