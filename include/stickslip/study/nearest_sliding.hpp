// The steady sliding that the motion of a scene is compared with.
#pragma once

#include <functional>

#include "stickslip/model/scene.hpp"

namespace stickslip {

// psi of steady sliding at a node: v without held ends (an empty function says so), else the boundary layers at them,
// one banded solve over the whole line. v too where there is no steady sliding. Not collective.
std::function<double(PetscInt)> steady_velocity(const Scene& scene);

}  // namespace stickslip
