// Rate-and-state friction for every velocity, F = a asinh[psi/(2 psi0) exp((mu0 + b ln(psi0 theta/D +
// psi0/psi_s))/a)], s = ln(theta): the evolution effect ends at velocities above psi_s, where friction rises
// again. With ageing that is cut off (theta <= D/psi_h) it rises below psi_h too, so that for b > a and psi_h
// << psi_s steady friction is shaped like an N: a maximum near psi_h sqrt(a/(b - a)), a minimum near psi_s (b
// - a)/a.
#pragma once

#include "model/laws/direct_effect.hpp"

namespace stickslip {

struct NShaped : OfDirectEffect<NShaped> {
  static constexpr const char* name = "n-shaped";
  static constexpr const char* usual_state = "ageing-cutoff";
  double a = 0.05, b = 0.1, D = 0.1, mu0 = 0.6, psi0 = 1, psi_s = 1;
  static std::vector<Declared<NShaped>> parameters() {
    using R = Parameter::Range;
    using L = NShaped;
    return {{&L::a, {"a", "0.05", R::positive, "", ""}},
            {&L::b, {"b", "0.1", R::not_negative, "", ""}},
            {&L::D, {"D", "0.1", R::positive, "length", "", "0.1, or state_D", "state_D"}},
            {&L::mu0, {"mu0", "0.6", R::not_negative, "", ""}},
            {&L::psi0, {"psi0", "1", R::positive, "velocity", ""}},
            {&L::psi_s,
             {"psi_s", "1", R::positive, "velocity", "n-shaped: velocity above which friction rises again"}}};
  }

  // l = (mu0 + b ln(psi0 theta/D + psi0/psi_s))/a, and a times its derivative in s
  template <class Real>
  Real exponent(Real s) const {
    using elementary::exp, elementary::log;
    return (mu0 + b * log(psi0 * (exp(s) / D + 1 / psi_s))) / a;
  }
  template <class Real>
  Real evolution(Real s) const {
    using elementary::exp;
    const Real aged = exp(s) / D;
    return b * aged / (aged + 1 / psi_s);
  }
};

}  // namespace stickslip
