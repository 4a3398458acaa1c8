// Regularised Dieterich-Ruina friction, F = a asinh[psi/(2 psi0) exp((mu0 + b ln(psi0 theta/D))/a)], s =
// ln(theta).
#pragma once

#include "model/laws/direct_effect.hpp"

namespace stickslip {

struct RateAndState : OfDirectEffect<RateAndState> {
  static constexpr const char* name = "rate-and-state";
  double a = 0.05, b = 0.1, D = 0.1, mu0 = 0.6, psi0 = 1;
  static std::vector<Declared<RateAndState>> parameters() {
    using R = Parameter::Range;
    using L = RateAndState;
    return {
        {&L::a, {"a", "0.05", R::positive, "", "rate-and-state, n-shaped, dieterich: direct effect a"}},
        {&L::b, {"b", "0.1", R::not_negative, "", "rate-and-state, n-shaped, dieterich: evolution effect b"}},
        {&L::D,
         {"D", "0.1", R::positive, "length", "rate-and-state, n-shaped, dieterich: slip distance D",
          "0.1, or state_D", "state_D"}},
        {&L::mu0,
         {"mu0", "0.6", R::not_negative, "",
          "rate-and-state, n-shaped, dieterich: friction at the reference velocity"}},
        {&L::psi0,
         {"psi0", "1", R::positive, "velocity", "rate-and-state, n-shaped, dieterich: reference velocity"}}};
  }

  // l = (mu0 + b ln(psi0 theta/D))/a, so that q = psi/(2 psi0) exp(l)
  template <class Real>
  Real exponent(Real s) const {
    return (mu0 + b * (elementary::log(psi0 / D) + s)) / a;
  }
  template <class Real>
  Real evolution(Real) const {
    return b;
  }
};

}  // namespace stickslip
