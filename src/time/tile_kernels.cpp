#include "time/tile_families.hpp"

namespace stickslip {

template <>
LawTable<tile::PointwiseFamily::Make>& tile::PointwiseFamily::table() {
  return listed<tile::PointwiseFamily>();
}

namespace tile {

Stencil stencil(const Scene& scene, const std::vector<double>& links) {
  if (!links.empty())
    return kernel::compiled<Stencil>(
        kernel::StencilOfLinks{std::make_shared<const std::vector<double>>(links)});
  return kernel::for_half_width(scene.order / 2, [](auto half_width) -> Stencil {
    return kernel::compiled<Stencil>(kernel::StencilOfColumns<half_width>{});
  });
}

Pointwise pointwise(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return PointwiseFamily::of(scene.friction, sticking, places);
}

}  // namespace tile

}  // namespace stickslip
