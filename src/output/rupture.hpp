// Fronts of a slip event, from the times at which its nodes first slip.
#pragma once

#include "stickslip/model/scene.hpp"
#include "stickslip/output/events.hpp"

namespace stickslip {

// NaN where there is none.
struct Front {
  double speed, error;
};

// The front that runs from the first node of the event to one side (1: towards larger x; -1): the slope of
// place against rupture time, by least squares over the nodes beyond the first three on that side, with its
// standard error. None with fewer than six nodes there, or where all of them begin at once. Where the region
// is a whole ring, the sides meet at the node that begins last, which belongs to the right one.
Front front_of(const SlipEvent& event, const Scene& scene, int side);

}  // namespace stickslip
