#include "model/dispatch.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip::tile {

NodeTangents tangents(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return loop_of_friction<NodeTangents, kernel::TangentsOfColumns>(scene.friction, sticking, places);
}

}  // namespace stickslip::tile
