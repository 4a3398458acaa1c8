// What the options wave_* ask for.
#pragma once

#include "stickslip/options/options.hpp"
#include "stickslip/waves/branch.hpp"

namespace stickslip {

// The train. Throws UsageError where neither or both of length and speed are given.
TrainRequest train_request(const Options& options);
// The options wave_continue and wave_to, checked before any work. Throws UsageError.
void check_branch(const Options& options);
// The train as a function of the real option `name`.
TrainFamily train_family(const Options& options, const std::string& name);

}  // namespace stickslip
