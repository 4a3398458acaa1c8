// The state laws, but those that belong to one law (laws/of_velocity.hpp), and the laws that are no product
// of a function of velocity and one of the state.
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

// What rate-and-state laws share, F = a asinh[psi/(2 psi0) exp(l)]: they differ in the exponent l that the
// state gives.

// The argument q = psi/(2 psi0) exp(l) of asinh is kept as a logarithm, since exp(mu0/a) overflows for a
// below mu0/700.
struct DirectEffect {
  double a, psi0;

  // `evolution`: a times the derivative of l in the state. Without a branch, for loops over nodes.
  template <class Real>
  PartialsOf<Real> partials(Real psi, Real l, Real evolution) const {
    using elementary::exp, elementary::log_sum, elementary::where_less, std::abs, std::sqrt;
    const Real magnitude = abs(psi);
    const double sign = elementary::sign_of(elementary::value_of(psi)), per = 1 / (2 * psi0);
    // exp(l) in two factors: so q overflows only where it is beyond any velocity's
    const Real root_exp = exp(where_less(l, 1400, l, Real(1400.)) / 2),
               q = magnitude * (root_exp * per) * root_exp;
    const Real root = sqrt(1 + q * q), above = q + q * (q / (1 + root));  // asinh(q) = ln(1 + above)
    // From here on asinh(q) = ln(2 q), q/sqrt(1 + q^2) = 1 to the last digit: ln(magnitude) - ln(psi0) + l.
    constexpr double far = 5e8;
    const Real one_above = 1 + above, u = where_less(q, far, one_above, magnitude);
    const Real lost = where_less(q, far, Real(above - (one_above - 1)), Real(0.));
    const Real rest = where_less(q, far, Real(0.), Real(l - elementary::log(psi0)));
    // At rest alone is the slope in danger of overflow.
    const Real capped = where_less(root_exp, 1e130, root_exp, Real(1e130)), slope = capped * capped * per;
    return {sign * a * (log_sum(u, lost) + rest),
            a * where_less(q, far, Real(slope / root), Real(1 / magnitude)),
            sign * evolution * where_less(q, far, Real(q / root), Real(1.))};
  }

  // psi = 2 psi0 exp(-l) sinh(y), the inverse of F = a y; without a branch.
  VelocityOfForce velocity(double y, double l, double evolution) const {
    using elementary::exp, elementary::expm1;
    const double sign = elementary::sign_of(y), m = sign * y, half = psi0 * exp(m - l), less = expm1(-2 * m);
    const double psi = -sign * half * less;
    return {psi, half * (2 + less), -psi * (evolution / a)};
  }

  // Over decades of velocity F is a logarithm, on which Newton's steps in psi shoot through zero, while steps
  // in F are exact; where the mass outweighs friction it is the other way round. For psi > 0 the left side is
  // concave in psi and convex in F, so that the two steps enclose the solution; of the enclosed values the
  // one nearest to psi = a/mass, where both terms weigh alike, makes the most of either. `force`: F after the
  // linear step to psi_new; l: the exponent there.
  double nearest_psi(double psi, double psi_new, double force, double l, double mass) const {
    using elementary::exp, elementary::expm1, elementary::where_less;
    // psi = 2 psi0 exp(-l) sinh(y)
    const double y = force / a, m = std::abs(y), exponent = m - l;
    const double magnitude = -psi0 * exp(where_less(exponent, 600, exponent, 600)) * expm1(-2 * m);
    const double by_force = elementary::sign_of(y) * magnitude, sign = elementary::sign_of(psi),
                 linear = sign * psi_new;
    const double nearer = where_less(magnitude, std::abs(psi_new), by_force, psi_new);
    const double low = where_less(linear, magnitude, linear, magnitude);
    const double high = where_less(linear, magnitude, magnitude, linear);
    const double balance = a / mass, above = where_less(low, balance, balance, low);
    const double enclosed = sign * where_less(above, high, above, high);
    // of one sign, of which 0 is none
    return where_less(0, by_force * psi, enclosed, nearer);
  }
};

// Of a law L with a, psi0, exponent(s) and evolution(s): the l above, and a times its derivative.
template <class L>
struct OfDirectEffect : LawDefaults {
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true, steep = true, gives_velocity = true;

  template <class Real>
  PartialsOf<Real> partials(Real psi, Real s) const {
    const L& law = static_cast<const L&>(*this);
    return DirectEffect{law.a, law.psi0}.partials(psi, law.exponent(s), Real(law.evolution(s)));
  }
  LawScales scales() const {
    const L& law = static_cast<const L&>(*this);
    return {0, law.mu0 > law.a ? law.mu0 : law.a, 1};
  }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    const L& law = static_cast<const L&>(*this);
    const Partials p = partials(psi, s);
    const double force = p.F + p.F_psi * (psi_new - psi) + p.F_state * (s_new - s);
    return DirectEffect{law.a, law.psi0}.nearest_psi(psi, psi_new, force, law.exponent(s_new), mass);
  }
  VelocityOfForce velocity(double y, double s) const {
    const L& law = static_cast<const L&>(*this);
    return DirectEffect{law.a, law.psi0}.velocity(y, law.exponent(s), law.evolution(s));
  }
};

// Regularised Dieterich-Ruina friction, F = a asinh[psi/(2 psi0) exp((mu0 + b ln(psi0 theta/D))/a)], s =
// ln(theta).
struct RateAndState : OfDirectEffect<RateAndState> {
  static constexpr const char* name = "rate-and-state";
  double a = 0.05, b = 0.1, D = 0.1, mu0 = 0.6, psi0 = 1;
  static std::vector<Declared<RateAndState>> parameters() {
    using R = Parameter::Range;
    using L = RateAndState;
    return {
        {&L::a, {"a", "0.05", R::positive, "", "rate-and-state, n-shaped, dieterich: direct effect a"}},
        {&L::b, {"b", "0.1", R::not_negative, "", "rate-and-state, n-shaped, dieterich: evolution effect b"}},
        {&L::D,
         {"D", "0.1", R::positive, "length", "rate-and-state, n-shaped, dieterich: slip distance D",
          "0.1, or state_D", "state_D"}},
        {&L::mu0,
         {"mu0", "0.6", R::not_negative, "",
          "rate-and-state, n-shaped, dieterich: friction at the reference velocity"}},
        {&L::psi0,
         {"psi0", "1", R::positive, "velocity", "rate-and-state, n-shaped, dieterich: reference velocity"}}};
  }

  // l = (mu0 + b ln(psi0 theta/D))/a, so that q = psi/(2 psi0) exp(l)
  template <class Real>
  Real exponent(Real s) const {
    return (mu0 + b * (elementary::log(psi0 / D) + s)) / a;
  }
  template <class Real>
  Real evolution(Real) const {
    return b;
  }
};

// Rate-and-state friction for every velocity, F = a asinh[psi/(2 psi0) exp((mu0 + b ln(psi0 theta/D +
// psi0/psi_s))/a)], s = ln(theta): the evolution effect ends at velocities above psi_s, where friction rises
// again. With ageing that is cut off (theta <= D/psi_h) it rises below psi_h too, so that for b > a and psi_h
// << psi_s steady friction is shaped like an N: a maximum near psi_h sqrt(a/(b - a)), a minimum near psi_s (b
// - a)/a.
struct NShaped : OfDirectEffect<NShaped> {
  static constexpr const char* name = "n-shaped";
  static constexpr const char* usual_state = "ageing-cutoff";
  double a = 0.05, b = 0.1, D = 0.1, mu0 = 0.6, psi0 = 1, psi_s = 1;
  static std::vector<Declared<NShaped>> parameters() {
    using R = Parameter::Range;
    using L = NShaped;
    return {{&L::a, {"a", "0.05", R::positive, "", ""}},
            {&L::b, {"b", "0.1", R::not_negative, "", ""}},
            {&L::D, {"D", "0.1", R::positive, "length", "", "0.1, or state_D", "state_D"}},
            {&L::mu0, {"mu0", "0.6", R::not_negative, "", ""}},
            {&L::psi0, {"psi0", "1", R::positive, "velocity", ""}},
            {&L::psi_s,
             {"psi_s", "1", R::positive, "velocity", "n-shaped: velocity above which friction rises again"}}};
  }

  // l = (mu0 + b ln(psi0 theta/D + psi0/psi_s))/a, and a times its derivative in s
  template <class Real>
  Real exponent(Real s) const {
    using elementary::exp, elementary::log;
    return (mu0 + b * log(psi0 * (exp(s) / D + 1 / psi_s))) / a;
  }
  template <class Real>
  Real evolution(Real s) const {
    using elementary::exp;
    const Real aged = exp(s) / D;
    return b * aged / (aged + 1 / psi_s);
  }
};

// Rate-and-state friction as it was measured, F = mu0 + a ln(psi/psi0) + b ln(psi0 theta/D), s = ln(theta),
// for psi > 0 alone (J. H. Dieterich, J. Geophys. Res. 84 (1979) 2161; A. Ruina, ibid. 88 (1983) 10359). The
// law rate-and-state is this one, regularised at rest: at psi >> psi0 exp(-mu0/a) the two are alike.
struct Dieterich : LawDefaults {
  static constexpr const char* name = "dieterich";
  static constexpr const char* only_for = "psi > 0";
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true, steep = true, gives_velocity = true;
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
  VelocityOfForce velocity(double y, double s) const {
    using elementary::exp;
    const double psi = psi0 * exp(y - (mu0 + b * (elementary::log(psi0 / D) + s)) / a);
    return {psi, psi, -psi * (b / a)};
  }
  // As for rate-and-state friction (DirectEffect): for psi > 0 the step in psi falls short of the
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
