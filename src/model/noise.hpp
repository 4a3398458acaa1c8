// Noise that is drawn by length, not by node, so that it does not change with the grid.
#pragma once

#include "stickslip/model/scene.hpp"

namespace stickslip {

// Uniform on [-1, 1] at points `length` apart, with the interpolation of friction_amplitude() between them;
// in the chain, and where length is 0, one draw a node. The same on any number of ranks. Not collective.
double noise_at(const Scene& scene, double length, PetscInt seed, PetscInt node);

}  // namespace stickslip
