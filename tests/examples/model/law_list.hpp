// The list of src/model/law_list.hpp as it is for the program of the examples: its folder comes first where
// headers are looked for.
#pragma once

#include "bonding.hpp"
#include "hump.hpp"
#include "lorentz.hpp"
#include "model/laws/of_velocity.hpp"

namespace stickslip {

using Laws = Types<Cubic, Hump, Lorentz>;
using StateLaws = Types<NoState, Bonding>;

}  // namespace stickslip
