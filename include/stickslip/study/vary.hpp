// Options varied along axes: what an analysis of scenes with one or two parameters is given. Not collective.
#pragma once

#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/stability/growth_rate.hpp"

namespace stickslip {

// The options with those of the axes, and those that go with them, at these values; what depends on them
// follows. Throws UsageError where a value is out of an option's range.
Options options_with(const Options& options, const std::vector<Axis>& axes, double value, double value2 = 0);

// The scene of these, on its sliding branch (Scene::from). The callback owns a copy of both.
SceneAt scene_of(const Options& options, const std::vector<Axis>& axes);

}  // namespace stickslip
