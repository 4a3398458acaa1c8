// Regularised Dieterich-Ruina friction, F = a asinh[psi/(2 psi0) exp((mu0 + b ln(psi0 theta/D))/a)], s = ln(theta).
#pragma once

#include "model/law.hpp"

namespace stickslip {

// The argument q of asinh is kept as a logarithm, since exp(mu0/a) overflows for a below mu0/700.
struct RateAndState {
  static constexpr const char* name = "rate-and-state";
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true;
  double a = 0.05, b = 0.1, D = 0.1, mu0 = 0.6, psi0 = 1;
  static std::vector<Declared<RateAndState>> parameters() {
    using R = Parameter::Range;
    using L = RateAndState;
    return {{&L::a, {"a", "0.05", R::positive, "", "rate-and-state: direct effect a"}},
            {&L::b, {"b", "0.1", R::not_negative, "", "rate-and-state: evolution effect b"}},
            {&L::D,
             {"D", "0.1", R::positive, "length", "rate-and-state: slip distance D", "0.1, or state_D", "state_D"}},
            {&L::mu0, {"mu0", "0.6", R::not_negative, "", "rate-and-state: friction at the reference velocity"}},
            {&L::psi0, {"psi0", "1", R::positive, "velocity", "rate-and-state: reference velocity"}}};
  }

  // l = (mu0 + b ln(psi0 theta/D))/a, so that q = psi/(2 psi0) exp(l)
  template <class Real>
  Real exponent(Real s) const { return (mu0 + b * (std::log(psi0 / D) + s)) / a; }

  template <class Real>
  PartialsOf<Real> partials(Real psi, Real s) const {
    using std::abs, std::asinh, std::exp, std::log, std::sqrt;
    const Real l = exponent(s), magnitude = abs(psi);
    const double sign = psi < 0 ? -1. : 1.;
    const Real lq = magnitude > 0 ? log(magnitude / (2 * psi0)) + l : -std::numeric_limits<double>::infinity();
    if (lq > 20) {  // beyond: asinh(q) = ln(2 q), q/sqrt(1 + q^2) = 1 to the last digit
      return {sign * a * (lq + log(2.)), a / magnitude, sign * b};
    }
    // At rest alone is the slope in danger of overflow.
    const Real slope = exp(l < 600 ? l : 600.) / (2 * psi0), q = exp(lq), root = sqrt(1 + q * q);
    return {sign * a * asinh(q), a * slope / root, sign * b * q / root};
  }

  // Over decades of velocity F is a logarithm, on which Newton's steps in psi shoot through zero, while steps in F are
  // exact; where the mass outweighs friction it is the other way round. For psi > 0 the left side is concave in psi and
  // convex in F, so that the two steps enclose the solution; of the enclosed values the one nearest to psi = a/mass,
  // where both terms weigh alike, makes the most of either.
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    const Partials p = partials(psi, s);
    const double y = (p.F + p.F_psi * (psi_new - psi) + p.F_state * (s_new - s)) / a;  // F/a after the step
    // psi = 2 psi0 exp(-l) sinh(y), as a logarithm
    const double l = exponent(s_new), m = std::abs(y);
    const double log_sinh = m > 20 ? m - std::log(2.) : std::log(std::sinh(m));
    const double magnitude = 2 * psi0 * std::exp(std::min(log_sinh - l, 600.));
    const double by_force = y < 0 ? -magnitude : magnitude;
    if (by_force * psi <= 0) return std::abs(by_force) < std::abs(psi_new) ? by_force : psi_new;
    const double sign = psi < 0 ? -1. : 1., low = std::min(sign * psi_new, magnitude);
    const double high = std::max(sign * psi_new, magnitude);
    return sign * std::min(std::max(a / mass, low), high);
  }
};

}  // namespace stickslip
