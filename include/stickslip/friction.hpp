// Friction laws F(psi, state) and their kinetic equations state_t = g(psi, state), pointwise.
//
// A friction is a small class without virtual functions, so that the loops over nodes inline it:
//     static constexpr bool has_state
//     double force(psi, s)             F, in units of the common friction amplitude
//     Partials partials(psi, s)        F and its derivatives
//     double rate(psi, s)              g                                    (only with a state)
//     RatePartials rate_partials(psi, s)
//     double steady_state(psi)         the s with g(psi, s) = 0; infinite where there is none
// and, where F is too steep at rest for Newton's method, static constexpr bool steep = true with
//     double newton_psi(psi, s, psi_new, s_new, mass)   (see RateAndState)
// dispatch_friction() turns the parameters of a scene into the class; it is the one place where laws are listed.
//
// The state s that is stored and advanced is tau itself for `healing`, and ln(theta) for the laws in theta, so
// that theta stays positive over any number of decades; to_output() gives what files and pictures show.
//
// Laws of one velocity (F = phi without a state, else times a factor of the state):
//     cubic            phi = psi^3/3 - psi                                    (the paper's equation 4)
//     carlson-langer   phi = (1 - sigma) sgn(psi)/(1 + 2 alpha |psi|/(1 - sigma))   (equation 2: sigma 0, alpha 1/2)
//     coulomb          phi = fd sgn(psi), regularised with a peak of fs
//     rate-and-state   F = a asinh[ psi/(2 psi0) exp((mu0 + b ln(psi0 theta/D))/a) ]
// State laws:
//     healing      F = tau phi,  tau_t = (tau_inf - tau)/t_h - (|psi|/D)(tau - 1)
//     contact-age  F = (1 + b ln(1 + theta/theta0)) phi,  theta_t = 1 - |psi| theta/D
//     ageing       rate-and-state,  theta_t = 1 - |psi| theta/D
//     slip         rate-and-state,  theta_t = -(|psi| theta/D) ln(|psi| theta/D)
// Regularised: sgn(psi) -> tanh(psi/eps), |psi| -> psi tanh(psi/eps). On the exact sliding branch sgn(0) = 0.
//
// Exact stick (see stick.hpp) calls these with the direction of motion given (+1 or -1, or 0 at rest), so that a law
// is smooth through psi = 0; a law of one velocity that can stick says `sticks = true` and gives threshold(), and
// frozen(law, direction) is the law with that direction.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>

#include "stickslip/scene.hpp"

namespace stickslip {

struct Partials {
  double F, F_psi, F_state;
};
struct RatePartials {
  double g, g_psi, g_state;
};
// A value and its derivative with respect to psi.
struct WithSlope {
  double value, slope;
};

// sgn(psi) and |psi| with their slopes, exact or regularised over the velocity eps.
struct SignExact {
  double sign(double psi) const { return psi > 0 ? 1. : psi < 0 ? -1. : 0.; }
  WithSlope sign_slope(double psi) const { return {sign(psi), 0}; }
  WithSlope magnitude(double psi) const { return {std::abs(psi), sign(psi)}; }
};
struct SignRegularised {
  double eps;
  double sign(double psi) const { return std::tanh(psi / eps); }
  WithSlope sign_slope(double psi) const {
    const double t = std::tanh(psi / eps);
    return {t, (1 - t * t) / eps};
  }
  WithSlope magnitude(double psi) const {
    const WithSlope s = sign_slope(psi);
    return {psi * s.value, s.value + psi * s.slope};
  }
};
// The direction of motion is known and stays, whatever psi is.
struct SignFrozen {
  double direction;
  WithSlope sign_slope(double) const { return {direction, 0}; }
  WithSlope magnitude(double psi) const { return {direction * psi, direction}; }
};

// ---- laws of one velocity: phi(psi) -------------------------------------------------------------------------------

struct Cubic {
  static constexpr bool sticks = false;
  double phi(double psi) const { return psi * (psi * psi * (1. / 3) - 1); }
  WithSlope phi_slope(double psi) const { return {phi(psi), psi * psi - 1}; }
};

// 1/(1 + y) with its slope; against the direction of motion (y < 0) its Taylor polynomial, which joins it smoothly enough
// for methods of order 5 and has no pole for a stage to run into.
inline WithSlope falling(double y) {
  const double w = 1 / (1 + y);
  const double value = y < 0 ? 1 - y * (1 - y * (1 - y * (1 - y))) : w;
  const double slope = y < 0 ? -1 + y * (2 - y * (3 - y * 4)) : -w * w;
  return {value, slope};
}

// kinetic = 1 - sigma, what is left of the threshold 1 when motion begins; weakening = 2 alpha/(1 - sigma).
template <class Sign>
struct CarlsonLanger {
  static constexpr bool sticks = std::is_same_v<Sign, SignExact>;
  Sign sign;
  double kinetic = 1, weakening = 1;
  double threshold() const { return 1; }
  double phi(double psi) const { return phi_slope(psi).value; }
  WithSlope phi_slope(double psi) const {
    const WithSlope s = sign.sign_slope(psi), a = sign.magnitude(psi);
    if constexpr (std::is_same_v<Sign, SignFrozen>) {
      const WithSlope f = falling(weakening * a.value);
      return {s.value * kinetic * f.value, s.value * kinetic * weakening * a.slope * f.slope};
    }
    const double w = 1 / (1 + weakening * a.value), k = kinetic * w;
    return {s.value * k, (s.slope - s.value * weakening * a.slope * w) * k};
  }
};
inline CarlsonLanger<SignFrozen> frozen(const CarlsonLanger<SignExact>& law, double direction) {
  return {{direction}, law.kinetic, law.weakening};
}

// Regularised, the friction falls from fs to fd like exp(-|psi|/weakening); on the sliding branch it is fd sgn(psi).
template <class Sign>
struct Coulomb {
  static constexpr bool sticks = std::is_same_v<Sign, SignExact>;
  Sign sign;
  double fs, fd, weakening;  // weakening: slip velocity; 0 on the sliding branch
  double threshold() const { return fs; }
  double phi(double psi) const { return phi_slope(psi).value; }
  WithSlope phi_slope(double psi) const {
    const WithSlope s = sign.sign_slope(psi);
    if (weakening <= 0) return {fd * s.value, fd * s.slope};
    const WithSlope a = sign.magnitude(psi);
    const double e = (fs - fd) * std::exp(-a.value / weakening), f = fd + e;
    return {f * s.value, f * s.slope - e * a.slope / weakening * s.value};
  }
};

inline Coulomb<SignFrozen> frozen(const Coulomb<SignExact>& law, double direction) {
  return {{direction}, law.fs, law.fd, 0};
}

// ---- the factor of the state --------------------------------------------------------------------------------------

struct NoState {
  static constexpr bool has_state = false;
};

// at_rest(s, t): what becomes of s after the time t at psi = 0.

// Static friction grows to tau_inf at rest and returns to 1 after the slip D. s = tau.
struct Healing {
  static constexpr bool has_state = true;
  double t_h, tau_inf, D;
  WithSlope factor(double s) const { return {s, 1}; }
  RatePartials rate_partials(double psi, double s) const { return rate_partials(psi, s, SignExact().sign(psi)); }
  RatePartials rate_partials(double psi, double s, double direction) const {
    const double a = direction * psi;
    return {(tau_inf - s) / t_h - a / D * (s - 1), -direction / D * (s - 1), -1 / t_h - a / D};
  }
  double at_rest(double s, double t) const { return tau_inf + (s - tau_inf) * std::exp(-t / t_h); }
  double steady_state(double psi) const {
    const double a = std::abs(psi) / D;
    return (tau_inf / t_h + a) / (1 / t_h + a);
  }
};

// theta_t = 1 - |psi| theta/D in s = ln(theta): s_t = exp(-s) - |psi|/D.
struct AgeingKinetics {
  static constexpr bool has_state = true;
  double D;
  RatePartials rate_partials(double psi, double s) const { return rate_partials(psi, s, SignExact().sign(psi)); }
  RatePartials rate_partials(double psi, double s, double direction) const {
    const double e = std::exp(-s);
    return {e - direction * psi / D, -direction / D, -e};
  }
  double at_rest(double s, double t) const { return std::log(std::exp(s) + t); }
  double steady_state(double psi) const { return std::log(D / std::abs(psi)); }
};

// theta_t = -(|psi| theta/D) ln(|psi| theta/D) in s = ln(theta): s_t = -(|psi|/D) [ln(|psi|/D) + s]; 0 at rest.
struct SlipKinetics {
  static constexpr bool has_state = true;
  double D;
  RatePartials rate_partials(double psi, double s) const {
    const double a = std::abs(psi) / D;
    if (a == 0) return {0, 0, 0};
    const double sign = psi > 0 ? 1. : -1., l = std::log(a) + s;
    return {-a * l, -sign / D * (l + 1), -a};
  }
  double steady_state(double psi) const { return std::log(D / std::abs(psi)); }
};

struct ContactAge : AgeingKinetics {
  double b, theta0;
  WithSlope factor(double s) const {
    const double r = std::exp(s) / theta0;
    return {1 + b * std::log1p(r), b * r / (1 + r)};
  }
};

// ---- friction = law and state -------------------------------------------------------------------------------------

template <class LawOfVelocity, class State>
struct Friction {
  static constexpr bool has_state = State::has_state;
  static constexpr bool steep = false;
  static constexpr bool sticks = LawOfVelocity::sticks;
  LawOfVelocity law;
  State state;

  double force(double psi, double s) const {
    if constexpr (has_state) {
      return state.factor(s).value * law.phi(psi);
    } else {
      return law.phi(psi);
    }
  }
  Partials partials(double psi, double s) const {
    const WithSlope p = law.phi_slope(psi);
    if constexpr (has_state) {
      const WithSlope m = state.factor(s);
      return {m.value * p.value, m.value * p.slope, m.slope * p.value};
    } else {
      return {p.value, p.slope, 0};
    }
  }
  RatePartials rate_partials(double psi, double s) const {
    if constexpr (has_state) {
      return state.rate_partials(psi, s);
    } else {
      return {0, 0, 0};
    }
  }
  double rate(double psi, double s) const { return rate_partials(psi, s).g; }
  double steady_state(double psi) const {
    if constexpr (has_state) {
      return state.steady_state(psi);
    } else {
      return 0;
    }
  }
};

// Friction that sticks, its direction of motion given.
template <class F>
double sliding_force(const F& f, double psi, double s, double direction) {
  const double phi = frozen(f.law, direction).phi(psi);
  if constexpr (F::has_state) return f.state.factor(s).value * phi;
  else return phi;
}
template <class F>
Partials sliding_partials(const F& f, double psi, double s, double direction) {
  const auto law = frozen(f.law, direction);
  return Friction<std::decay_t<decltype(law)>, decltype(f.state)>{law, f.state}.partials(psi, s);
}
template <class F>
RatePartials sliding_rate(const F& f, double psi, double s, double direction) {
  if constexpr (F::has_state) return f.state.rate_partials(psi, s, direction);
  else return {0, 0, 0};
}
// The force that holds a node at rest at most, and its slope in the state.
template <class F>
WithSlope static_threshold(const F& f, double s) {
  if constexpr (F::has_state) {
    const WithSlope m = f.state.factor(s);
    return {m.value * f.law.threshold(), m.slope * f.law.threshold()};
  } else {
    return {f.law.threshold(), 0};
  }
}

// Regularised Dieterich-Ruina friction. The argument q of asinh is kept as a logarithm, since exp(mu0/a) overflows
// for a below mu0/700.
template <class Kinetics>
struct RateAndState {
  static constexpr bool has_state = true;
  static constexpr bool steep = true;
  static constexpr bool sticks = false;
  double a, b, D, mu0, psi0;
  Kinetics state;

  // l = (mu0 + b ln(psi0 theta/D))/a, so that q = psi/(2 psi0) exp(l)
  double exponent(double s) const { return (mu0 + b * (std::log(psi0 / D) + s)) / a; }

  double force(double psi, double s) const { return partials(psi, s).F; }
  Partials partials(double psi, double s) const {
    const double l = exponent(s), magnitude = std::abs(psi), sign = psi < 0 ? -1. : 1.;
    const double lq = magnitude > 0 ? std::log(magnitude / (2 * psi0)) + l : -std::numeric_limits<double>::infinity();
    if (lq > 20) {  // beyond: asinh(q) = ln(2 q), q/sqrt(1 + q^2) = 1 to the last digit
      return {sign * a * (lq + std::log(2.)), a / magnitude, sign * b};
    }
    // At rest alone is the slope in danger of overflow.
    const double slope = std::exp(std::min(l, 600.)) / (2 * psi0), q = std::exp(lq), root = std::sqrt(1 + q * q);
    return {sign * a * std::asinh(q), a * slope / root, sign * b * q / root};
  }
  RatePartials rate_partials(double psi, double s) const { return state.rate_partials(psi, s); }
  double rate(double psi, double s) const { return state.rate_partials(psi, s).g; }
  double steady_state(double psi) const { return state.steady_state(psi); }

  // Where Newton's method on  mass psi + F(psi, s) = given,  at (psi, s), with its step to (psi_new, s_new), should go
  // instead. Over decades of velocity F is a logarithm, on which Newton's steps in psi shoot through zero, while
  // steps in F are exact; where the mass outweighs friction it is the other way round. For psi > 0 the left side is
  // concave in psi and convex in F, so that the two steps enclose the solution; of the enclosed values the one
  // nearest to psi = a/mass, where both terms weigh alike, makes the most of either.
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    const Partials p = partials(psi, s);
    const double y = (p.F + p.F_psi * (psi_new - psi) + p.F_state * (s_new - s)) / a;  // F/a after the step
    // psi = 2 psi0 exp(-l) sinh(y), as a logarithm
    const double l = exponent(s_new), m = std::abs(y);
    const double log_sinh = m > 20 ? m - std::log(2.) : std::log(std::sinh(m));
    const double magnitude = 2 * psi0 * std::exp(std::min(log_sinh - l, 600.));
    const double by_force = y < 0 ? -magnitude : magnitude;
    if (by_force * psi <= 0) return std::abs(by_force) < std::abs(psi_new) ? by_force : psi_new;
    const double sign = psi < 0 ? -1. : 1., low = std::min(sign * psi_new, magnitude);
    const double high = std::max(sign * psi_new, magnitude);
    return sign * std::min(std::max(a / mass, low), high);
  }
};

// What the stored state means outside: tau itself, or theta = exp(s).
inline bool state_is_logarithmic(StateLaw law) { return law != StateLaw::none && law != StateLaw::healing; }
inline const char* state_name(StateLaw law) { return law == StateLaw::healing ? "tau" : "theta"; }
inline double state_to_output(StateLaw law, double s) { return state_is_logarithmic(law) ? std::exp(s) : s; }
inline double state_from_output(StateLaw law, double s) { return state_is_logarithmic(law) ? std::log(s) : s; }

namespace detail {
template <class LawOfVelocity, class Body>
decltype(auto) with_state(const FrictionParameters& p, const LawOfVelocity& law, Body&& body) {
  switch (p.state) {
    case StateLaw::healing:
      return body(Friction<LawOfVelocity, Healing>{law, {p.t_h, p.tau_inf, p.state_D}});
    case StateLaw::contact_age:
      return body(Friction<LawOfVelocity, ContactAge>{law, {{p.state_D}, p.state_b, p.theta0}});
    default:
      return body(Friction<LawOfVelocity, NoState>{law, {}});
  }
}
}  // namespace detail

// Calls body(friction) with the class that the parameters name. Add a law here, and nowhere else.
template <class Body>
decltype(auto) dispatch_friction(const FrictionParameters& p, Body&& body) {
  switch (p.law) {
    case Law::carlson_langer:
      if (p.regularised)
        return detail::with_state(
            p, CarlsonLanger<SignRegularised>{{p.eps}, 1 - p.sigma, 2 * p.alpha / (1 - p.sigma)}, body);
      return detail::with_state(p, CarlsonLanger<SignExact>{{}, 1 - p.sigma, 2 * p.alpha / (1 - p.sigma)}, body);
    case Law::coulomb:
      if (p.regularised) return detail::with_state(p, Coulomb<SignRegularised>{{p.eps}, p.fs, p.fd, p.weakening}, body);
      return detail::with_state(p, Coulomb<SignExact>{{}, p.fs, p.fd, 0}, body);
    case Law::rate_and_state:
      if (p.state == StateLaw::slip)
        return body(RateAndState<SlipKinetics>{p.a, p.b, p.D, p.mu0, p.psi0, {p.D}});
      return body(RateAndState<AgeingKinetics>{p.a, p.b, p.D, p.mu0, p.psi0, {p.D}});
    default:
      return detail::with_state(p, Cubic{}, body);
  }
}

}  // namespace stickslip
