// theta_t = -(|psi| theta/D) ln(|psi| theta/D) in s = ln(theta): s_t = -(|psi|/D) [ln(|psi|/D) + s]; 0 at
// rest.
#pragma once

#include "model/states/slip_distance.hpp"

namespace stickslip {

struct Slip : StateDefaults {
  static constexpr const char *name = "slip", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  double D = 1;
  static std::vector<Declared<Slip>> parameters() { return {{&Slip::D, slip_distance}}; }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    using elementary::log, std::abs;
    // so that at rest nothing is infinite, and a l is 0
    constexpr double least = std::numeric_limits<double>::min();
    const Real a = abs(psi) / D, l = log(elementary::where_less(a, least, Real(least), a)) + s;
    return {-a * l, -direction / D * (l + 1), -a};
  }
  double steady_state(double psi) const { return std::log(D / std::abs(psi)); }
};

}  // namespace stickslip
