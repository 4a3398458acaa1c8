// The state laws, but those that belong to one law (laws/with_slip.hpp).
#pragma once

#include "model/law.hpp"

namespace stickslip {

// The parameter that every state law of the program has.
inline constexpr Parameter slip_distance{"D",
                                         "1",
                                         Parameter::Range::positive,
                                         "length",
                                         "healing, contact-age: slip distance that renews the contact",
                                         "1; friction_D with rate-and-state, n-shaped, dieterich"};

// Static friction grows to tau_inf at rest and returns to 1 after the slip D:
// F = tau phi, tau_t = (tau_inf - tau)/t_h - (|psi|/D)(tau - 1). s = tau.
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

// theta_t = 1 - |psi| theta/D in s = ln(theta): s_t = exp(-s) - |psi|/D.
struct Ageing : StateDefaults {
  static constexpr const char *name = "ageing", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  double D = 1;
  static std::vector<Declared<Ageing>> parameters() { return {{&Ageing::D, slip_distance}}; }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    using elementary::exp;
    const Real e = exp(-s);
    return {e - direction * psi / D, -direction / D, -e};
  }
  double steady_state(double psi) const { return std::log(D / std::abs(psi)); }
};

// F = (1 + b ln(1 + theta/theta0)) phi, theta_t = 1 - |psi| theta/D. s = ln(theta).
struct ContactAge : Ageing {
  static constexpr const char* name = "contact-age";
  static constexpr bool is_factor = true;
  double b = 0.1, theta0 = 1;
  static std::vector<Declared<ContactAge>> parameters() {
    using R = Parameter::Range;
    return {{&ContactAge::D, slip_distance},
            {&ContactAge::b,
             {"b", "0.1", R::not_negative, "", "contact-age: growth of friction with ln(1 + theta/theta0)"}},
            {&ContactAge::theta0,
             {"theta0", "1", R::positive, "time", "contact-age: age at which growth begins"}}};
  }

  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    using elementary::exp, elementary::log1p;
    const Real r = exp(s) / theta0;
    return {1 + b * log1p(r), b * r / (1 + r)};
  }
  double factor_at_long_rest() const { return std::numeric_limits<double>::infinity(); }
  double at_rest(double s, double t) const { return std::log(std::exp(s) + t); }
  double time_at_rest(double s) const { return theta0 + std::exp(s); }
};

// theta_t = -(|psi| theta/D) ln(|psi| theta/D) in s = ln(theta): s_t = -(|psi|/D) [ln(|psi|/D) + s]; 0 at
// rest.
struct Slip : StateDefaults {
  static constexpr const char *name = "slip", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  double D = 1;
  static std::vector<Declared<Slip>> parameters() { return {{&Slip::D, slip_distance}}; }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    using elementary::log, std::abs;
    // so that at rest nothing is infinite, and a l is 0
    constexpr double least = std::numeric_limits<double>::min();
    const Real a = abs(psi) / D, l = log(elementary::where_less(a, least, Real(least), a)) + s;
    return {-a * l, -direction / D * (l + 1), -a};
  }
  double steady_state(double psi) const { return std::log(D / std::abs(psi)); }
};

// Ageing that ends, theta_t = 1 - theta sqrt(psi^2 + psi_h^2)/D, in s = ln(theta): s_t = exp(-s) - sqrt(psi^2
// + psi_h^2)/D. Contacts slower than psi_h grow no older than D/psi_h.
struct AgeingCutoff : StateDefaults {
  static constexpr const char *name = "ageing-cutoff", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  double D = 1, psi_h = 0.001;
  static std::vector<Declared<AgeingCutoff>> parameters() {
    return {{&AgeingCutoff::D, slip_distance},
            {&AgeingCutoff::psi_h,
             {"psi_h", "0.001", Parameter::Range::positive, "velocity",
              "ageing-cutoff: velocity below which contacts grow no older"}}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double) const {
    using elementary::exp, std::sqrt;
    const Real e = exp(-s), speed = sqrt(psi * psi + psi_h * psi_h);
    return {e - speed / D, -psi / (speed * D), -e};
  }
  double steady_state(double psi) const { return std::log(D / std::hypot(psi, psi_h)); }
};

// theta_t = 1 - (psi theta/(2 D))^2 in s = ln(theta): s_t = exp(-s) - psi^2 exp(s)/(4 D^2) (G. Perrin, J. R.
// Rice and G. Zheng, J. Mech. Phys. Solids 43 (1995) 1461). Steady theta is 2 D/|psi|, so that theta/2 stands
// in friction where the other laws have theta; around sliding it is the slip law to first order, and it heals
// at rest.
struct PerrinRiceZheng : StateDefaults {
  static constexpr const char *name = "prz", *symbol = "theta", *unit = "time";
  static constexpr const char* meaning = "contact state: age";
  static constexpr bool logarithmic = true;
  static constexpr double enters_with = -0.693147180559945309;  // ln(1/2)
  double D = 1;
  static std::vector<Declared<PerrinRiceZheng>> parameters() {
    return {{&PerrinRiceZheng::D, slip_distance}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double) const {
    using elementary::exp;
    const Real youth = exp(-s), worn = psi * exp(s) / (4 * D * D);
    return {youth - psi * worn, -2 * worn, -youth - psi * worn};
  }
  double steady_state(double psi) const { return std::log(2 * D / std::abs(psi)); }
};

}  // namespace stickslip
