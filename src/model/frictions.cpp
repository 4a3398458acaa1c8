#include "stickslip/model/frictions.hpp"

namespace stickslip {

Frictions::Frictions(const Scene& scene, PetscInt first, PetscInt count) : vary_(scene.friction.varies()) {
  if (vary_ && count > 0)
    list_ = Friction::along(scene.friction, positions(scene, first, count));
  else if (!vary_)
    list_ = {Friction::of(scene.friction)};
}

std::vector<double> positions(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> x;
  for (PetscInt i = first; i < first + count; ++i) x.push_back(scene.x(i));
  return x;
}

}  // namespace stickslip
