// theta_t = 1 - |psi| theta/D in s = ln(theta): s_t = exp(-s) - |psi|/D.
#pragma once

#include "model/states/slip_distance.hpp"

namespace stickslip {

struct Ageing : StateDefaults {
  static constexpr const char *name = "ageing", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  double D = 1;
  static std::vector<Declared<Ageing>> parameters() { return {{&Ageing::D, slip_distance}}; }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    using elementary::exp;
    const Real e = exp(-s);
    return {e - direction * psi / D, -direction / D, -e};
  }
  double steady_state(double psi) const { return std::log(D / std::abs(psi)); }
};

}  // namespace stickslip
