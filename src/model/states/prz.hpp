// theta_t = 1 - (psi theta/(2 D))^2 in s = ln(theta): s_t = exp(-s) - psi^2 exp(s)/(4 D^2) (G. Perrin, J. R.
// Rice and G. Zheng, J. Mech. Phys. Solids 43 (1995) 1461). Steady theta is 2 D/|psi|, so that theta/2 stands
// in friction where the other laws have theta; around sliding it is the slip law to first order, and it heals
// at rest.
#pragma once

#include "model/states/slip_distance.hpp"

namespace stickslip {

struct PerrinRiceZheng : StateDefaults {
  static constexpr const char *name = "prz", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  static constexpr double enters_with = -0.693147180559945309;  // ln(1/2)
  double D = 1;
  static std::vector<Declared<PerrinRiceZheng>> parameters() {
    return {{&PerrinRiceZheng::D, slip_distance}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double) const {
    using elementary::exp;
    const Real youth = exp(-s), worn = psi * exp(s) / (4 * D * D);
    return {youth - psi * worn, -2 * worn, -youth - psi * worn};
  }
  double steady_state(double psi) const { return std::log(2 * D / std::abs(psi)); }
};

}  // namespace stickslip
