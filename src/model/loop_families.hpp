// The loops of loops.hpp, compiled for each law.
#pragma once

#include "model/dispatch.hpp"
#include "model/loops.hpp"

namespace stickslip {

// In one pass, of a law without a state that is the same everywhere.
struct WholeFamily {
  using Make = RangeLoop (*)(const FrictionParameters&, int half_width);
  static LawTable<Make>& table();

  template <class L, class S>
  static RangeLoop make(const FrictionParameters& p, int half_width) {
    return kernel::for_half_width(half_width, [&](auto hw) {
      constexpr int constant = decltype(hw)::value;
      return with_friction<L, S>(p, [](const auto& friction) -> RangeLoop {
        using F = std::decay_t<decltype(friction)>;
        if constexpr (F::has_state)
          return {};
        else
          return kernel::compiled<RangeLoop>(kernel::Whole<constant, F>{friction});
      });
    });
  }
};

// What is pointwise, beside the coupling of nodes or alone.
using OntoFamily = LoopFamily<RangeLoop, kernel::Onto, bool>;
template <>
LawTable<OntoFamily::Make>& OntoFamily::table();

template <class F, bool sticking>
using ReactionOf = kernel::Reaction<F>;
using ReactionFamily = LoopFamily<RangeLoop, ReactionOf>;
template <>
LawTable<ReactionFamily::Make>& ReactionFamily::table();

}  // namespace stickslip
