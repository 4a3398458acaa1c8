#include "model/dispatch.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip::tile {

NewtonRound newton_round(const Scene& scene, bool sticking, const std::vector<double>& x) {
  return loop_of_friction<NewtonRound, kernel::NewtonRound>(scene.friction, sticking, x);
}

}  // namespace stickslip::tile
