// What rate-and-state laws share, F = a asinh[psi/(2 psi0) exp(l)]: they differ in the exponent l that the
// state gives.
#pragma once

#include "model/law.hpp"

namespace stickslip {

// The argument q = psi/(2 psi0) exp(l) of asinh is kept as a logarithm, since exp(mu0/a) overflows for a
// below mu0/700.
struct DirectEffect {
  double a, psi0;

  // `evolution`: a times the derivative of l in the state. Without a branch, for loops over nodes.
  template <class Real>
  PartialsOf<Real> partials(Real psi, Real l, Real evolution) const {
    using elementary::exp, elementary::log_sum, elementary::where_less, std::abs, std::sqrt;
    const Real magnitude = abs(psi);
    const double sign = elementary::sign_of(elementary::value_of(psi)), per = 1 / (2 * psi0);
    // exp(l) in two factors: so q overflows only where it is beyond any velocity's
    const Real root_exp = exp(where_less(l, 1400, l, Real(1400.)) / 2),
               q = magnitude * (root_exp * per) * root_exp;
    const Real root = sqrt(1 + q * q), above = q + q * (q / (1 + root));  // asinh(q) = ln(1 + above)
    // From here on asinh(q) = ln(2 q), q/sqrt(1 + q^2) = 1 to the last digit: ln(magnitude) - ln(psi0) + l.
    constexpr double far = 5e8;
    const Real one_above = 1 + above, u = where_less(q, far, one_above, magnitude);
    const Real lost = where_less(q, far, Real(above - (one_above - 1)), Real(0.));
    const Real rest = where_less(q, far, Real(0.), Real(l - elementary::log(psi0)));
    // At rest alone is the slope in danger of overflow.
    const Real capped = where_less(root_exp, 1e130, root_exp, Real(1e130)), slope = capped * capped * per;
    return {sign * a * (log_sum(u, lost) + rest),
            a * where_less(q, far, Real(slope / root), Real(1 / magnitude)),
            sign * evolution * where_less(q, far, Real(q / root), Real(1.))};
  }

  // Over decades of velocity F is a logarithm, on which Newton's steps in psi shoot through zero, while steps
  // in F are exact; where the mass outweighs friction it is the other way round. For psi > 0 the left side is
  // concave in psi and convex in F, so that the two steps enclose the solution; of the enclosed values the
  // one nearest to psi = a/mass, where both terms weigh alike, makes the most of either. `force`: F after the
  // linear step to psi_new; l: the exponent there.
  double nearest_psi(double psi, double psi_new, double force, double l, double mass) const {
    using elementary::exp, elementary::expm1, elementary::where_less;
    // psi = 2 psi0 exp(-l) sinh(y)
    const double y = force / a, m = std::abs(y), exponent = m - l;
    const double magnitude = -psi0 * exp(where_less(exponent, 600, exponent, 600)) * expm1(-2 * m);
    const double by_force = elementary::sign_of(y) * magnitude, sign = elementary::sign_of(psi),
                 linear = sign * psi_new;
    const double nearer = where_less(magnitude, std::abs(psi_new), by_force, psi_new);
    const double low = where_less(linear, magnitude, linear, magnitude);
    const double high = where_less(linear, magnitude, magnitude, linear);
    const double balance = a / mass, above = where_less(low, balance, balance, low);
    const double enclosed = sign * where_less(above, high, above, high);
    // of one sign, of which 0 is none
    return where_less(0, by_force * psi, enclosed, nearer);
  }
};

// Of a law L with a, psi0, exponent(s) and evolution(s): the l above, and a times its derivative.
template <class L>
struct OfDirectEffect : LawDefaults {
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true, steep = true;

  template <class Real>
  PartialsOf<Real> partials(Real psi, Real s) const {
    const L& law = static_cast<const L&>(*this);
    return DirectEffect{law.a, law.psi0}.partials(psi, law.exponent(s), Real(law.evolution(s)));
  }
  LawScales scales() const {
    const L& law = static_cast<const L&>(*this);
    return {0, law.mu0 > law.a ? law.mu0 : law.a, 1};
  }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    const L& law = static_cast<const L&>(*this);
    const Partials p = partials(psi, s);
    const double force = p.F + p.F_psi * (psi_new - psi) + p.F_state * (s_new - s);
    return DirectEffect{law.a, law.psi0}.nearest_psi(psi, psi_new, force, law.exponent(s_new), mass);
  }
};

}  // namespace stickslip
