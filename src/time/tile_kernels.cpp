#include "time/tile_kernels.hpp"

#include "model/dispatch.hpp"

namespace stickslip::tile {

Stencil stencil(const Scene& scene) {
  return kernel::for_half_width(scene.order / 2, [](auto half_width) -> Stencil {
    return kernel::compiled<Stencil>(kernel::StencilOfColumns<half_width>{});
  });
}

namespace {

template <class F>
Pointwise of_nodes(const kernel::Varying<F>& friction, bool sticking) {
  using Nodes = kernel::Varying<F>;
  if constexpr (F::sticks)
    if (sticking) return kernel::Baseline<kernel::PointwiseOfColumns<Nodes, true>>{{friction}};
  return kernel::Baseline<kernel::PointwiseOfColumns<Nodes, false>>{{friction}};
}

}  // namespace

Pointwise pointwise(const Scene& scene, bool sticking, const std::vector<double>& x) {
  return dispatch_friction<Pointwise>(scene.friction, [&](const auto& friction) -> Pointwise {
    using F = std::decay_t<decltype(friction)>;
    if (scene.friction.varies()) return of_nodes(varying_friction(friction, scene.friction, x), sticking);
    if constexpr (F::sticks)
      if (sticking) return kernel::compiled_by_dof<Pointwise>(kernel::PointwiseOfColumns<F, true>{friction});
    return kernel::compiled_by_dof<Pointwise>(kernel::PointwiseOfColumns<F, false>{friction});
  });
}

}  // namespace stickslip::tile
