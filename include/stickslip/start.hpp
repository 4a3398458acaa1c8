// Initial data.
#pragma once

#include "stickslip/model.hpp"

namespace stickslip {

// Fills u with the start that the init_* options describe: uniform, sine, layer, pulses, wave or file (a frame of a
// run on the same nodes; init_eta and init_state, where set, stand above the file's). Held nodes take their values.
// Collective. Throws UsageError where the start does not suit the scene, Failure where it cannot be had (pulses while
// sliding is stable).
void set_start(const Model& model, const Options& options, Vec u);

}  // namespace stickslip
