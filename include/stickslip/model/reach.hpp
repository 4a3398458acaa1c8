// How far a scene's springs carry what is done to one node.
#pragma once

#include "stickslip/model/scene.hpp"

namespace stickslip {

// By so many nodes the springs have forgotten a force, (K0 - K1 D2) w = f: what it does there is exp(-45),
// below round-off, of what it does at its own node. Infinite without springs to the plate, 0 without those
// between neighbours.
double nodes_to_forget(const Scene& scene);

}  // namespace stickslip
