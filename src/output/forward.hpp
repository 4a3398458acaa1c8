// What is looked at from one side only, the maxima of psi and its upward passages, is looked at from the side
// to which the plate goes, so that the mirror image of a motion is measured as the motion itself is.
#pragma once

#include <string>

#include "stickslip/model/scene.hpp"

namespace stickslip {

// 1, or -1 where the plate goes backward: forward * psi is positive along its way.
inline double forward(const Scene& scene) { return scene.v < 0 ? -1 : 1; }

// The name in a checkpoint of what was seen in this direction.
inline std::string seen_from(const Scene& scene, const std::string& name) {
  return scene.v < 0 ? name + ".backward" : name;
}

}  // namespace stickslip
