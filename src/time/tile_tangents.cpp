#include "model/dispatch.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip::tile {

NodeTangents tangents(const Scene& scene, bool sticking, const std::vector<double>& x) {
  return loop_of_friction<NodeTangents, kernel::TangentsOfColumns>(scene.friction, sticking, x);
}

}  // namespace stickslip::tile
