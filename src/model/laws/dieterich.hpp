// Rate-and-state friction as it was measured, F = mu0 + a ln(psi/psi0) + b ln(psi0 theta/D), s = ln(theta),
// for psi > 0 alone (J. H. Dieterich, J. Geophys. Res. 84 (1979) 2161; A. Ruina, ibid. 88 (1983) 10359). The
// law rate-and-state is this one, regularised at rest: at psi >> psi0 exp(-mu0/a) the two are alike.
#pragma once

#include "model/law.hpp"

namespace stickslip {

struct Dieterich : LawDefaults {
  static constexpr const char* name = "dieterich";
  static constexpr const char* only_for = "psi > 0";
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true, steep = true;
  double a = 0.05, b = 0.1, D = 0.1, mu0 = 0.6, psi0 = 1;
  static std::vector<Declared<Dieterich>> parameters() {
    using R = Parameter::Range;
    using L = Dieterich;
    return {{&L::a, {"a", "0.05", R::positive, "", ""}},
            {&L::b, {"b", "0.1", R::not_negative, "", ""}},
            {&L::D, {"D", "0.1", R::positive, "length", "", "0.1, or state_D", "state_D"}},
            {&L::mu0, {"mu0", "0.6", R::not_negative, "", ""}},
            {&L::psi0, {"psi0", "1", R::positive, "velocity", ""}}};
  }

  LawScales scales() const { return {0, mu0 > a ? mu0 : a, 1}; }
  template <class Real>
  PartialsOf<Real> partials(Real psi, Real s) const {
    using elementary::log;
    return {mu0 + a * log(psi / psi0) + b * (elementary::log(psi0 / D) + s), a / psi, Real(b)};
  }
  // As for rate-and-state friction (laws/direct_effect.hpp): for psi > 0 the step in psi falls short of the
  // solution and the step in F goes beyond it; of what lies between, the velocity nearest to a/mass.
  double newton_psi(double psi, double, double psi_new, double, double mass) const {
    using elementary::exp, elementary::where_less;
    const double exponent = (psi_new - psi) / psi;
    const double by_force = psi * exp(where_less(exponent, 600, exponent, 600));
    const double low = where_less(psi_new, by_force, psi_new, by_force);
    const double high = where_less(psi_new, by_force, by_force, psi_new);
    const double balance = a / mass, above = where_less(low, balance, balance, low);
    return where_less(above, high, above, high);
  }
};

}  // namespace stickslip
