// Slip weakening: F = [fd + (fs - fd) exp(-s/Dc)] sgn(psi), where s is the slip since the contact was at
// rest, or linear, F = [fd + (fs - fd) max(0, 1 - s/Dc)] sgn(psi), which has a kink at s = Dc (Y. Ida, J.
// Geophys. Res. 77 (1972) 3796; D. J. Andrews, ibid. 81 (1976) 5679). Slip is forgotten over the time t_h:
// s_t = |psi| - s/t_h.
#pragma once

#include "model/law.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

struct SlipMemory : StateDefaults {
  static constexpr const char *name = "slip-memory", *symbol = "slip", *unit = "length";
  static constexpr const char* meaning = "contact state: slip since rest";
  static constexpr bool logarithmic = false;
  static constexpr bool of_its_law = true;
  double t_h = 1;
  static std::vector<Declared<SlipMemory>> parameters() {
    return {{&SlipMemory::t_h,
             {"t_h", "1", Parameter::Range::positive, "time",
              "slip-weakening: time in which slip is forgotten"}}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    return {direction * psi - s / t_h, direction, -1 / t_h};
  }
  double steady_state(double psi) const { return std::abs(psi) * t_h; }
  double at_rest(double s, double t) const { return s * std::exp(-t / t_h); }
  double time_at_rest(double) const { return t_h; }
};

struct SlipWeakening : LawDefaults {
  static constexpr const char* name = "slip-weakening";
  static constexpr bool jumps_at_rest = true, has_factor = true;
  using State = SlipMemory;
  double fs = 1, fd = 0.5, Dc = 1, linear = 0;
  static std::vector<Declared<SlipWeakening>> parameters() {
    using R = Parameter::Range;
    using L = SlipWeakening;
    return {{&L::fs, {"fs", "1", R::positive, "", ""}},
            {&L::fd, {"fd", "0.5", R::not_negative, "", ""}},
            {&L::Dc, {"Dc", "1", R::positive, "length", "slip-weakening: slip over which fs falls to fd"}},
            {&L::linear,
             {"weakening", "exponential", R::word, "", "slip-weakening: how friction falls with slip", "", "",
              false, "exponential linear"}}};
  }
  void check() const {
    if (fd > fs)
      throw UsageError("-friction_fd " + number_text(fd) +
                       ": dynamic friction must not exceed the static threshold friction_fs " +
                       number_text(fs));
  }

  LawScales scales() const { return {0, fs, Dc, Dc}; }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    return sign.sign_slope(psi);
  }
  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    using elementary::exp, elementary::where_less;
    const Real u = s / Dc, e = exp(-u);
    const Real straight = where_less(u, 1, Real(1 - u), Real(0.)),
               falls = where_less(u, 1, Real(1.), Real(0.));
    const double drop = fs - fd;
    return {fd + drop * (linear * straight + (1 - linear) * e),
            -drop / Dc * (linear * falls + (1 - linear) * e)};
  }
  double factor_at_long_rest() const { return fs; }
};

}  // namespace stickslip
