// When a node at rest, with a force that changes at a constant rate and a threshold that follows its state,
// begins to slip.
#pragma once

#include "stickslip/model/friction.hpp"

namespace stickslip {

// The time after which side times the force, `force` + `rate` t, comes up to amplitude times the threshold of
// the state s at rest: the first where it does so, not earlier than 0. Infinite where it never does, or later
// than `latest`. Local, not collective.
double release_time(const Friction& law, double amplitude, double force, double rate, double s,
                    double latest);

}  // namespace stickslip
