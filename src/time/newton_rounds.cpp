#include "time/tile_families.hpp"

namespace stickslip {

template <>
LawTable<tile::NewtonRoundFamily::Make>& tile::NewtonRoundFamily::table() {
  return listed<tile::NewtonRoundFamily>();
}

namespace tile {

NewtonRound newton_round(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return NewtonRoundFamily::of(scene.friction, sticking, places);
}

}  // namespace tile

}  // namespace stickslip
