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
// that carries derivatives (numerics/jet.hpp): higher derivatives come from the formulas as they stand. So
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
// A law that has a state law of its own names it, `using State = ...`, a class that says `of_its_law` = true;
// factor() and factor_at_long_rest(), or rate_partials() and steady_state(), may stand with the law where
// they need its parameters.
// Where its velocities, forces or states are not about 1 it says how large they are,
//     LawScales scales() const                       which may follow its parameters
// What else a class may say stands with the functions of `says` below, each with what holds where it does
// not.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "model/law_scales.hpp"
#include "numerics/elementary.hpp"
#include "numerics/jet.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip {

// A parameter with the member that holds it (none where it is a curve).
template <class Owner>
struct Declared {
  double Owner::*member;
  Parameter parameter;
};

// ---- sgn(psi) and |psi| with their slopes, exact or regularised over the velocity eps
// -----------------------------

struct SignExact {
  static constexpr bool smooth = false;
  template <class Real>
  WithSlopeOf<Real> sign_slope(Real psi) const {
    return {psi > 0 ? 1. : psi < 0 ? -1. : 0., 0.};
  }
  template <class Real>
  WithSlopeOf<Real> magnitude(Real psi) const {
    using std::abs;
    return {abs(psi), sign_slope(psi).value};
  }
};
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
// Friction that is continuous at rest although its law may jump there: sgn(0) does not matter.
struct SignContinuous {
  static constexpr bool smooth = true;
  template <class Real>
  WithSlopeOf<Real> sign_slope(Real psi) const {
    return {psi < 0 ? -1. : 1., 0.};
  }
  template <class Real>
  WithSlopeOf<Real> magnitude(Real psi) const {
    using std::abs;
    return {abs(psi), sign_slope(psi).value};
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
// -------------------------------------------------------------------------------

namespace traits {

template <class, template <class> class, class = void>
struct Has : std::false_type {};
template <class T, template <class> class Member>
struct Has<T, Member, std::void_t<Member<T>>> : std::true_type {};

template <class T>
using JumpsAtRest = decltype(T::jumps_at_rest);
template <class T>
using Threshold = decltype(&T::threshold);
template <class T>
using TakesState = decltype(T::takes_state);
template <class T>
using Steep = decltype(&T::newton_psi);
template <class T>
using VanDerPol = decltype(T::van_der_pol);
template <class T>
using SlopesOf = decltype(&T::slope_bounds);
template <class T>
using ScalesOf = decltype(&T::scales);
template <class T>
using VelocityOfSlope = decltype(&T::velocity_of_slope);
template <class T>
using Check = decltype(&T::check);
template <class T>
using Factor = decltype(std::declval<const T&>().factor(0.));
template <class T>
using UsualState = decltype(T::usual_state);
template <class T>
using NeedsThreshold = decltype(T::needs_threshold);
template <class T>
using TakesPoints = decltype(&T::take);
template <class T>
using LooksUp = typename T::Place;
template <class T>
using Companion = typename T::State;
template <class T>
using OfItsLaw = decltype(T::of_its_law);
template <class T>
using LongRest = decltype(&T::factor_at_long_rest);
template <class T>
using OwnRate = decltype(&T::steady_state);
template <class T>
using EntersWith = decltype(T::enters_with);
template <class T>
using OnlyFor = decltype(T::only_for);
template <class T>
using Derivatives = decltype(T::continuous_derivatives);

// threshold(): friction drops from it as motion begins.
template <class L>
constexpr bool drops = Has<L, Threshold>::value;
// partials() in place of phi(): F is no product of phi and a factor of the state.
template <class L>
constexpr bool takes_state = Has<L, TakesState>::value;
// newton_psi(), see Friction: friction is steep at rest.
template <class L>
constexpr bool steep = Has<L, Steep>::value;
// The law has a state law of its own, or is one's: they go with each other alone.
template <class L>
constexpr bool has_companion = Has<L, Companion>::value;
template <class S>
constexpr bool of_its_law = Has<S, OfItsLaw>::value;
template <class L, class S>
constexpr bool are_companions() {
  if constexpr (has_companion<L>)
    return std::is_same_v<typename L::State, S>;
  else
    return false;
}
// The law has the factor, or the rate, in place of its state law.
template <class L>
constexpr bool has_factor = Has<L, LongRest>::value;
template <class L>
constexpr bool has_rate = Has<L, OwnRate>::value;
// `enters_with`: what a law that takes the state adds to it first; nothing.
template <class S>
constexpr double enters_with() {
  if constexpr (Has<S, EntersWith>::value)
    return S::enters_with;
  else
    return 0;
}
// take(Points) and continuous_at_rest(Points): the law is made of points, with a force of 0 at rest without a
// jump.
template <class L>
constexpr bool takes_points = Has<L, TakesPoints>::value;
// place() and looked_up(): phi is looked up in a table, which a loop over nodes does for itself.
template <class L>
constexpr bool looks_up = Has<L, LooksUp>::value;
// `continuous_derivatives` of phi: infinitely many.
template <class L>
constexpr int continuous_derivatives() {
  if constexpr (Has<L, Derivatives>::value)
    return L::continuous_derivatives;
  else
    return std::numeric_limits<int>::max();
}
// `only_for`: the velocities for which alone it holds, in words; all.
template <class L>
constexpr const char* only_for() {
  if constexpr (Has<L, OnlyFor>::value)
    return L::only_for;
  else
    return "";
}
// `van_der_pol`: uniform motion without a state is van der Pol's.
template <class L>
constexpr bool van_der_pol = Has<L, VanDerPol>::value;
// The state law strengthens a threshold, so that a law without one has no use for it.
template <class S>
constexpr bool needs_threshold = Has<S, NeedsThreshold>::value;
// The state law is a factor of phi.
template <class S>
constexpr bool factor = Has<S, Factor>::value;

template <class L>
constexpr bool jumps_at_rest() {
  static_assert(
      Has<L, JumpsAtRest>::value,
      "a friction law must say whether it jumps at rest: static constexpr bool jumps_at_rest = ...");
  return L::jumps_at_rest;
}
// slope_bounds(): nothing steeper than what is met.
template <class L>
SlopeBounds slope_bounds(const L& law) {
  if constexpr (Has<L, SlopesOf>::value)
    return law.slope_bounds();
  else
    return {};
}
// scales(): all 1.
template <class L>
LawScales scales(const L& law) {
  if constexpr (Has<L, ScalesOf>::value)
    return law.scales();
  else
    return {};
}
// velocity_of_slope(F_psi): no closed formula.
template <class L>
double velocity_of_slope(const L& law, double slope) {
  if constexpr (Has<L, VelocityOfSlope>::value)
    return law.velocity_of_slope(slope);
  else
    return std::numeric_limits<double>::quiet_NaN();
}
// usual_state: the state law taken where none is named; the first of the list that goes with the law.
template <class L>
constexpr const char* usual_state() {
  if constexpr (Has<L, UsualState>::value)
    return L::usual_state;
  else
    return "";
}
// check(), which throws UsageError: any values within their ranges go together.
template <class T>
void check(const T& t) {
  if constexpr (Has<T, Check>::value) t.check();
}

}  // namespace traits

inline double direction_of(double psi) { return elementary::sign_or_zero(psi); }

// ---- friction = law and state
// -------------------------------------------------------------------------------------

// No state law.
struct NoState {
  static constexpr const char *name = "none", *symbol = "", *unit = "", *meaning = "";
  static constexpr bool logarithmic = false;
  static std::vector<Declared<NoState>> parameters() { return {}; }
};

// F = factor(s) phi(psi), the factor 1 without a state.
template <class L, class Sign, class State>
struct Product {
  static constexpr bool has_state = !std::is_same_v<State, NoState>;
  static constexpr bool sticks = L::jumps_at_rest && !Sign::smooth;
  static constexpr bool steep = false, looks_up = traits::looks_up<L>;
  L law;
  State state;
  Sign sign;

  double force(double psi, double s) const { return force(psi, s, sign); }
  Partials partials(double psi, double s) const { return partials(psi, s, sign); }
  RatePartials rate_partials(double psi, double s) const { return rate_partials(psi, s, direction_of(psi)); }
  PartialsOf<Jet> partials(const Jet& psi, const Jet& s) const { return partials(psi, s, sign); }
  RatePartialsOf<Jet> rate_partials(const Jet& psi, const Jet& s) const {
    return rate_partials(psi, s, direction_of(psi.value));
  }
  double rate(double psi, double s) const { return rate_partials(psi, s).g; }
  double steady_state(double psi) const {
    if constexpr (has_state)
      return state.steady_state(psi);
    else
      return 0;
  }

  // What the state makes of phi and of the threshold.
  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    if constexpr (traits::has_factor<L>)
      return law.factor(s);
    else
      return state.factor(s);
  }
  double factor_at_long_rest() const {
    if constexpr (traits::has_factor<L>)
      return law.factor_at_long_rest();
    else
      return state.factor_at_long_rest();
  }

  // The direction of motion given.
  double sliding_force(double psi, double s, double direction) const {
    return force(psi, s, SignFrozen{direction});
  }
  Partials sliding_partials(double psi, double s, double direction) const {
    return partials(psi, s, SignFrozen{direction});
  }
  RatePartials sliding_rate(double psi, double s, double direction) const {
    return rate_partials(psi, s, direction);
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
  template <class S>
  double force(double psi, double s, S with) const {
    if constexpr (has_state)
      return factor(s).value * law.phi(psi, with).value;
    else
      return law.phi(psi, with).value;
  }
  template <class Real, class S>
  PartialsOf<Real> partials(Real psi, Real s, S with) const {
    const WithSlopeOf<Real> p = law.phi(psi, with);
    if constexpr (has_state) {
      const WithSlopeOf<Real> m = factor(s);
      return {m.value * p.value, m.value * p.slope, m.slope * p.value};
    } else {
      return {p.value, p.slope, 0.};
    }
  }
  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    if constexpr (has_state)
      return state.rate_partials(psi, s, direction);
    else
      return {0., 0., 0.};
  }
};

// The law takes the state itself.
template <class L, class State>
struct OwnState {
  static constexpr bool has_state = true;
  static constexpr bool sticks = false;
  static constexpr bool steep = traits::steep<L>, looks_up = false;
  static_assert(!L::jumps_at_rest, "exact stick is there for laws whose friction is a product");
  L law;
  State state;

  double force(double psi, double s) const { return partials(psi, s).F; }
  Partials partials(double psi, double s) const { return law.partials(psi, entering(s)); }
  RatePartials rate_partials(double psi, double s) const { return rate_partials(psi, s, direction_of(psi)); }
  PartialsOf<Jet> partials(const Jet& psi, const Jet& s) const { return law.partials(psi, entering(s)); }
  RatePartialsOf<Jet> rate_partials(const Jet& psi, const Jet& s) const {
    return rate_partials(psi, s, direction_of(psi.value));
  }
  double rate(double psi, double s) const { return rate_partials(psi, s).g; }
  double steady_state(double psi) const {
    if constexpr (traits::has_rate<L>)
      return law.steady_state(psi);
    else
      return state.steady_state(psi);
  }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    return law.newton_psi(psi, entering(s), psi_new, entering(s_new), mass);
  }

 private:
  template <class Real>
  static Real entering(Real s) {
    if constexpr (traits::enters_with<State>() != 0)
      return s + traits::enters_with<State>();
    else
      return s;
  }
  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    if constexpr (traits::has_rate<L>)
      return law.rate_partials(psi, s, direction);
    else
      return state.rate_partials(psi, s, direction);
  }
};

}  // namespace stickslip
