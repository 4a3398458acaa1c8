#include "model/loops.hpp"

#include "model/dispatch.hpp"

namespace stickslip {

namespace {

template <int half_width>
RangeLoop whole(const FrictionParameters& p, bool sticking) {
  return dispatch_friction<RangeLoop>(p, [&](const auto& friction) -> RangeLoop {
    using F = std::decay_t<decltype(friction)>;
    if (!sticking) return kernel::compiled_by_dof<RangeLoop>(kernel::Whole<half_width, F>{friction});
    if constexpr (F::sticks) return kernel::compiled_by_dof<RangeLoop>(kernel::Whole<half_width, F, true>{friction});
    else return {};
  });
}

// First what is coupled, by the loop that knows no law; then the rest.
RangeLoop varying(const FrictionParameters& p, int half_width, bool sticking, const std::vector<double>& x) {
  const RangeLoop rest = dispatch_friction<RangeLoop>(p, [&](const auto& friction) -> RangeLoop {
    using F = kernel::Varying<std::decay_t<decltype(friction)>>;
    const F nodes = varying_friction(friction, p, x);
    if (!sticking) return kernel::Baseline<kernel::Onto<F>>{{nodes, half_width > 0}};
    if constexpr (F::sticks) return kernel::Baseline<kernel::Onto<F, true>>{{nodes, half_width > 0}};
    else return {};
  });
  if (half_width == 0 || !rest) return rest;
  return [rest, stencil = wave_loop(p.has_state() ? 3 : 2, half_width, true)](const kernel::Coefficients& c,
                                                                              const kernel::Range& r) {
    stencil(c, r);
    rest(c, r);
  };
}

template <int half_width, bool stencil_only>
RangeLoop wave(int dof) {
  if (dof == 3) return kernel::compiled_by_dof<RangeLoop>(kernel::Wave<half_width, 3, stencil_only>{});
  return kernel::compiled_by_dof<RangeLoop>(kernel::Wave<half_width, 2, stencil_only>{});
}

}  // namespace

RangeLoop whole_loop(const FrictionParameters& p, int half_width, bool sticking, const std::vector<double>& x) {
  if (p.varies()) return varying(p, half_width, sticking, x);
  if (half_width == 0) return whole<0>(p, sticking);
  return kernel::for_half_width(half_width, [&](auto hw) { return whole<hw>(p, sticking); });
}

RangeLoop reaction_loop(const FrictionParameters& p, const std::vector<double>& x) {
  return dispatch_friction<RangeLoop>(p, [&](const auto& friction) {
    using F = std::decay_t<decltype(friction)>;
    using OfNodes = kernel::Reaction<kernel::Varying<F>>;
    if (p.varies()) return RangeLoop(kernel::Baseline<OfNodes>{{varying_friction(friction, p, x)}});
    return kernel::compiled_by_dof<RangeLoop>(kernel::Reaction<F>{friction});
  });
}

RangeLoop wave_loop(int dof, int half_width, bool stencil_only) {
  return kernel::for_half_width(half_width,
                                [&](auto hw) { return stencil_only ? wave<hw, true>(dof) : wave<hw, false>(dof); });
}

}  // namespace stickslip
