// Motions that grow without bound: where the linear terms of a node drive its oscillation more than friction
// can hold it.
//
// In one node the deviation from sliding gains the energy -(A B + s delta)/A psi^2 a unit of time and loses F
// psi to friction, so that with A B + s delta < 0 (model_delta_sign printed) and friction that grows more
// slowly than psi everything beyond some size grows without bound, like exp(-(A B + s delta) t/2).
#pragma once

#include "stickslip/model/scene.hpp"

namespace stickslip {

// A |psi|, length/time, beyond which a motion that oscillates grows without bound, on the safe side; infinite
// where friction or viscosity holds every motion.
double escape_velocity(const Scene& scene);

}  // namespace stickslip
