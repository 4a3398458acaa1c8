// What rate-and-state laws share, F = a asinh[psi/(2 psi0) exp(l)]: they differ in the exponent l that the state gives.
#pragma once

#include "model/law.hpp"

namespace stickslip {

// The argument q = psi/(2 psi0) exp(l) of asinh is kept as a logarithm, since exp(mu0/a) overflows for a below mu0/700.
struct DirectEffect {
  double a, psi0;

  // `evolution`: a times the derivative of l in the state.
  template <class Real>
  PartialsOf<Real> partials(Real psi, Real l, Real evolution) const {
    using std::abs, std::asinh, std::exp, std::log, std::sqrt;
    const Real magnitude = abs(psi);
    const double sign = psi < 0 ? -1. : 1.;
    const Real lq = magnitude > 0 ? log(magnitude / (2 * psi0)) + l : -std::numeric_limits<double>::infinity();
    if (lq > 20) {  // beyond: asinh(q) = ln(2 q), q/sqrt(1 + q^2) = 1 to the last digit
      return {sign * a * (lq + log(2.)), a / magnitude, sign * evolution};
    }
    // At rest alone is the slope in danger of overflow.
    const Real slope = exp(l < 600 ? l : 600.) / (2 * psi0), q = exp(lq), root = sqrt(1 + q * q);
    return {sign * a * asinh(q), a * slope / root, sign * evolution * q / root};
  }

  // Over decades of velocity F is a logarithm, on which Newton's steps in psi shoot through zero, while steps in F are
  // exact; where the mass outweighs friction it is the other way round. For psi > 0 the left side is concave in psi and
  // convex in F, so that the two steps enclose the solution; of the enclosed values the one nearest to psi = a/mass,
  // where both terms weigh alike, makes the most of either. `force`: F after the linear step to psi_new; l: the exponent
  // there.
  double nearest_psi(double psi, double psi_new, double force, double l, double mass) const {
    const double y = force / a;
    // psi = 2 psi0 exp(-l) sinh(y), as a logarithm
    const double m = std::abs(y);
    const double log_sinh = m > 20 ? m - std::log(2.) : std::log(std::sinh(m));
    const double magnitude = 2 * psi0 * std::exp(std::min(log_sinh - l, 600.));
    const double by_force = y < 0 ? -magnitude : magnitude;
    if (by_force * psi <= 0) return std::abs(by_force) < std::abs(psi_new) ? by_force : psi_new;
    const double sign = psi < 0 ? -1. : 1., low = std::min(sign * psi_new, magnitude);
    const double high = std::max(sign * psi_new, magnitude);
    return sign * std::min(std::max(a / mass, low), high);
  }
};

// Of a law L with a, psi0, exponent(s) and evolution(s): the l above, and a times its derivative.
template <class L>
struct OfDirectEffect {
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true;

  template <class Real>
  PartialsOf<Real> partials(Real psi, Real s) const {
    const L& law = static_cast<const L&>(*this);
    return DirectEffect{law.a, law.psi0}.partials(psi, law.exponent(s), Real(law.evolution(s)));
  }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    const L& law = static_cast<const L&>(*this);
    const Partials p = partials(psi, s);
    const double force = p.F + p.F_psi * (psi_new - psi) + p.F_state * (s_new - s);
    return DirectEffect{law.a, law.psi0}.nearest_psi(psi, psi_new, force, law.exponent(s_new), mass);
  }
};

}  // namespace stickslip
