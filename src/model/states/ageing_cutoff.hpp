// Ageing that ends, theta_t = 1 - theta sqrt(psi^2 + psi_h^2)/D, in s = ln(theta): s_t = exp(-s) - sqrt(psi^2
// + psi_h^2)/D. Contacts slower than psi_h grow no older than D/psi_h.
#pragma once

#include "model/states/slip_distance.hpp"

namespace stickslip {

struct AgeingCutoff : StateDefaults {
  static constexpr const char *name = "ageing-cutoff", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  double D = 1, psi_h = 0.001;
  static std::vector<Declared<AgeingCutoff>> parameters() {
    return {{&AgeingCutoff::D, slip_distance},
            {&AgeingCutoff::psi_h,
             {"psi_h", "0.001", Parameter::Range::positive, "velocity",
              "ageing-cutoff: velocity below which contacts grow no older"}}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double) const {
    using elementary::exp, std::sqrt;
    const Real e = exp(-s), speed = sqrt(psi * psi + psi_h * psi_h);
    return {e - speed / D, -psi / (speed * D), -e};
  }
  double steady_state(double psi) const { return std::log(D / std::hypot(psi, psi_h)); }
};

}  // namespace stickslip
