// Static threshold fs, dynamic friction fd sgn(psi). Regularised, friction falls from fs to fd like
// exp(-|psi|/slip_velocity).
#pragma once

#include "model/law.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

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

}  // namespace stickslip
