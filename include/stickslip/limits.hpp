// `chart_kind limits`: where each method fails.
#pragma once

#include "stickslip/options.hpp"

namespace stickslip {

// Body of `stickslip chart -chart_kind limits`. Returns the exit code. Collective.
int chart_limits(const Options& options);

}  // namespace stickslip
