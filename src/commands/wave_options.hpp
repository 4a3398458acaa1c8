// What the options wave_* ask for.
#pragma once

#include "stickslip/options/options.hpp"
#include "stickslip/waves/train.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

// The train. Throws UsageError where neither or both of length and speed are given.
TrainRequest train_request(const Options& options);
// The options wave_continue and wave_to, checked before any work. Throws UsageError.
void check_branch(const Options& options);
// The train as a function of the real option `name`.
TrainFamily train_family(const Options& options, const std::string& name);

// That of two options; the same name twice: of that one alone.
TrainFamily2 train_family(const Options& options, const std::string& name, const std::string& name2);

}  // namespace stickslip
