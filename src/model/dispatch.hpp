// From the name and the parameters of a law and a state law to their classes.
#pragma once

#include <stdexcept>
#include <string>

#include "model/kernel.hpp"
#include "model/law_list.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

// A law with a state law of its own goes with that; else a state law that is a factor goes with laws of one
// velocity, any other with laws that take the state themselves.
template <class L, class S>
constexpr bool classes_belong_together() {
  if (traits::has_companion<L> || traits::of_its_law<S>) return traits::are_companions<L, S>();
  if (traits::takes_state<L>) return !traits::factor<S> && !std::is_same_v<S, NoState>;
  return std::is_same_v<S, NoState> ||
         (traits::factor<S> && (L::jumps_at_rest || !traits::needs_threshold<S>));
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
  if constexpr (traits::takes_points<T>) object.take(p.curve);
  if (!p.varies()) traits::check(object);
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
      traits::check(all[i].law);
      traits::check(all[i].state);
    } catch (const UsageError& e) {
      throw UsageError(std::string(e.what()) + " (at x = " + rounded_text(places[i].x, 6) + ")");
    }
  }
  return all;
}

// Calls body(friction) with the class that the parameters name and returns what it returns, an R.
template <class R, class Body>
R dispatch_friction(const FrictionParameters& p, const Body& body) {
  R result{};
  bool found = false;
  for_each_type(Laws(), [&](auto law_type) {
    using L = typename std::decay_t<decltype(law_type)>::type;
    if (p.law->name != L::name) return;
    for_each_type(StateLaws(), [&](auto state_type) {
      using S = typename std::decay_t<decltype(state_type)>::type;
      if constexpr (classes_belong_together<L, S>()) {
        if (p.state->name != S::name) return;
        const L law = with_values<L>(p, "friction_");
        const S state = with_values<S>(p, "state_");
        found = true;
        if constexpr (traits::takes_state<L>) {
          result = body(OwnState<L, S>{law, state});
        } else if constexpr (traits::jumps_at_rest<L>()) {
          if (p.regularised) {
            result = body(Product<L, SignRegularised, S>{law, state, {p.eps}});
            return;
          }
          if constexpr (traits::takes_points<L>)
            if (!p.jumps_at_rest()) {
              result = body(Product<L, SignContinuous, S>{law, state, {}});
              return;
            }
          result = body(Product<L, SignExact, S>{law, state, {}});
        } else {
          result = body(Product<L, SignExact, S>{law, state, {}});
        }
      }
    });
  });
  if (!found) throw std::logic_error("no law " + p.law->name + " with state law " + p.state->name);
  return result;
}

// The loop of any friction whose nodes are given (AnyFriction).
template <class Function, template <class, bool> class Loop, class... Rest>
Function loop_of_any(const std::vector<std::shared_ptr<const Friction>>& nodes, bool smoothed, bool sticking,
                     const Rest&... rest) {
  const auto loop = [&](auto friction, auto constant) -> Function {
    using Any = decltype(friction);
    std::vector<Any> own;
    for (const auto& node : nodes) own.push_back({node});
    return kernel::Baseline<Loop<kernel::Varying<Any>, decltype(constant)::value>>{
        {{std::make_shared<const std::vector<Any>>(std::move(own))}, rest...}};
  };
  constexpr std::true_type yes;
  constexpr std::false_type no;
  if (!nodes.front()->has_state) {
    if (smoothed) return loop(kernel::AnyFriction<false, true, false>(), no);
    return sticking ? loop(kernel::AnyFriction<false, false, false>(), yes)
                    : loop(kernel::AnyFriction<false, false, false>(), no);
  }
  if (nodes.front()->steep) return loop(kernel::AnyFriction<true, false, true>(), no);
  if (smoothed) return loop(kernel::AnyFriction<true, true, false>(), no);
  return sticking ? loop(kernel::AnyFriction<true, false, false>(), yes)
                  : loop(kernel::AnyFriction<true, false, false>(), no);
}

// Loop<F, sticking>{friction, rest...} of that class F, in the version that suits this processor; with
// `places`, with what acts at each of them (friction_places). Only laws that stick have a loop with
// `sticking`.
template <class Function, template <class, bool> class Loop, class... Rest>
Function loop_of_friction(const FrictionParameters& p, bool sticking, const FrictionPlaces& places,
                          const Rest&... rest) {
  if (!places.empty() && !p.terms.none())
    return loop_of_any<Function, Loop>(Friction::along(p, places), p.regularised, sticking, rest...);
  return dispatch_friction<Function>(p, [&](const auto& friction) -> Function {
    using F = std::decay_t<decltype(friction)>;
    const auto loop = [&](auto constant) -> Function {
      constexpr bool sticks = decltype(constant)::value;
      if (places.empty()) return kernel::compiled_where_worth<Function>(Loop<F, sticks>{friction, rest...});
      return kernel::Baseline<Loop<kernel::Varying<F>, sticks>>{
          {{std::make_shared<const std::vector<F>>(frictions_along(friction, p, places))}, rest...}};
    };
    if (!sticking) return loop(std::false_type());
    if constexpr (F::sticks)
      return loop(std::true_type());
    else
      throw std::logic_error("law " + p.law->name + " does not stick");
  });
}

}  // namespace stickslip
