// What the file of a run says of its scene.
#pragma once

#include "stickslip/model/scene.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/run_file.hpp"

namespace stickslip {

// All that follows from a scene: x, the fields psi, eta and tau or theta; as numbers the coefficients A, B,
// K0, K1, s_delta and v of the one system and, where uniform sliding exists, its steady_eta and steady_stable
// (1 or 0, to perturbations of every wavelength of the grid); the table of friction (amplitude 1). To be
// completed by the slab, probes, series, frames. Not collective.
RunLayout run_layout(const Scene& scene);
// Those numbers and the table of friction, to a file that is written in one piece.
void add_scene(ResultFile& file, const Scene& scene);

}  // namespace stickslip
