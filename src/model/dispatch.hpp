// From the name and the parameters of a law and a state law to their classes.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "model/law_list.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip {

template <class T>
struct Type {
  using type = T;
};
template <class S, class Other>
constexpr bool is_among(Type<Other>) {
  return std::is_same_v<S, Other>;
}
template <class S, class... Others>
constexpr bool is_among(Type<Types<Others...>>) {
  return (std::is_same_v<S, Others> || ...);
}

// A law with state laws of its own goes with those; else a state law that is a factor goes with laws of one
// velocity, any other with laws that take the state themselves.
template <class L, class S>
constexpr bool classes_belong_together() {
  constexpr bool none = std::is_same_v<S, NoState>;
  if (!std::is_void_v<typename L::State> || S::of_its_law) return is_among<S>(Type<typename L::State>());
  if (L::takes_state) return !S::is_factor && !none;
  return none || (S::is_factor && (jumps_at_rest<L>() || !S::needs_threshold));
}

// Calls body(Type<T>()) for every T of the list.
template <class... Ts, class Body>
void for_each_type(Types<Ts...>, const Body& body) {
  (body(Type<Ts>()), ...);
}

// An object of the class with the values of the scene; `family`: friction_ or state_.
template <class T>
T with_values(const FrictionParameters& p, const std::string& family) {
  T object;
  for (const auto& [member, parameter] : T::parameters())
    if (member) object.*member = p.value(family + parameter.name);
  if constexpr (T::takes_points) object.take(p.curve);
  if (!p.varies()) object.check();
  return object;
}

// A parameter of a class that differs along x.
template <class T>
struct Differing {
  double T::*member;
  const ProfileAlongX* profile;
};
template <class T>
std::vector<Differing<T>> differing(const FrictionParameters& p, const std::string& family) {
  std::vector<Differing<T>> list;
  for (const auto& [member, parameter] : T::parameters())
    if (const ProfileAlongX* profile = p.profile(family + parameter.name)) list.push_back({member, profile});
  return list;
}

// `friction`, whose parameters have values for everywhere, with those of profiles as they are at each place.
template <class F>
std::vector<F> frictions_along(const F& friction, const FrictionParameters& p, const FrictionPlaces& places) {
  const auto of_law = differing<decltype(friction.law)>(p, "friction_");
  const auto of_state = differing<decltype(friction.state)>(p, "state_");
  std::vector<F> all(places.size(), friction);
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (const auto& [member, profile] : of_law) all[i].law.*member = profile->at(places[i].x);
    for (const auto& [member, profile] : of_state) all[i].state.*member = profile->at(places[i].x);
    try {
      all[i].law.check();
      all[i].state.check();
    } catch (const UsageError& e) {
      throw UsageError(std::string(e.what()) + " (at x = " + rounded_text(places[i].x, 6) + ")");
    }
  }
  return all;
}

// Calls body(friction) with the class that friction by this law and state law has, and returns what that
// returns.
template <class L, class S, class Body>
auto with_friction(const FrictionParameters& p, const Body& body) {
  const L law = with_values<L>(p, "friction_");
  const S state = with_values<S>(p, "state_");
  if constexpr (L::takes_state) {
    return body(OwnState<L, S>{law, state});
  } else {
    if constexpr (jumps_at_rest<L>()) {
      if constexpr (!S::needs_stops)
        if (p.regularised) return body(Product<L, SignRegularised, S>{law, state, {p.eps}});
      if constexpr (L::may_not_jump)
        if (!p.jumps_at_rest()) return body(Product<L, SignContinuous, S>{law, state, {}});
    }
    return body(Product<L, SignExact, S>{law, state, {}});
  }
}

// Calls body(Type<L>(), Type<S>()) for every law of the one list with every state law of the other that may
// accompany it.
template <class... Ls, class States, class Body>
void for_each_pair(Types<Ls...> laws, States states, const Body& body) {
  for_each_type(laws, [&](auto law) {
    for_each_type(states, [&](auto state) {
      using L = typename decltype(law)::type;
      using S = typename decltype(state)::type;
      if constexpr (classes_belong_together<L, S>()) body(law, state);
    });
  });
}

template <class T>
std::vector<Parameter> parameters_of() {
  std::vector<Parameter> list;
  for (const auto& declared : T::parameters()) list.push_back(declared.parameter);
  return list;
}
// Of Type<S>, Type<L>: what the classes say of themselves. Without the state laws that may accompany a law.
template <class TypeOfS>
StateTraits traits_of_state() {
  using S = typename TypeOfS::type;
  return {S::name, S::symbol, S::unit, S::meaning, S::logarithmic, parameters_of<S>(), S::needs_stops};
}
template <class TypeOfL>
LawTraits traits_of_law() {
  using L = typename TypeOfL::type;
  LawTraits traits{L::name,     jumps_at_rest<L>(), L::continuous_derivatives,
                   L::only_for, parameters_of<L>(), {}};
  if constexpr (L::may_not_jump) traits.continuous_at_rest = L::continuous_at_rest;
  return traits;
}
// Whether the law takes this state law where none is named.
template <class L, class S>
bool is_usual() {
  return L::usual_state == std::string(S::name);
}

// ---- the list of laws (friction.cpp)

// Beside those of the list, by a program of its own (commands/register_law.hpp), before the list is read.
// Throws std::logic_error for a name that is there already.
void add_law(LawTraits traits);
void add_state_law(StateTraits traits);
// That the two, by their names, go together; the usual one is taken where none is named.
void let_accompany(const char* law, const char* state, bool usual);

// ---- what is compiled for every law with every state law that may accompany it
//
// A family of such functions is a class with
//     using Make = ...                                   a pointer to a function of the parameters and more
//     template <class L, class S> static ... make(...)   which Make points to
//     static LawTable<Make>& table();                    the laws of the list (listed), and those that a
//                                                        program adds (register_law)

template <class Make>
class LawTable {
 public:
  void add(const char* law, const char* state, Make make) { rows_.push_back({law, state, make}); }
  Make of(const FrictionParameters& p) const {
    for (const Row& row : rows_)
      if (p.law->name == row.law && p.state->name == row.state) return row.make;
    throw std::logic_error("no law " + p.law->name + " with state law " + p.state->name);
  }

 private:
  struct Row {
    const char *law, *state;
    Make make;
  };
  std::vector<Row> rows_;
};

template <class Family, class Laws, class States>
void add_to(LawTable<typename Family::Make>& table, Laws laws, States states) {
  for_each_pair(laws, states, [&](auto law, auto state) {
    using L = typename decltype(law)::type;
    using S = typename decltype(state)::type;
    table.add(L::name, S::name, &Family::template make<L, S>);
  });
}
template <class Family>
LawTable<typename Family::Make>& listed() {
  static LawTable<typename Family::Make> table = [] {
    LawTable<typename Family::Make> all;
    add_to<Family>(all, Laws(), StateLaws());
    return all;
  }();
  return table;
}

// Calls body with each of the flags as a constant.
template <class Body>
auto with_flags(const Body& body) {
  return body();
}
template <class Body, class... Flags>
auto with_flags(const Body& body, bool flag, Flags... others) {
  const auto with = [&](auto constant) {
    return with_flags([&](auto... rest) { return body(constant, rest...); }, others...);
  };
  return flag ? with(std::true_type()) : with(std::false_type());
}

// A law with its state law and parameters as the class Friction.

// The class F of law.hpp behind virtual functions.
template <class F>
class Resolved final : public Friction {
 public:
  // `terms`: beside it, over the node's amplitude.
  Resolved(const F& f, const NodeTerms& terms, SlopeBounds slopes)
      : Friction(F::has_state, F::sticks, F::steep,
                 decltype(f.law)::van_der_pol && !F::has_state && terms.none(),
                 decltype(f.state)::renewed_at_stops, slopes),
        f_(f), terms_(terms), holds_(what_holds(f)) {}

  double force(double psi, double s) const override { return partials(psi, s).F; }
  Partials partials(double psi, double s) const override {
    return with_terms<double>(f_.partials(psi, s), psi, std::abs(psi));
  }
  RatePartials rate_partials(double psi, double s) const override { return f_.rate_partials(psi, s); }
  HigherPartials higher_partials(double psi, double s) const override {
    const Jet x = Jet::of_x(psi), y = Jet::of_y(s);
    const PartialsOf<Jet> f = with_terms<Jet>(f_.partials(x, y), x, abs(x));
    const RatePartialsOf<Jet> g = f_.rate_partials(x, y);
    const auto of = [](const Jet& by_psi, const Jet& by_state) {
      return HigherDerivatives{by_psi.x, by_psi.y, by_state.y, by_psi.xx, by_psi.xy, by_psi.yy, by_state.yy};
    };
    return {of(f.F_psi, f.F_state), of(g.g_psi, g.g_state)};
  }
  double steady_state(double psi) const override { return f_.steady_state(psi); }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const override {
    if constexpr (F::steep) {  // terms weigh there like more mass
      const double slope = with_terms<double>({0, 0, 0}, psi, std::abs(psi)).F_psi;
      return f_.newton_psi(psi, s, psi_new, s_new, mass + slope);
    } else {
      return psi_new;
    }
  }
  double velocity_of_slope(double F_psi) const override {
    return terms_.none() ? f_.law.velocity_of_slope(F_psi) : std::nan("");
  }

  Partials sliding_partials(double psi, double s, double direction) const override {
    return sticking<Partials>([&](const auto& f) {
      return with_terms<double>(f.sliding_partials(psi, s, direction), psi, direction * psi);
    });
  }
  RatePartials sliding_rate(double psi, double s, double direction) const override {
    return sticking<RatePartials>([&](const auto& f) { return f.sliding_rate(psi, s, direction); });
  }
  WithSlope threshold(double s) const override {
    return sticking<WithSlope>([&](const auto& f) {
      const WithSlope m = f.factor(s);
      return WithSlope{m.value * holds_, m.slope * holds_};
    });
  }
  double threshold_at_long_rest() const override {
    return sticking<double>([&](const auto& f) { return f.factor_at_long_rest() * holds_; });
  }
  double state_at_rest(double s, double t) const override {
    return sticking<double>([&](const auto& f) { return f.state.at_rest(s, t); });
  }
  double time_at_rest(double s) const override {
    return sticking<double>([&](const auto& f) { return f.state.time_at_rest(s); });
  }

 private:
  template <class R, class Body>
  R sticking(const Body& body) const {
    if constexpr (F::sticks)
      return body(f_);
    else
      throw std::logic_error("this law does not stick");
  }
  template <class Real>
  PartialsOf<Real> with_terms(PartialsOf<Real> p, const Real& psi, const Real& speed) const {
    terms_.beside(psi, speed, p.F, p.F_psi);
    return p;
  }
  // Of phi: what the node begins to slip against, the larger of both directions, to the last bit, but where
  // the law drops from more, by more than round-off: what begins to slip with a friction beyond what held it
  // would stop at once, and begin again, without end.
  static double what_holds(const F& f) {
    if constexpr (!F::sticks) {
      return 0;
    } else {
      constexpr double drop = 1 + 1e-12;
      const double slips = std::max(f.law.phi(0., SignFrozen{1}).value, -f.law.phi(0., SignFrozen{-1}).value);
      return f.law.threshold() > drop * slips ? f.law.threshold() : slips;
    }
  }
  F f_;
  NodeTerms terms_;
  double holds_;
};

template <class F>
std::shared_ptr<const Friction> resolved(const F& f, const FrictionParameters& p, double amplitude) {
  return std::make_shared<const Resolved<F>>(
      f, p.terms.over(amplitude), p.regularised ? SlopeBounds{0, 1 / p.eps} : f.law.slope_bounds());
}

struct FrictionFamily {
  using List = std::vector<std::shared_ptr<const Friction>>;
  using Make = List (*)(const FrictionParameters&, const FrictionPlaces&);
  static LawTable<Make>& table();

  // At each of the places; without any, the one everywhere.
  template <class L, class S>
  static List make(const FrictionParameters& p, const FrictionPlaces& places) {
    return with_friction<L, S>(p, [&](const auto& friction) {
      if (places.empty()) return List{resolved(friction, p, 1)};
      List list;
      for (const auto& f : frictions_along(friction, p, places))
        list.push_back(resolved(f, p, places[list.size()].amplitude));
      return list;
    });
  }
};

// The scales that a law's class declares (law.hpp), for the parameters of a scene.

// And by how much friction that sticks drops as slip begins.
struct DroppingScales : LawScales {
  double drop = 0;
};

struct ScalesFamily {
  using Make = DroppingScales (*)(const FrictionParameters&, const FrictionPlaces&);
  static LawTable<Make>& table();

  // Over the places the least velocity and state, and the largest force; without any, those everywhere.
  template <class L, class S>
  static DroppingScales make(const FrictionParameters& p, const FrictionPlaces& places) {
    return with_friction<L, S>(p, [&](const auto& friction) {
      if (places.empty()) return of(friction);
      const auto along = frictions_along(friction, p, places);
      DroppingScales all = of(along.front());
      for (const auto& f : along) {
        const DroppingScales here = of(f);
        all.drop = std::min(all.drop, here.drop);
        if (here.velocity > 0) all.velocity = std::min(all.velocity, here.velocity);
        all.force = std::max(all.force, here.force);
        all.state = std::min(all.state, here.state);
        all.length = std::min(all.length, here.length);
      }
      return all;
    });
  }

 private:
  template <class F>
  static DroppingScales of(const F& f) {
    DroppingScales scales{f.law.scales()};
    if constexpr (F::sticks)
      scales.drop = std::max(0., f.law.threshold() - f.law.phi(0., SignFrozen{1}).value);
    return scales;
  }
};

}  // namespace stickslip
