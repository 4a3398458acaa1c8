// Laws and state laws of a program of one's own, which has them in all commands:
//
//     int main(int argc, char** argv) {
//       stickslip::register_law<Hump>();
//       return stickslip::main(argc, argv);
//     }
//
// The classes are those of model/law.hpp; what they are compiled to is what the laws of the list are. The
// file in which this stands is to be compiled as the library is: the target stickslip::laws says how.
#pragma once

#include "model/dispatch.hpp"
#include "model/law_family.hpp"
#include "model/law_list.hpp"

namespace stickslip {

namespace detail {

template <class Family, class Laws, class States>
void add_family(Laws laws, States states) {
  add_to<Family>(Family::table(), laws, states);
}
template <class Laws, class States>
void add_pairs(Laws laws, States states) {
  for_each_pair(laws, states, [](auto law, auto state) {
    using L = typename decltype(law)::type;
    using S = typename decltype(state)::type;
    let_accompany(L::name, S::name, is_usual<L, S>());
  });
  add_family<FrictionFamily>(laws, states);
  add_family<ScalesFamily>(laws, states);
  add_family<LawFamily>(laws, states);
}

}  // namespace detail

// New laws with all state laws that may accompany them, new state laws with all laws that they may accompany.
// Each pair takes seconds to compile. Throws std::logic_error for a name that is there already.
template <class... Ls, class... Ss>
void register_laws(Types<Ls...> laws, Types<Ss...> states) {
  for_each_type(states, [](auto state) { add_state_law(traits_of_state<decltype(state)>()); });
  for_each_type(laws, [](auto law) { add_law(traits_of_law<decltype(law)>()); });
  detail::add_pairs(laws, StateLaws());
  detail::add_pairs(laws, states);
  detail::add_pairs(Laws(), states);
}

// One law, with the state laws that are named; with none, with all of the list that may accompany it.
template <class L, class... Ss>
void register_law() {
  add_law(traits_of_law<Type<L>>());
  if constexpr (sizeof...(Ss) == 0)
    detail::add_pairs(Types<L>(), StateLaws());
  else
    detail::add_pairs(Types<L>(), Types<Ss...>());
}

}  // namespace stickslip
