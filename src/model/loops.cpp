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

template <int half_width, bool stencil_only>
RangeLoop wave(int dof) {
  if (dof == 3) return kernel::compiled_by_dof<RangeLoop>(kernel::Wave<half_width, 3, stencil_only>{});
  return kernel::compiled_by_dof<RangeLoop>(kernel::Wave<half_width, 2, stencil_only>{});
}

}  // namespace

RangeLoop whole_loop(const FrictionParameters& p, int half_width, bool sticking) {
  if (half_width == 0) return whole<0>(p, sticking);
  return kernel::for_half_width(half_width, [&](auto hw) { return whole<hw>(p, sticking); });
}

RangeLoop reaction_loop(const FrictionParameters& p) {
  return dispatch_friction<RangeLoop>(p, [](const auto& friction) {
    return kernel::compiled_by_dof<RangeLoop>(kernel::Reaction<std::decay_t<decltype(friction)>>{friction});
  });
}

RangeLoop wave_loop(int dof, int half_width, bool stencil_only) {
  return kernel::for_half_width(half_width,
                                [&](auto hw) { return stencil_only ? wave<hw, true>(dof) : wave<hw, false>(dof); });
}

}  // namespace stickslip
