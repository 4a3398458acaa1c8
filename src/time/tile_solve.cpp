#include "time/tile_kernels.hpp"

#include "model/dispatch.hpp"

namespace stickslip::tile {

SolveStage solve_stage(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return loop_of_friction<SolveStage, kernel::SolveStage>(scene.friction, sticking, places);
}

}  // namespace stickslip::tile
