// The laws and state laws of the program. A new one is included and named here, and nowhere else.
#pragma once

#include "model/laws/of_velocity.hpp"
#include "model/laws/with_state.hpp"
#include "model/laws/table.hpp"

namespace stickslip {

using Laws = Types<Cubic, CarlsonLanger, Coulomb, RateAndState, NShaped, MeasuredCurve, Stribeck, Tanh,
                   SlipWeakening, Dieterich, LuGre, Dahl>;
using StateLaws = Types<NoState, Healing, ContactAge, Ageing, Slip, AgeingCutoff, PerrinRiceZheng, SlipMemory,
                        SlipSinceStop, SlipHealedAtRest, Bristles>;

}  // namespace stickslip
