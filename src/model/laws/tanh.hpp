// phi = fc tanh(psi/vs): Coulomb's friction smoothed over the velocity vs, without a threshold.
#pragma once

#include "model/law.hpp"

namespace stickslip {

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
