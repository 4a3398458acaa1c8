#include "time/tile_kernels.hpp"

#include "model/dispatch.hpp"

namespace stickslip::tile {

Stencil stencil(const Scene& scene) {
  return kernel::for_half_width(scene.order / 2, [](auto half_width) -> Stencil {
    return kernel::compiled<Stencil>(kernel::StencilOfColumns<half_width>{});
  });
}

Pointwise pointwise(const Scene& scene, bool sticking, const FrictionPlaces& places) {
  return loop_of_friction<Pointwise, kernel::PointwiseOfColumns>(scene.friction, sticking, places);
}

}  // namespace stickslip::tile
