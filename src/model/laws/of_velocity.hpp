// Laws of one velocity, which may have a state law beside them.
#pragma once

#include "model/law.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// phi = psi^3/3 - psi, equation (4) of the paper.
struct Cubic : LawDefaults {
  static constexpr const char* name = "cubic";
  static constexpr bool jumps_at_rest = false;
  static constexpr bool van_der_pol = true;
  static std::vector<Declared<Cubic>> parameters() { return {}; }

  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign) const {
    return {psi * (psi * psi * (1. / 3) - 1), psi * psi - 1};
  }
  SlopeBounds slope_bounds() const { return {0, 3}; }  // at psi = 2, where the limit cycle turns
  double velocity_of_slope(double slope) const { return std::sqrt(1 + slope); }
};

// phi = (1 - sigma) sgn(psi)/(1 + 2 alpha |psi|/(1 - sigma)); equation (2) of the paper is sigma = 0, alpha =
// 1/2.

// 1/(1 + y) with its slope; against the direction of motion (y < 0) its Taylor polynomial, which joins it
// smoothly enough for methods of order 5 and has no pole for a stage to run into.
template <class Real>
WithSlopeOf<Real> falling(Real y) {
  const Real w = 1 / (1 + y);
  const Real value = y < 0 ? 1 - y * (1 - y * (1 - y * (1 - y))) : w;
  const Real slope = y < 0 ? -1 + y * (2 - y * (3 - y * 4)) : -w * w;
  return {value, slope};
}

struct CarlsonLanger : LawDefaults {
  static constexpr const char* name = "carlson-langer";
  static constexpr bool jumps_at_rest = true;
  double sigma = 0, alpha = 0.5;
  static std::vector<Declared<CarlsonLanger>> parameters() {
    using R = Parameter::Range;
    return {{&CarlsonLanger::sigma,
             {"sigma", "0", R::not_negative, "",
              "carlson-langer: friction drops from 1 to 1 - sigma as motion begins"}},
            {&CarlsonLanger::alpha,
             {"alpha", "0.5", R::not_negative, "",
              "carlson-langer: (1 - sigma)/(1 + 2 alpha |psi|/(1 - sigma))"}}};
  }
  void check() const {
    if (sigma >= 1)
      throw UsageError("-friction_sigma " + number_text(sigma) + ": below 1, or nothing is left of friction");
  }

  double threshold() const { return 1; }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    // what is left of the threshold, and its fall
    const double kinetic = 1 - sigma, weakening = 2 * alpha / kinetic;
    const WithSlopeOf<Real> s = sign.sign_slope(psi), a = sign.magnitude(psi);
    if constexpr (std::is_same_v<Sign, SignFrozen>) {
      const WithSlopeOf<Real> f = falling(weakening * a.value);
      return {s.value * kinetic * f.value, s.value * kinetic * weakening * a.slope * f.slope};
    }
    const Real w = 1 / (1 + weakening * a.value), k = kinetic * w;
    return {s.value * k, (s.slope - s.value * weakening * a.slope * w) * k};
  }
  LawScales scales() const { return {alpha > 0 ? (1 - sigma) / (2 * alpha) : 0, 1, 1}; }
  SlopeBounds slope_bounds() const { return {2 * alpha, 0}; }  // at the start of a slip
  double velocity_of_slope(double slope) const {
    return (std::sqrt(2 * alpha / -slope) - 1) * (1 - sigma) / (2 * alpha);
  }
};

// Static threshold fs, dynamic friction fd sgn(psi). Regularised, friction falls from fs to fd like
// exp(-|psi|/slip_velocity).
struct Coulomb : LawDefaults {
  static constexpr const char* name = "coulomb";
  static constexpr bool jumps_at_rest = true;
  double fs = 1, fd = 0.5, slip_velocity = 1e-2;
  static std::vector<Declared<Coulomb>> parameters() {
    using R = Parameter::Range;
    return {{&Coulomb::fs,
             {"fs", "1", R::positive, "", "coulomb, stribeck, slip-weakening, lugre: static friction"}},
            {&Coulomb::fd,
             {"fd", "0.5", R::not_negative, "",
              "coulomb, slip-weakening: dynamic friction, at most friction_fs"}},
            {&Coulomb::slip_velocity,
             {"slip_velocity", "1e-2", R::positive, "velocity",
              "coulomb, regularised: velocity over which fs falls to fd", "", "", true}}};
  }
  void check() const {
    if (fd > fs)
      throw UsageError("-friction_fd " + number_text(fd) +
                       ": dynamic friction must not exceed the static threshold " + "friction_fs " +
                       number_text(fs));
  }

  LawScales scales() const { return {0, fs, 1}; }
  double threshold() const { return fs; }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    using elementary::exp;
    const WithSlopeOf<Real> s = sign.sign_slope(psi);
    if constexpr (!Sign::smooth) return {fd * s.value, fd * s.slope};
    const WithSlopeOf<Real> a = sign.magnitude(psi);
    const Real e = (fs - fd) * exp(-a.value / slip_velocity), f = fd + e;
    return {f * s.value, f * s.slope - e * a.slope / slip_velocity * s.value};
  }
};

// phi = (fc + (fs - fc) exp(-|psi/vs|^p)) sgn(psi) + viscous psi: Stribeck's curve, a threshold fs, friction
// that falls to fc over the velocity vs and rises with lubrication (R. Stribeck, VDI-Zeitschrift 46 (1902);
// in this form B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica 30 (1994) 1083).

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

// phi = fc tanh(psi/vs): Coulomb's friction smoothed over the velocity vs, without a threshold.
struct Tanh : LawDefaults {
  static constexpr const char* name = "tanh";
  static constexpr bool jumps_at_rest = false;
  double fc = 0.5, vs = 1;
  static std::vector<Declared<Tanh>> parameters() {
    using R = Parameter::Range;
    return {{&Tanh::fc, {"fc", "0.5", R::not_negative, "", ""}},
            {&Tanh::vs, {"vs", "1", R::positive, "velocity", ""}}};
  }

  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign) const {
    using elementary::tanh;
    const Real t = tanh(psi / vs);
    return {fc * t, fc * (1 - t * t) / vs};
  }
  LawScales scales() const { return {vs, fc > 0 ? fc : 1, 1}; }
  SlopeBounds slope_bounds() const { return {0, fc / vs}; }  // at rest
};

}  // namespace stickslip
