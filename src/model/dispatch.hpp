// From the name and the parameters of a law and a state law to their classes.
#pragma once

#include <stdexcept>
#include <string>

#include "model/law_list.hpp"

namespace stickslip {

// A state law that is a factor goes with laws of one velocity, any other with laws that take the state themselves.
template <class L, class S>
constexpr bool classes_belong_together() {
  if (says::takes_state<L>) return !says::factor<S> && !std::is_same_v<S, NoState>;
  return std::is_same_v<S, NoState> || (says::factor<S> && (L::jumps_at_rest || !says::needs_threshold<S>));
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
  for (const auto& [member, parameter] : T::parameters()) object.*member = p.value(family + parameter.name);
  says::check(object);
  return object;
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
        if constexpr (says::takes_state<L>) {
          result = body(OwnState<L, S>{law, state});
        } else if constexpr (says::jumps_at_rest<L>()) {
          if (p.regularised) result = body(Product<L, SignRegularised, S>{law, state, {p.eps}});
          else result = body(Product<L, SignExact, S>{law, state, {}});
        } else {
          result = body(Product<L, SignExact, S>{law, state, {}});
        }
      }
    });
  });
  if (!found) throw std::logic_error("no law " + p.law->name + " with state law " + p.state->name);
  return result;
}

}  // namespace stickslip
