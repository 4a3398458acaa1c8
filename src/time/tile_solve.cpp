#include "time/tile_families.hpp"

namespace stickslip {

template <>
LawTable<tile::SolveStageFamily::Make>& tile::SolveStageFamily::table() {
  return listed<tile::SolveStageFamily>();
}

namespace tile {

SolveStage solve_stage(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return SolveStageFamily::of(scene.friction, sticking, places);
}

}  // namespace tile

}  // namespace stickslip
