// `chart_kind error`: the same scene by many methods, error against seconds.
#pragma once

#include "stickslip/options.hpp"

namespace stickslip {

// Body of `stickslip chart`. Returns the exit code. Collective.
int chart_errors(const Options& options);

}  // namespace stickslip
