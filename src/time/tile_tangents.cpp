#include "time/tile_families.hpp"

namespace stickslip {

template <>
LawTable<tile::TangentsFamily::Make>& tile::TangentsFamily::table() {
  return listed<tile::TangentsFamily>();
}

namespace tile {

NodeTangents tangents(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return TangentsFamily::of(scene.friction, sticking, places);
}

}  // namespace tile

}  // namespace stickslip
