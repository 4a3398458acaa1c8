// phi = (1 - sigma) sgn(psi)/(1 + 2 alpha |psi|/(1 - sigma)); equation (2) of the paper is sigma = 0, alpha =
// 1/2.
#pragma once

#include "model/law.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

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

}  // namespace stickslip
