#include "time/tile_kernels.hpp"

#include "model/dispatch.hpp"

namespace stickslip::tile {

Stencil stencil(const Scene& scene) {
  return kernel::for_half_width(scene.order / 2, [](auto half_width) -> Stencil {
    return kernel::compiled<Stencil>(kernel::StencilOfColumns<half_width>{});
  });
}

Pointwise pointwise(const Scene& scene, bool sticking) {
  return dispatch_friction<Pointwise>(scene.friction, [&](const auto& friction) -> Pointwise {
    using F = std::decay_t<decltype(friction)>;
    if constexpr (F::sticks)
      if (sticking) return kernel::compiled_by_dof<Pointwise>(kernel::PointwiseOfColumns<F, true>{friction});
    return kernel::compiled_by_dof<Pointwise>(kernel::PointwiseOfColumns<F, false>{friction});
  });
}

}  // namespace stickslip::tile
