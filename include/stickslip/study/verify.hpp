// Checks of the boundary of sliding by time integration of the full system on both sides of it.
#pragma once

#include <petscsys.h>

#include <functional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/stability/boundary.hpp"

namespace stickslip {

// What time integration of the full system finds beside the curve.
struct Verified {
  double value = 0, value2 = 0;  // of the options
  double growth = 0;             // growth rate there
  std::string expected;          // what the linear answer says: sliding or stick-slip
  std::string from_sliding;      // where slightly perturbed sliding goes: a word of output/regime.hpp
  std::string from_stick_slip;   // the same from large oscillations
  std::string regime;            // both the same, or `both live` (hysteresis), or undecided
};

// `count` points of the curve, each checked on its unstable and its stable side, as far off as makes the growth rate 1 %
// of the frequency; `growth` is the growth rate of these options. `before_each` gets the number of the check and of all.
// Collective over PETSC_COMM_WORLD.
std::vector<Verified> verify_boundary(GrowthRate& growth, const Options& options, const std::vector<Crossing>& points,
                                      PetscInt count,
                                      const std::function<void(std::size_t, std::size_t)>& before_each = {});

}  // namespace stickslip
