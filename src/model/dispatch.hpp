// From the name and the parameters of a law and a state law to their classes.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "model/law_list.hpp"

namespace stickslip {

// A law with a state law of its own goes with that; else a state law that is a factor goes with laws of one
// velocity, any other with laws that take the state themselves.
template <class L, class S>
constexpr bool classes_belong_together() {
  constexpr bool none = std::is_same_v<S, NoState>;
  if (!std::is_void_v<typename L::State> || S::of_its_law) return std::is_same_v<typename L::State, S>;
  if (L::takes_state) return !S::is_factor && !none;
  return none || (S::is_factor && (jumps_at_rest<L>() || !S::needs_threshold));
}

template <class T>
struct Type {
  using type = T;
};
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
      if (p.regularised) return body(Product<L, SignRegularised, S>{law, state, {p.eps}});
      if constexpr (L::takes_points)
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
  return {S::name, S::symbol, S::unit, S::meaning, S::logarithmic, parameters_of<S>()};
}
template <class TypeOfL>
LawTraits traits_of_law() {
  using L = typename TypeOfL::type;
  LawTraits traits{L::name,     jumps_at_rest<L>(), L::continuous_derivatives,
                   L::only_for, parameters_of<L>(), {}};
  if constexpr (L::takes_points) traits.continuous_at_rest = L::continuous_at_rest;
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

}  // namespace stickslip
