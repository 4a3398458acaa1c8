#include "time/tile_kernels.hpp"

#include "model/dispatch.hpp"

namespace stickslip::tile {

SolveStage solve_stage(const Scene& scene, bool sticking) {
  return dispatch_friction<SolveStage>(scene.friction, [&](const auto& friction) -> SolveStage {
    using F = std::decay_t<decltype(friction)>;
    if constexpr (F::sticks)
      if (sticking) return kernel::compiled_by_dof<SolveStage>(kernel::SolveStage<F, true>{friction});
    return kernel::compiled_by_dof<SolveStage>(kernel::SolveStage<F, false>{friction});
  });
}

}  // namespace stickslip::tile
