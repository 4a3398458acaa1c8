// Laws with a state law of their own: what has slipped, or how far bristles are bent.
#pragma once

#include "model/law.hpp"
#include "model/laws/of_velocity.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// Slip weakening: F = [fd + (fs - fd) exp(-s/Dc)] sgn(psi), where s is the slip since the contact was at
// rest, or linear, F = [fd + (fs - fd) max(0, 1 - s/Dc)] sgn(psi), which has a kink at s = Dc (Y. Ida, J.
// Geophys. Res. 77 (1972) 3796; D. J. Andrews, ibid. 81 (1976) 5679). Slip is forgotten over the time t_h:
// s_t = |psi| - s/t_h.
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

// Friction by bristles that bend: LuGre's law, z_t = psi - |psi| z/g(psi) with g = [fc + (fs - fc)
// exp(-(psi/vs)^2)]/sigma0 and F = sigma0 z + sigma1 z_t + sigma2 psi (C. Canudas de Wit, H. Olsson, K. J.
// Astrom and P. Lischinsky, IEEE Trans. Automat. Control 40 (1995) 419). The deflection z has either sign and
// is 0 in a fresh contact. There is no threshold: at rest friction is a spring sigma0.

// The rate, which needs the law's parameters, stands with the laws.
struct Bristles : StateDefaults {
  static constexpr const char *name = "bristles", *symbol = "z", *unit = "length";
  static constexpr const char* meaning = "contact state: deflection of the bristles";
  static constexpr bool logarithmic = false;
  static constexpr bool of_its_law = true;
  static std::vector<Declared<Bristles>> parameters() { return {}; }
};

// Of a law L with sigma0, sigma1, sigma2 and largest(psi), the deflection g of steady motion with its slope.
template <class L>
struct OfBristles : LawDefaults {
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true, has_rate = true;
  using State = Bristles;

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real z, double direction) const {
    const WithSlopeOf<Real> g = law().largest(psi);
    const Real speed = direction * psi, bent = z / g.value;
    return {psi - speed * bent, 1 - direction * bent + speed * bent * g.slope / g.value, -speed / g.value};
  }
  template <class Real>
  PartialsOf<Real> partials(Real psi, Real z) const {
    const double s0 = law().sigma0, s1 = law().sigma1, s2 = law().sigma2;
    const RatePartialsOf<Real> z_t =
        rate_partials(psi, z, elementary::sign_or_zero(elementary::value_of(psi)));
    return {s0 * z + s1 * z_t.g + s2 * psi, s1 * z_t.g_psi + s2, s0 + s1 * z_t.g_state};
  }
  double steady_state(double psi) const { return elementary::sign_or_zero(psi) * law().largest(psi).value; }

 private:
  const L& law() const { return static_cast<const L&>(*this); }
};

struct LuGre : OfBristles<LuGre> {
  static constexpr const char* name = "lugre";
  double fc = 0.5, fs = 1, vs = 1, sigma0 = 100, sigma1 = 1, sigma2 = 0;
  static std::vector<Declared<LuGre>> parameters() {
    using R = Parameter::Range;
    using L = LuGre;
    return {
        {&L::fc, {"fc", "0.5", R::not_negative, "", ""}},
        {&L::fs, {"fs", "1", R::positive, "", ""}},
        {&L::vs, {"vs", "1", R::positive, "velocity", ""}},
        {&L::sigma0, {"sigma0", "100", R::positive, "1/length", "lugre, dahl: stiffness of the bristles"}},
        {&L::sigma1, {"sigma1", "1", R::not_negative, "1/velocity", "lugre: damping of the bristles"}},
        {&L::sigma2, {"sigma2", "0", R::not_negative, "1/velocity", "lugre: viscous friction"}}};
  }
  void check() const {
    if (fc == 0)
      throw UsageError("-friction_fc 0: above 0 with this law, or the bristles have no deflection at speed");
  }
  LawScales scales() const { return {vs, fs > fc ? fs : fc, fc / sigma0, fc / sigma0}; }
  template <class Real>
  WithSlopeOf<Real> largest(Real psi) const {
    const WithSlopeOf<Real> fall = stribeck_fall(psi, vs, 2);
    return {(fc + (fs - fc) * fall.value) / sigma0, (fs - fc) / sigma0 * fall.slope};
  }
};

// Dahl's friction, z_t = psi (1 - sgn(psi) sigma0 z/fc), F = sigma0 z: a spring that yields at fc (P. Dahl,
// AIAA J. 14 (1976) 1675). It depends on the path alone, not on how fast it is gone.
struct Dahl : OfBristles<Dahl> {
  static constexpr const char* name = "dahl";
  static constexpr double sigma1 = 0, sigma2 = 0;
  double fc = 0.5, sigma0 = 100;
  static std::vector<Declared<Dahl>> parameters() {
    using R = Parameter::Range;
    return {{&Dahl::fc, {"fc", "0.5", R::not_negative, "", ""}},
            {&Dahl::sigma0, {"sigma0", "100", R::positive, "1/length", ""}}};
  }
  void check() const {
    if (fc == 0)
      throw UsageError("-friction_fc 0: above 0 with this law, or the bristles have no deflection");
  }
  LawScales scales() const { return {0, fc, fc / sigma0, fc / sigma0}; }
  template <class Real>
  WithSlopeOf<Real> largest(Real) const {
    return {fc / sigma0, 0.};
  }
};

}  // namespace stickslip
