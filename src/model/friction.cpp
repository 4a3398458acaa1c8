#include "stickslip/model/friction.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <stdexcept>
#include <utility>

#include "base/failure.hpp"
#include "model/friction_family.hpp"

namespace stickslip {

namespace {

// Handles point to the entries, so that these stay where they are when others are added.
template <class Traits>
struct Table {
  std::deque<Traits> entries;
  bool read = false;  // by the options: no more can be added

  Traits& named(const std::string& name) {
    for (Traits& traits : entries)
      if (traits.name == name) return traits;
    throw std::logic_error("no law is called " + name);
  }
  void add(Traits traits) {
    for (const Traits& other : entries)
      if (other.name == traits.name) throw std::logic_error("two laws are called " + traits.name);
    if (read) throw std::logic_error("law " + traits.name + ": laws are registered before options are read");
    entries.push_back(std::move(traits));
  }
  template <class Handle>
  std::vector<Handle> handles() {
    read = true;
    std::vector<Handle> all;
    for (const Traits& traits : entries) all.emplace_back(traits.name);
    return all;
  }
};

Table<StateTraits>& state_table() {
  static Table<StateTraits> table = [] {
    Table<StateTraits> all;
    for_each_type(StateLaws(), [&](auto state) { all.add(traits_of_state<decltype(state)>()); });
    return all;
  }();
  return table;
}

void join(LawTraits& law, const char* state, bool usual) {
  law.states.emplace(usual ? law.states.begin() : law.states.end(), state);
}

Table<LawTraits>& law_table() {
  static Table<LawTraits> table = [] {
    Table<LawTraits> all;
    for_each_type(Laws(), [&](auto law) { all.add(traits_of_law<decltype(law)>()); });
    for_each_pair(Laws(), StateLaws(), [&](auto law, auto state) {
      using L = typename decltype(law)::type;
      using S = typename decltype(state)::type;
      join(all.named(L::name), S::name, is_usual<L, S>());
    });
    return all;
  }();
  return table;
}

}  // namespace

StateLaw::StateLaw(const std::string& name) : traits_(&state_table().named(name)) {}
Law::Law(const std::string& name) : traits_(&law_table().named(name)) {}

void add_law(LawTraits traits) { law_table().add(std::move(traits)); }
void add_state_law(StateTraits traits) { state_table().add(std::move(traits)); }
void let_accompany(const char* law, const char* state, bool usual) {
  join(law_table().named(law), state, usual);
}

const std::vector<Law>& all_laws() {
  static const std::vector<Law> laws = law_table().handles<Law>();
  return laws;
}
const std::vector<StateLaw>& all_state_laws() {
  static const std::vector<StateLaw> laws = state_table().handles<StateLaw>();
  return laws;
}
bool belong_together(Law law, StateLaw state) {
  return std::find(law->states.begin(), law->states.end(), state) != law->states.end();
}
std::string to_string(Law law) { return law->name; }
std::string to_string(StateLaw law) { return law->name; }

double FrictionParameters::value(const std::string& option) const {
  const Parameter* own = nullptr;
  const std::pair<const char*, const std::vector<Parameter>*> families[] = {{"friction_", &law->parameters},
                                                                            {"state_", &state->parameters}};
  for (const auto& [family, parameters] : families)
    for (const Parameter& p : *parameters) {
      const std::string name = family + std::string(p.name);
      if (p.same_as == option)
        return value(name);  // one quantity under two names: the law's overrides the other
      if (name == option) own = &p;
    }
  if (!own) return 0;
  for (const std::string& name : {option, std::string(own->same_as)}) {
    const auto set = values.find(name);
    if (set != values.end()) return set->second;
  }
  return std::strtod(own->value, nullptr);
}

bool FrictionParameters::smooth() const { return !jumps_at_rest() && !piecewise() && terms.none(); }

bool FrictionParameters::piecewise() const {
  constexpr int of_highest_order = 9;
  return law->continuous_derivatives < of_highest_order;
}

const ProfileAlongX* FrictionParameters::profile(const std::string& option) const {
  if (profiles.empty()) return nullptr;
  std::string name = option;
  for (const Parameter& p : law->parameters)  // one quantity under two names, as in value()
    if (p.same_as == option) name = "friction_" + std::string(p.name);
  const auto found = profiles.find(name);
  return found == profiles.end() ? nullptr : &found->second;
}

LawTable<FrictionFamily::Make>& FrictionFamily::table() { return listed<FrictionFamily>(); }

std::shared_ptr<const Friction> Friction::of(const FrictionParameters& p) {
  if (p.varies())
    throw usage_error("{}_profile: what is asked for here needs friction that is the same everywhere",
                      p.profiles.begin()->first);
  return FrictionFamily::table().of(p)(p, {}).front();
}

std::vector<std::shared_ptr<const Friction>> Friction::along(const FrictionParameters& p,
                                                             const FrictionPlaces& places) {
  return places.empty() ? FrictionFamily::List() : FrictionFamily::table().of(p)(p, places);
}

double state_to_output(StateLaw law, double s) { return law->logarithmic ? std::exp(s) : s; }
double state_from_output(StateLaw law, double shown) { return law->logarithmic ? std::log(shown) : shown; }

}  // namespace stickslip
