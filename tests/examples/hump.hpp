#pragma once
#include "model/law.hpp"

namespace stickslip {

struct Hump : LawDefaults {
  static constexpr const char* name = "hump";
  static constexpr bool jumps_at_rest = false;
  double top = 1;
  static std::vector<Declared<Hump>> parameters() {
    using R = Parameter::Range;
    return {{&Hump::top, {"top", "1", R::positive, "velocity", "hump: velocity of largest friction"}}};
  }

  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign) const {
    const Real u = psi / top, w = 1 / (1 + u * u);
    return {2 * u * w, 2 * (1 - u * u) * w * w / top};
  }
  SlopeBounds slope_bounds() const { return {0.25 / top, 2 / top}; }  // at sqrt(3) times the top, and at rest
};

}  // namespace stickslip
