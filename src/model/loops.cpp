#include "model/loop_families.hpp"

namespace stickslip {

template LawTable<PointwiseFamily::Make>& PointwiseFamily::table();
template <>
PointwiseLoop loop_for(const FrictionParameters& p, bool sticking, const FrictionPlaces& places) {
  return PointwiseFamily::of(p, sticking, places);
}

StencilLoop stencil_loop(const Scene& scene, const std::vector<double>& links) {
  if (!links.empty())
    return kernel::compiled<StencilLoop>(
        kernel::StencilOfLinks{std::make_shared<const std::vector<double>>(links)});
  return kernel::for_half_width(scene.order / 2, [](auto half_width) {
    return kernel::compiled<StencilLoop>(kernel::StencilOfColumns<half_width>{});
  });
}

PointwiseLoop frictionless_loop(int dof, const std::vector<NodeCoefficients>& medium) {
  return with_flags(
      [&](auto state) -> PointwiseLoop {
        if (medium.empty())
          return kernel::compiled<PointwiseLoop>(
              kernel::PointwiseOfColumns<kernel::Frictionless<state>, false>{});
        std::vector<kernel::AnyFriction<state, false, false>> nodes;
        for (const NodeCoefficients& own : medium) nodes.push_back({nullptr, own});
        return PointwiseFamily::of_nodes<false>(std::move(nodes));
      },
      dof == 3);
}

// Of a medium with A = 1 in which nothing else acts the rate of psi is -F.
ForceLoop force_loop(const FrictionParameters& p, FrictionPlaces places) {
  for (FrictionPlace& place : places) place.medium.reset();
  return [rates = loop_for<PointwiseLoop>(p, false, places)](PetscInt node, PetscInt count, const double* psi,
                                                             const double* state, double* F) {
    constexpr kernel::Coefficients alone{1, 0, 0, 0, 0, {}};
    double zeros[kernel::tile_size] = {}, unused[2][kernel::tile_size];
    for (PetscInt begin = 0; begin < count; begin += kernel::tile_size) {
      const PetscInt part = std::min(kernel::tile_size, count - begin);
      std::fill_n(unused[0], part, 0.);
      rates(alone, {psi + begin, zeros, state ? state + begin : nullptr, nullptr, unused[0], F + begin,
                    unused[0], unused[1], part, nullptr, node + begin});
    }
    for (PetscInt i = 0; i < count; ++i) F[i] = -F[i];
  };
}

kernel::Coefficients kernel::varied_coefficients(const Scene& scene, double factor) {
  Coefficients c = coefficients_with(scene.averaged(), factor);
  const auto drop = [&](const char* name, double& value) {
    if (scene.medium.profile(name)) value = std::nan("");
  };
  drop("model_m", c.A);
  drop("model_zeta", c.B);
  drop("model_k0", c.K0);
  drop("model_delta", c.s_delta);
  for (double& w : c.w)
    for (const char* name : {"model_k1", "model_c"}) drop(name, w);
  return c;
}

}  // namespace stickslip
