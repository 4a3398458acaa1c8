// Friction by bristles that bend: LuGre's law, z_t = psi - |psi| z/g(psi) with g = [fc + (fs - fc)
// exp(-(psi/vs)^2)]/sigma0 and F = sigma0 z + sigma1 z_t + sigma2 psi (C. Canudas de Wit, H. Olsson, K. J.
// Astrom and P. Lischinsky, IEEE Trans. Automat. Control 40 (1995) 419). The deflection z has either sign and
// is 0 in a fresh contact. There is no threshold: at rest friction is a spring sigma0.
#pragma once

#include "model/laws/stribeck.hpp"

namespace stickslip {

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

}  // namespace stickslip
