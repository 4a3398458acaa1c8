// The parameter that every state law of the program has.
#pragma once

#include "model/law.hpp"

namespace stickslip {

inline constexpr Parameter slip_distance{"D",
                                         "1",
                                         Parameter::Range::positive,
                                         "length",
                                         "healing, contact-age: slip distance that renews the contact",
                                         "1; friction_D with rate-and-state, n-shaped, dieterich"};

}  // namespace stickslip
