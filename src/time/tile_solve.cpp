#include "time/tile_kernels.hpp"

#include "model/dispatch.hpp"

namespace stickslip::tile {

SolveStage solve_stage(const Scene& scene, bool sticking, const std::vector<double>& x) {
  return loop_of_friction<SolveStage, kernel::SolveStage>(scene.friction, sticking, x);
}

}  // namespace stickslip::tile
