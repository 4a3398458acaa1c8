#include "stickslip/model/frictions.hpp"

#include "stickslip/model/model.hpp"

namespace stickslip {

namespace {

// Those that friction alone asks for.
FrictionPlaces law_places(const Scene& scene, PetscInt count, const std::function<PetscInt(PetscInt)>& node) {
  FrictionPlaces places;
  if (!scene.laws_differ()) {
    if (!scene.friction.terms.none()) places.push_back({});
    return places;
  }
  for (PetscInt i = 0; i < count; ++i)
    places.push_back({scene.x(node(i)), friction_amplitude(scene, node(i), 1)[0]});
  return places;
}

}  // namespace

Frictions::Frictions(const Scene& scene, PetscInt first, PetscInt count) : vary_(scene.laws_differ()) {
  const auto node = [first](PetscInt i) { return first + i; };
  if (const FrictionPlaces places = law_places(scene, count, node); !places.empty())
    list_ = Friction::along(scene.friction, places);
  else if (!vary_)
    list_ = {Friction::of(scene.friction)};
}

FrictionPlaces friction_places(const Scene& scene, PetscInt count,
                               const std::function<PetscInt(PetscInt)>& node) {
  FrictionPlaces places = law_places(scene, count, node);
  if (!scene.medium.nodes_differ()) return places;
  if (!scene.laws_differ()) places.assign(std::size_t(count), FrictionPlace{});
  for (PetscInt i = 0; i < count; ++i) places[std::size_t(i)].medium = scene.coefficients(node(i));
  return places;
}

FrictionPlaces friction_places(const Scene& scene, PetscInt first, PetscInt count) {
  return friction_places(scene, count, [first](PetscInt i) { return first + i; });
}

std::vector<double> positions(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> x;
  for (PetscInt i = first; i < first + count; ++i) x.push_back(scene.x(i));
  return x;
}

}  // namespace stickslip
