// Sliding under a load that repeats (Scene::load, a sine alone). Computed alike on every rank, nothing
// communicates.
#pragma once

#include "stickslip/cycles/smooth_cycle.hpp"

namespace stickslip {

// The motion that steady sliding becomes as the sine of the load of `cell` grows from nothing: of its period,
// stable or not. Throws Failure where it is lost on the way. Friction that sticks is that of sliding also
// where psi comes to 0: least_along() of the cycle shows it.
SmoothCycle forced_slide(const Scene& cell, double tolerance = 1e-10);
// The one that lies near the slide of another scene of the same kind, whose parameters differ a little. Throws
// Failure where there is none so near.
SmoothCycle forced_slide_near(const SmoothCycle& other, const Scene& cell, double tolerance = 1e-10);

}  // namespace stickslip
