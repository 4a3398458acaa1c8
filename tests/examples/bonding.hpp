#pragma once
#include "model/laws/with_state.hpp"

namespace stickslip {

struct Bonding : StateDefaults {
  static constexpr const char *name = "bonding", *symbol = "bonds", *unit = "1";
  static constexpr const char* meaning = "contact state: share of the bonds that have formed";
  static constexpr bool logarithmic = false, is_factor = true;
  double t_h = 1, b = 0.5, D = 1;
  static std::vector<Declared<Bonding>> parameters() {
    using R = Parameter::Range;
    return {{&Bonding::t_h, {"t_h", "1", R::positive, "time", "bonding: time in which bonds form"}},
            {&Bonding::b, {"b", "0.5", R::not_negative, "", "bonding: strength of all bonds"}},
            {&Bonding::D, slip_distance}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    const Real a = direction * psi / D;
    return {(1 - s) / t_h - a * s, -direction * s / D, -1 / t_h - a};
  }
  double steady_state(double psi) const { return 1 / (1 + t_h * std::abs(psi) / D); }

  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    return {1 + b * s, b};
  }
  double at_rest(double s, double t) const { return 1 + (s - 1) * std::exp(-t / t_h); }
  double time_at_rest(double) const { return t_h; }
  double factor_at_long_rest() const { return 1 + b; }
};

}  // namespace stickslip
