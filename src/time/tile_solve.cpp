#include "time/tile_kernels.hpp"

#include "model/dispatch.hpp"

namespace stickslip::tile {

namespace {

template <class F>
SolveStage of_nodes(const kernel::Varying<F>& friction, bool sticking) {
  using Nodes = kernel::Varying<F>;
  if constexpr (F::sticks)
    if (sticking) return kernel::Baseline<kernel::SolveStage<Nodes, true>>{{friction}};
  return kernel::Baseline<kernel::SolveStage<Nodes, false>>{{friction}};
}

}  // namespace

SolveStage solve_stage(const Scene& scene, bool sticking, const std::vector<double>& x) {
  return dispatch_friction<SolveStage>(scene.friction, [&](const auto& friction) -> SolveStage {
    using F = std::decay_t<decltype(friction)>;
    if (scene.friction.varies()) return of_nodes(varying_friction(friction, scene.friction, x), sticking);
    if constexpr (F::sticks)
      if (sticking) return kernel::compiled_by_dof<SolveStage>(kernel::SolveStage<F, true>{friction});
    return kernel::compiled_by_dof<SolveStage>(kernel::SolveStage<F, false>{friction});
  });
}

}  // namespace stickslip::tile
