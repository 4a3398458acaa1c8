#include "model/dispatch.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip::tile {

namespace {

template <class F>
NodeTangents of_nodes(const kernel::Varying<F>& friction, bool sticking) {
  using Nodes = kernel::Varying<F>;
  if constexpr (F::sticks)
    if (sticking) return kernel::Baseline<kernel::TangentsOfColumns<Nodes, true>>{{friction}};
  return kernel::Baseline<kernel::TangentsOfColumns<Nodes, false>>{{friction}};
}

}  // namespace

NodeTangents tangents(const Scene& scene, bool sticking, const std::vector<double>& x) {
  return dispatch_friction<NodeTangents>(scene.friction, [&](const auto& friction) -> NodeTangents {
    using F = std::decay_t<decltype(friction)>;
    if (scene.friction.varies()) return of_nodes(varying_friction(friction, scene.friction, x), sticking);
    if constexpr (F::sticks)
      if (sticking) return kernel::compiled_by_dof<NodeTangents>(kernel::TangentsOfColumns<F, true>{friction});
    return kernel::compiled_by_dof<NodeTangents>(kernel::TangentsOfColumns<F, false>{friction});
  });
}

}  // namespace stickslip::tile
