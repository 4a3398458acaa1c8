#include "model/loops.hpp"

#include "model/loop_families.hpp"

namespace stickslip {

LawTable<WholeFamily::Make>& WholeFamily::table() { return listed<WholeFamily>(); }
template <>
LawTable<OntoFamily::Make>& OntoFamily::table() {
  return listed<OntoFamily>();
}
template <>
LawTable<ReactionFamily::Make>& ReactionFamily::table() {
  return listed<ReactionFamily>();
}

namespace {

// Part::pointwise, or what Onto adds to the coupling between nodes.
RangeLoop pointwise(const FrictionParameters& p, bool sticking, const FrictionPlaces& places, bool coupled) {
  return OntoFamily::of(p, sticking, places, coupled);
}

// First what is coupled, by the loop that knows no law; then the rest.
RangeLoop in_two_passes(const FrictionParameters& p, const RangeLoop& stencil, bool sticking,
                        const FrictionPlaces& places) {
  return [rest = pointwise(p, sticking, places, true), stencil](const kernel::Coefficients& c,
                                                                const kernel::Range& r) {
    stencil(c, r);
    rest(c, r);
  };
}

template <int half_width, bool stencil_only>
RangeLoop wave(int dof) {
  if (dof == 3) return kernel::compiled_where_worth<RangeLoop>(kernel::Wave<half_width, 3, stencil_only>{});
  return kernel::compiled_where_worth<RangeLoop>(kernel::Wave<half_width, 2, stencil_only>{});
}

}  // namespace

RangeLoop whole_loop(const FrictionParameters& p, int half_width, bool sticking, const FrictionPlaces& places,
                     const RangeLoop& stencil) {
  if (half_width == 0) return pointwise(p, sticking, places, false);
  if (stencil) return in_two_passes(p, stencil, sticking, places);
  if (!places.empty() || p.has_state() || sticking)
    return in_two_passes(p, wave_loop(p.has_state() ? 3 : 2, half_width, true), sticking, places);
  return WholeFamily::table().of(p)(p, half_width);  // where two passes would show
}

RangeLoop reaction_loop(const FrictionParameters& p, const FrictionPlaces& places) {
  return ReactionFamily::of(p, false, places);
}

// Of a medium with A = 1 in which nothing else acts the rate of psi is -F.
ForceLoop force_loop(const FrictionParameters& p, FrictionPlaces places) {
  const PetscInt dof = p.has_state() ? 3 : 2;
  for (FrictionPlace& place : places) place.medium.reset();
  return [rates = whole_loop(p, 0, false, places), dof](PetscInt node, PetscInt count, const double* psi,
                                                        const double* state, double* F) {
    constexpr kernel::Coefficients alone{1, 0, 0, 0, 0, {}};
    double u[3 * kernel::tile_size] = {}, f[3 * kernel::tile_size];
    for (PetscInt begin = 0; begin < count; begin += kernel::tile_size) {
      const PetscInt part = std::min(kernel::tile_size, count - begin);
      for (PetscInt i = 0; i < part; ++i) {
        u[i * dof] = psi[begin + i];
        if (dof == 3) u[i * dof + 2] = state[begin + i];
      }
      kernel::Range range{u, nullptr, f, part, nullptr, nullptr};
      range.node = node + begin;
      rates(alone, range);
      for (PetscInt i = 0; i < part; ++i) F[begin + i] = -f[i * dof];
    }
  };
}

RangeLoop medium_stencil(int dof, const RangeLoop& same, const std::vector<double>& links) {
  if (links.empty()) return same;
  const auto over = [links](auto dof_constant) -> RangeLoop {
    constexpr int unknowns = decltype(dof_constant)::value;
    return [links](const kernel::Coefficients&, const kernel::Range& r) {
      kernel::over_tiles<1, unknowns>(r, [&](const kernel::NodeRange& t) {
        for (PetscInt i = 0; i < t.count; ++i) {
          t.f[i * unknowns] = 0;
          t.f[i * unknowns + 1] = kernel::link_sum(&links[std::size_t(t.node + i)], t.psi + i);
          if constexpr (unknowns == 3) t.f[i * unknowns + 2] = 0;
        }
      });
    };
  };
  if (dof == 3) return over(std::integral_constant<int, 3>());
  return over(std::integral_constant<int, 2>());
}

RangeLoop medium_wave(int dof, const RangeLoop& stencil, const std::vector<NodeCoefficients>& nodes) {
  return [dof, stencil, nodes](const kernel::Coefficients& same, const kernel::Range& r) {
    stencil(same, r);
    for (PetscInt i = 0; i < r.count; ++i) {
      const NodeCoefficients c = nodes.empty() ? NodeCoefficients{same.A, same.B, same.K0, same.s_delta}
                                               : nodes[std::size_t(r.node + i)];
      const double *const u = r.u + i * dof, psi = u[0], eta = u[1];
      double* const f = r.f + i * dof;
      f[0] = c.A * (eta - c.B * psi);
      f[1] = c.K0 * (same.v - psi) + f[1] - c.s_delta * eta;
    }
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

RangeLoop wave_loop(int dof, int half_width, bool stencil_only) {
  return kernel::for_half_width(
      half_width, [&](auto hw) { return stencil_only ? wave<hw, true>(dof) : wave<hw, false>(dof); });
}

}  // namespace stickslip
