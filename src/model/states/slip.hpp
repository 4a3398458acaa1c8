// theta_t = -(|psi| theta/D) ln(|psi| theta/D) in s = ln(theta): s_t = -(|psi|/D) [ln(|psi|/D) + s]; 0 at rest.
#pragma once

#include "model/states/slip_distance.hpp"

namespace stickslip {

struct Slip {
  static constexpr const char *name = "slip", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  double D = 1;
  static std::vector<Declared<Slip>> parameters() { return {{&Slip::D, slip_distance}}; }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double) const {
    using std::abs, std::log;
    const Real a = abs(psi) / D;
    if (a == 0) return {0., 0., 0.};
    const double sign = psi > 0 ? 1. : -1.;
    const Real l = log(a) + s;
    return {-a * l, -sign / D * (l + 1), -a};
  }
  double steady_state(double psi) const { return std::log(D / std::abs(psi)); }
};

}  // namespace stickslip
