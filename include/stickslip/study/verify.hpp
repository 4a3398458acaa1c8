// Checks of the boundary of sliding by time integration of the full system on both sides of it.
#pragma once

#include <petscsys.h>

#include <functional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/stick_slip_end.hpp"

namespace stickslip {

// What time integration of the full system finds beside the curve.
struct Verified {
  double value = 0, value2 = 0;  // of the options
  double growth = 0;             // growth rate there
  std::string of = "sliding";    // or stick-slip: beside whose end
  // what the point says: of sliding where perturbed sliding goes, of stick-slip where that goes
  std::string expected;
  std::string from_sliding;     // where slightly perturbed sliding goes: a word of output/regime.hpp
  std::string from_stick_slip;  // the same from large oscillations
  std::string regime;           // both the same, or `bistable` (hysteresis), or undecided
};

// `count` points of the curve, each checked on its unstable and its stable side, as far off as makes the
// growth rate 1 % of the frequency; `growth` is the growth rate of these options. `before_each` gets the
// number of the check and of all. Collective over PETSC_COMM_WORLD.
std::vector<Verified> verify_boundary(GrowthRate& growth, const Options& options,
                                      const std::vector<Crossing>& points, PetscInt count,
                                      const std::function<void(std::size_t, std::size_t)>& before_each = {});

// The same of points where the stick-slip of uniform motion ends: one node from perturbed sliding, and from a
// place of the cycle that exists beside the end (from rest where none is found), at 2 % of the box or more on
// either side.
std::vector<Verified> verify_end(GrowthRate& growth, StickSlipEnd& end, const Options& options,
                                 const std::vector<Crossing>& points, PetscInt count,
                                 const std::function<void(std::size_t, std::size_t)>& before_each = {});

// Options varied along axes: what an analysis of scenes with one or two parameters is given. Not collective.

// The options with those of the axes, and those that go with them, at these values; what depends on them
// follows. Throws UsageError where a value is out of an option's range.
Options options_with(const Options& options, const std::vector<Axis>& axes, double value, double value2 = 0);

// The scene of these, on its sliding branch (Scene::from). The callback owns a copy of both.
SceneAt scene_of(const Options& options, const std::vector<Axis>& axes);

}  // namespace stickslip
