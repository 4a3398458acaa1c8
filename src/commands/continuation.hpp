// The options of a branch, alike for every command that follows one: COMMAND_continue and COMMAND_to.
#pragma once

#include <string>

#include "stickslip/options/options.hpp"

namespace stickslip {

// Both are given or neither, the first names a real option, and the second is a value that this can take and
// does not have. `suffix`: behind their names, "2" of a second option. Throws UsageError.
void check_continuation(const Options& options, const std::string& command, const std::string& suffix = "");

}  // namespace stickslip
