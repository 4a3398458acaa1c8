// Initial data.
#pragma once

#include <memory>

#include "stickslip/model/model.hpp"

namespace stickslip {

// The start that the init_* options describe: uniform, sine, layer, pulses, wave or file (a frame of a run on
// the same nodes; init_eta and init_state, if set, override the file's). What does not depend on the
// grid (a train, an orbit) is found once, for any number of grids over the same length. Throws UsageError
// where the start does not suit the scene, Failure where it cannot be had (pulses while sliding is stable).
class Start {
 public:
  Start(const Scene& scene, const Options& options);
  ~Start();
  Start(const Start&) = delete;
  Start& operator=(const Start&) = delete;
  // The start on the grid of a model (of one of scene.copies equal cells: of that cell). Held nodes take
  // their values. Collective.
  void fill(const Model& model, Vec u) const;
  // By how much the velocity of each held end of the continuum exceeds psi of the start there, on any grid:
  // the height of the jump that runs in from there. 0 for a file.
  struct Misfit {
    double left = 0, right = 0;
  };
  Misfit misfit(const Scene& scene) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Fills u with the start of the model's own scene. Collective.
void set_start(const Model& model, const Options& options, Vec u);

}  // namespace stickslip
