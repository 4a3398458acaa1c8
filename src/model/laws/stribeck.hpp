// phi = (fc + (fs - fc) exp(-|psi/vs|^p)) sgn(psi) + viscous psi: Stribeck's curve, a threshold fs, friction
// that falls to fc over the velocity vs and rises with lubrication (R. Stribeck, VDI-Zeitschrift 46 (1902);
// in this form B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica 30 (1994) 1083).
#pragma once

#include "model/law.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// exp(-|a/vs|^p) with its slope in a; against the direction of motion (a < 0) it goes on as smoothly as |a|^p
// lets it: p = 1 rises on, up to e.
template <class Real>
WithSlopeOf<Real> stribeck_fall(Real a, double vs, double p) {
  using elementary::exp, elementary::log, elementary::where_less, elementary::value_of, std::abs;
  constexpr double least = 1e-300;  // at rest the logarithm is finite, and |u|^p 0
  const double side = p == 1 ? elementary::sign_of(value_of(a)) : 1;
  const Real u = abs(a) / vs, l = log(where_less(u, least, Real(least), u));
  const Real power = exp((p - 1) * l);  // |u|^(p - 1)
  const Real w = side * u * power;
  const Real e = exp(where_less(-w, 1, Real(-w), Real(1.)));
  return {e, -e * p * power * (p == 1 ? 1 : elementary::sign_of(value_of(a))) / vs};
}

struct Stribeck : LawDefaults {
  static constexpr const char* name = "stribeck";
  static constexpr bool jumps_at_rest = true;
  double fc = 0.5, fs = 1, vs = 1, p = 2, viscous = 0;
  static std::vector<Declared<Stribeck>> parameters() {
    using R = Parameter::Range;
    using L = Stribeck;
    return {
        {&L::fc, {"fc", "0.5", R::not_negative, "", "stribeck, tanh, lugre, dahl: Coulomb's friction"}},
        {&L::fs, {"fs", "1", R::positive, "", ""}},
        {&L::vs,
         {"vs", "1", R::positive, "velocity",
          "stribeck, lugre: velocity over which fs falls to fc (Stribeck's); tanh: over which it rises"}},
        {&L::p, {"p", "2", R::positive, "", "stribeck: exponent of the fall, at least 1"}},
        {&L::viscous, {"viscous", "0", R::not_negative, "1/velocity", "stribeck: friction per velocity"}}};
  }
  void check() const {
    if (p < 1)
      throw UsageError("-friction_p " + number_text(p) +
                       ": at least 1, below it friction is infinitely steep at rest");
  }

  LawScales scales() const { return {vs, fs > fc ? fs : fc, 1}; }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    const WithSlopeOf<Real> s = sign.sign_slope(psi), a = sign.magnitude(psi);
    const WithSlopeOf<Real> fall = stribeck_fall(a.value, vs, p);
    const Real f = fc + (fs - fc) * fall.value;
    return {s.value * f + viscous * psi, s.slope * f + s.value * a.slope * (fs - fc) * fall.slope + viscous};
  }
  SlopeBounds slope_bounds() const {  // steepest where |psi/vs|^p = (p - 1)/p
    const double at = (p - 1) / p, steepest = p * std::pow(at, at) * std::exp(-at) * (fs - fc) / vs;
    return {std::max(steepest - viscous, 0.), std::max(-steepest, 0.) + viscous};
  }
};

}  // namespace stickslip
