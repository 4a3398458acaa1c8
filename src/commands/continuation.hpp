// The options of a branch, alike for every command that follows one: COMMAND_continue and COMMAND_to; and its
// end at a signal.
#pragma once

#include <string>

#include "stickslip/base/provenance.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/result_file.hpp"

namespace stickslip {

// Both are given or neither, the first names a real option, and the second is a value that this can take and
// does not have. `suffix`: behind their names, "2" of a second option. Throws UsageError.
void check_continuation(const Options& options, const std::string& command, const std::string& suffix = "");

// Where a signal ended a branch, which stands in the file as far as it was followed: writes that and throws
// Interrupted. Several ranks stopped at several places, and write none.
void end_at_signal(ResultFile& file, const Provenance& provenance);

}  // namespace stickslip
