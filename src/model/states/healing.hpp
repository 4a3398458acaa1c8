// Static friction grows to tau_inf at rest and returns to 1 after the slip D:
// F = tau phi, tau_t = (tau_inf - tau)/t_h - (|psi|/D)(tau - 1). s = tau.
#pragma once

#include "model/states/slip_distance.hpp"

namespace stickslip {

struct Healing : StateDefaults {
  static constexpr const char *name = "healing", *symbol = "tau", *unit = "1";
  static constexpr const char* meaning = "contact state: strength over that of fresh contacts";
  static constexpr bool logarithmic = false;
  static constexpr bool is_factor = true, needs_threshold = true;
  double t_h = 1, tau_inf = 2, D = 1;
  static std::vector<Declared<Healing>> parameters() {
    using R = Parameter::Range;
    return {{&Healing::t_h,
             {"t_h", "1", R::positive, "time",
              "healing: healing time; slip-weakening: time in which slip is forgotten"}},
            {&Healing::tau_inf,
             {"tau_inf", "2", R::positive, "",
              "healing: strength reached at rest, in units of the moving contact's"}},
            {&Healing::D, slip_distance}};
  }

  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    return {s, 1.};
  }
  double factor_at_long_rest() const { return tau_inf; }
  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    const Real a = direction * psi;
    return {(tau_inf - s) / t_h - a / D * (s - 1), -direction / D * (s - 1), -1 / t_h - a / D};
  }
  double at_rest(double s, double t) const { return tau_inf + (s - tau_inf) * std::exp(-t / t_h); }
  double time_at_rest(double) const { return t_h; }
  double steady_state(double psi) const {
    const double a = std::abs(psi) / D;
    return (tau_inf / t_h + a) / (1 / t_h + a);
  }
};

}  // namespace stickslip
