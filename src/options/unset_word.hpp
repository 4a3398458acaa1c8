// A word in place of an option's value that takes away what stands below it.
#pragma once

#include <string>

#include "stickslip/options/options.hpp"

namespace stickslip {

// `none` or `unlimited`, where the option's help shows that as its default and a text may not mean something
// else: say the load of a scene (-load_v none).
bool takes_away(const OptionSpec& spec, const std::string& text);

}  // namespace stickslip
