// What the classes of friction laws and state laws are made of.
//
// A law of one velocity is a class with its parameters as members and
//     static constexpr const char* name              as in the option friction_law
//     static constexpr bool jumps_at_rest            no default: a law that does not say does not compile
//     static std::vector<Declared<Class>> parameters()
//     template <class Real, class Sign> WithSlopeOf<Real> phi(Real psi, Sign sign) const        phi and its
//                                                                                               slope
// and, where it drops as motion begins, double threshold() const, which holds a node at rest; otherwise phi
// at rest does. A law whose friction is no product of phi and a factor of the state says `takes_state = true`
// and gives PartialsOf<Real> partials(Real psi, Real s) const in place of phi. Real is double, or a number
// that carries derivatives (numerics/elementary.hpp): higher ones come from the formulas as they stand. So
// functions of it are called as `using std::exp; exp(psi)`, or `using elementary::exp`: then the loops over
// nodes become vector code (numerics/elementary.hpp), so long as the formula has no branch either
// (where_less() there). A state law is a class with name; symbol, unit and meaning of the state as files show
// it; logarithmic (the stored s is its logarithm); parameters() and
//     RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const    a template too;
//                                                                                     direction: the sign
//                                                                                    of psi, 0 at rest
//     double steady_state(double psi) const          the s at which the rate vanishes; infinite where there
//                                                    is none
// and, where friction is factor(s) phi(psi) with it (else it belongs to laws that take the state themselves),
//     WithSlopeOf<Real> factor(Real s) const         a template too
//     double at_rest(double s, double t) const       what becomes of s after the time t at psi = 0
//     double time_at_rest(double s) const            over which that changes
//     double factor_at_long_rest() const
// A law that has state laws of its own names them, `using State = ...`, a class or Types<...> of some, which
// say `of_its_law` = true; factor() and factor_at_long_rest(), or rate_partials() and steady_state(), may
// stand with the law where they need its parameters (`has_factor`, `has_rate`).
// Where its velocities, forces or states are not about 1 it says how large they are, scales().
// What else a class may say stands in LawDefaults and StateDefaults, from which every class is derived, with
// what holds where it does not.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "numerics/elementary.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip {

template <class...>
struct Types {};

// How large the velocities, forces and states of a law are by itself (stickslip/model/scales.hpp).
struct LawScales {
  double velocity = 1;  // 0: it has none
  double force = 1, state = 1;
  double length = 0;  // 0: it has none
};

// A parameter with the member that holds it (none where it is a curve).
template <class Owner>
struct Declared {
  double Owner::*member;
  Parameter parameter;
};

// ---- sgn(psi) and |psi| with their slopes, exact or regularised over the velocity eps

// `continuous`: friction is continuous at rest although its law may jump there, and sgn(0) does not matter.
template <bool continuous>
struct SignOfPsi {
  static constexpr bool smooth = continuous;
  template <class Real>
  WithSlopeOf<Real> sign_slope(Real psi) const {
    return {psi < 0 ? -1. : continuous || psi > 0 ? 1. : 0., 0.};
  }
  template <class Real>
  WithSlopeOf<Real> magnitude(Real psi) const {
    using std::abs;
    return {abs(psi), sign_slope(psi).value};
  }
};
using SignExact = SignOfPsi<false>;
using SignContinuous = SignOfPsi<true>;
struct SignRegularised {
  static constexpr bool smooth = true;
  double eps;
  template <class Real>
  WithSlopeOf<Real> sign_slope(Real psi) const {
    using elementary::tanh;
    const Real t = tanh(psi / eps);
    return {t, (1 - t * t) / eps};
  }
  template <class Real>
  WithSlopeOf<Real> magnitude(Real psi) const {
    const WithSlopeOf<Real> s = sign_slope(psi);
    return {psi * s.value, s.value + psi * s.slope};
  }
};
// The direction of motion is known and stays, whatever psi is.
struct SignFrozen {
  static constexpr bool smooth = false;
  double direction;
  template <class Real>
  WithSlopeOf<Real> sign_slope(Real) const {
    return {direction, 0.};
  }
  template <class Real>
  WithSlopeOf<Real> magnitude(Real psi) const {
    return {direction * psi, direction};
  }
};

// ---- what a class may say of itself

struct Defaults {
  static constexpr bool takes_points = false;  // take(Points): the law is made of points
  void check() const {}                        // throws UsageError where values do not go together
};
struct LawDefaults : Defaults {
  struct NotSaid {};
  static constexpr NotSaid jumps_at_rest{};       // there is no default
  static constexpr bool may_not_jump = false;  // continuous_at_rest(Points): whether with these it does not
  using State = void;                             // state laws of its own: they go with each other alone
  static constexpr bool takes_state = false;      // partials() in place of phi()
  static constexpr bool has_factor = false;       // in place of its state law
  static constexpr bool has_rate = false;         // likewise
  static constexpr bool steep = false;            // newton_psi(), see Friction: friction is steep at rest
  static constexpr bool gives_velocity = false;   // velocity(): psi of the force F = a y, with a member a
  static constexpr bool looks_up = false;         // place(), looked_up(): phi is looked up in a table
  static constexpr bool van_der_pol = false;      // uniform motion without a state is van der Pol's
  static constexpr const char* only_for = "";     // velocities for which alone it holds, in words
  static constexpr const char* usual_state = "";  // taken where none is named; "": the first of the list
  static constexpr int continuous_derivatives = std::numeric_limits<int>::max();  // of phi
  double threshold() const { return 0; }           // no drop: what holds a node is phi at rest
  SlopeBounds slope_bounds() const { return {}; }  // nothing steeper than is met
  double velocity_of_slope(double) const { return std::numeric_limits<double>::quiet_NaN(); }
  LawScales scales() const { return {}; }  // which may follow its parameters
};
struct StateDefaults : Defaults {
  static constexpr bool is_factor = false;        // of phi: factor() and what stands with it
  static constexpr bool of_its_law = false;       // goes with a law that names it
  static constexpr bool needs_threshold = false;  // strengthens it: a law without one has no use for it
  static constexpr double enters_with = 0;        // what a law that takes the state adds to it first
  static constexpr bool needs_stops = false;       // nodes stop and rest: with exact stick alone
  static constexpr bool renewed_at_stops = false;  // a node that stops has the state 0 again
};

template <class L>
constexpr bool jumps_at_rest() {
  static_assert(
      !std::is_same_v<decltype(L::jumps_at_rest), const LawDefaults::NotSaid>,
      "a friction law must say whether it jumps at rest: static constexpr bool jumps_at_rest = ...");
  return L::jumps_at_rest;
}

// psi, and its slopes in y and in the state, where friction is a y (`gives_velocity`).
struct VelocityOfForce {
  double psi, by_y, by_state;
};

inline double direction_of(double psi) { return elementary::sign_or_zero(psi); }

// ---- friction = law and state

// No state law.
struct NoState : StateDefaults {
  static constexpr const char *name = "none", *symbol = "", *unit = "", *meaning = "";
  static constexpr bool logarithmic = false;
  static std::vector<Declared<NoState>> parameters() { return {}; }

  template <class Real>
  WithSlopeOf<Real> factor(Real) const {
    return {1., 0.};
  }
  double factor_at_long_rest() const { return 1; }
  template <class Real>
  RatePartialsOf<Real> rate_partials(Real, Real, double) const {
    return {0., 0., 0.};
  }
  double steady_state(double) const { return 0; }
  double at_rest(double, double) const { return 0; }
  double time_at_rest(double) const { return 0; }
};

template <class L, class S>
struct LawWithState {
  static constexpr bool has_state = !std::is_same_v<S, NoState>;
  L law;
  S state;

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    if constexpr (L::has_rate)
      return law.rate_partials(psi, s, direction);
    else
      return state.rate_partials(psi, s, direction);
  }
  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s) const {
    return rate_partials(psi, s, direction_of(elementary::value_of(psi)));
  }
  double steady_state(double psi) const {
    if constexpr (L::has_rate)
      return law.steady_state(psi);
    else
      return state.steady_state(psi);
  }
};

// F = factor(s) phi(psi), the factor 1 without a state.
template <class L, class Sign, class S>
struct Product : LawWithState<L, S> {
  static constexpr bool sticks = jumps_at_rest<L>() && !Sign::smooth;
  static constexpr bool steep = false, gives_velocity = false, looks_up = L::looks_up;
  Sign sign;

  template <class Real>
  PartialsOf<Real> partials(Real psi, Real s) const {
    return partials(psi, s, sign);
  }
  // The direction of motion given.
  Partials sliding_partials(double psi, double s, double direction) const {
    return partials(psi, s, SignFrozen{direction});
  }
  RatePartials sliding_rate(double psi, double s, double direction) const {
    return this->rate_partials(psi, s, direction);
  }

  // What the state makes of phi and of the threshold.
  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    if constexpr (L::has_factor)
      return this->law.factor(s);
    else
      return this->state.factor(s);
  }
  double factor_at_long_rest() const {
    if constexpr (L::has_factor)
      return this->law.factor_at_long_rest();
    else
      return this->state.factor_at_long_rest();
  }

  // Calls body(sign), of the direction given or of the velocity itself.
  template <bool sliding, class Body>
  auto with_sign(double direction, const Body& body) const {
    if constexpr (sliding)
      return body(SignFrozen{direction});
    else
      return body(sign);
  }

 private:
  template <class Real, class With>
  PartialsOf<Real> partials(Real psi, Real s, With with) const {
    const WithSlopeOf<Real> p = this->law.phi(psi, with), m = factor(s);
    return {m.value * p.value, m.value * p.slope, m.slope * p.value};
  }
};

// The law takes the state itself.
template <class L, class S>
struct OwnState : LawWithState<L, S> {
  static constexpr bool sticks = false, steep = L::steep, gives_velocity = L::gives_velocity,
                        looks_up = false;
  static_assert(!jumps_at_rest<L>(), "exact stick is there for laws whose friction is a product");

  template <class Real>
  PartialsOf<Real> partials(Real psi, Real s) const {
    return this->law.partials(psi, Real(s + S::enters_with));
  }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    return this->law.newton_psi(psi, s + S::enters_with, psi_new, s_new + S::enters_with, mass);
  }
  VelocityOfForce velocity(double y, double s) const { return this->law.velocity(y, s + S::enters_with); }
};

}  // namespace stickslip
