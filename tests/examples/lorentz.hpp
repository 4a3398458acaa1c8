#pragma once
#include "model/law.hpp"

namespace stickslip {

struct Lorentz : LawDefaults {
  static constexpr const char* name = "lorentz";
  static constexpr bool jumps_at_rest = true;
  static std::vector<Declared<Lorentz>> parameters() { return {}; }

  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    const WithSlopeOf<Real> s = sign.sign_slope(psi);
    const Real w = 1 / (1 + psi * psi);
    return {s.value * w, (s.slope - 2 * psi * s.value * w) * w};
  }
  SlopeBounds slope_bounds() const { return {0.65, 0}; }  // at 1/sqrt(3)
};

}  // namespace stickslip
