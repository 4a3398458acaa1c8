// phi = psi^3/3 - psi, equation (4) of the paper.
#pragma once

#include "model/law.hpp"

namespace stickslip {

struct Cubic : LawDefaults {
  static constexpr const char* name = "cubic";
  static constexpr bool jumps_at_rest = false;
  static constexpr bool van_der_pol = true;
  static std::vector<Declared<Cubic>> parameters() { return {}; }

  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign) const {
    return {psi * (psi * psi * (1. / 3) - 1), psi * psi - 1};
  }
  SlopeBounds slope_bounds() const { return {0, 3}; }  // at psi = 2, where the limit cycle turns
  double velocity_of_slope(double slope) const { return std::sqrt(1 + slope); }
};

}  // namespace stickslip
