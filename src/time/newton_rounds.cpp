#include "model/dispatch.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip::tile {

NewtonRound newton_round(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return loop_of_friction<NewtonRound, kernel::NewtonRound>(scene.friction, sticking, places);
}

}  // namespace stickslip::tile
