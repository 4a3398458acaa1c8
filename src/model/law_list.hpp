// The laws and state laws of the program. A new one is included and named here, and nowhere else.
#pragma once

#include "model/laws/carlson_langer.hpp"
#include "model/laws/coulomb.hpp"
#include "model/laws/cubic.hpp"
#include "model/laws/dahl.hpp"
#include "model/laws/dieterich.hpp"
#include "model/laws/lugre.hpp"
#include "model/laws/n_shaped.hpp"
#include "model/laws/rate_and_state.hpp"
#include "model/laws/slip_weakening.hpp"
#include "model/laws/stribeck.hpp"
#include "model/laws/table.hpp"
#include "model/laws/tanh.hpp"
#include "model/states/ageing.hpp"
#include "model/states/ageing_cutoff.hpp"
#include "model/states/contact_age.hpp"
#include "model/states/healing.hpp"
#include "model/states/prz.hpp"
#include "model/states/slip.hpp"

namespace stickslip {

template <class...>
struct Types {};

using Laws = Types<Cubic, CarlsonLanger, Coulomb, RateAndState, NShaped, MeasuredCurve, Stribeck, Tanh,
                   SlipWeakening, Dieterich, LuGre, Dahl>;
using StateLaws =
    Types<NoState, Healing, ContactAge, Ageing, Slip, AgeingCutoff, PerrinRiceZheng, SlipMemory, Bristles>;

}  // namespace stickslip
