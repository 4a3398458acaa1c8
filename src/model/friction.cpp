#include "stickslip/model/friction.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <deque>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/failure.hpp"
#include "model/dispatch.hpp"
#include "model/laws/table.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/options.hpp"

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

// The options of friction laws and state laws, as their classes declare them.

namespace {

OptionSpec option_of(const std::string& name, const Parameter& p) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  OptionSpec spec{name, OptionType::real, p.value, p.default_help, p.unit, 0, inf, false, {}, p.help, "",
                  "",   nullptr};
  spec.open_low = p.range == Parameter::Range::positive;
  if (p.range == Parameter::Range::word) {
    spec.type = OptionType::choice;
    spec.words = split(p.words, ' ');
  } else if (p.range == Parameter::Range::curve) {
    spec.type = OptionType::pairs;
    spec.default_help = "none";
    spec.low = -inf;
    spec.fault = FrictionCurve::fault;
  }
  return spec;
}

// One quantity under two names, e.g. friction_D and state_D of rate-and-state friction: while a law that says
// so is chosen, each follows the other where only that is set.
struct Pair {
  std::vector<std::string> laws;
  std::string name, same_as;

  void connect(std::vector<OptionSpec>& options) const {
    for (OptionSpec& spec : options) {
      if (spec.name != name && spec.name != same_as) continue;
      const std::string own = spec.default_text;
      spec.default_text.clear();
      const bool of_law = spec.name == name;
      spec.default_of = [pair = *this, of_law, own, otherwise = spec.default_of](const Options& o) {
        if (std::find(pair.laws.begin(), pair.laws.end(), o.text("friction_law")) == pair.laws.end())
          return otherwise ? otherwise(o) : own;
        if (of_law) return o.is_set(pair.same_as) ? o.text(pair.same_as) : own;
        return o.text(pair.name);
      };
    }
  }
};

void add_pair(std::vector<Pair>& pairs, const std::string& law, const std::string& name,
              const std::string& same_as) {
  for (Pair& pair : pairs)
    if (pair.name == name && pair.same_as == same_as) return pair.laws.push_back(law);
  pairs.push_back({{law}, name, same_as});
}

void add_once(std::vector<OptionSpec>& options, OptionSpec spec) {
  for (const OptionSpec& other : options)
    if (other.name == spec.name) return;
  options.push_back(std::move(spec));
}

// The profile of a parameter along x, and a factor on it.
void add_profile(std::vector<OptionSpec>& options, const std::string& name, const OptionSpec& parameter) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  OptionSpec profile{name + "_profile",
                     OptionType::pairs,
                     "",
                     "none",
                     parameter.unit,
                     parameter.low,
                     parameter.high,
                     parameter.open_low,
                     {},
                     name +
                         " along x, in place of one value: x1:value1,x2:value2,... or a file "
                         "of two columns",
                     "",
                     "",
                     nullptr};
  OptionSpec factor{name + "_factor",
                    OptionType::real,
                    "1",
                    "",
                    "",
                    0,
                    inf,
                    true,
                    {},
                    "multiplies " + name + "_profile",
                    "",
                    "",
                    nullptr};
  for (OptionSpec* spec : {&profile, &factor}) add_once(options, std::move(*spec));
}

}  // namespace

LawOptions law_options() {
  LawOptions all;
  std::vector<Pair> pairs;
  for (const Law law : all_laws()) {
    all.laws.push_back(law->name);
    for (const Parameter& p : law->parameters) {
      const std::string name = "friction_" + std::string(p.name);
      add_once(all.of_laws, option_of(name, p));
      if (*p.same_as) add_pair(pairs, law->name, name, p.same_as);
    }
  }
  for (const StateLaw state : all_state_laws()) {
    all.states.push_back(state->name);
    for (const Parameter& p : state->parameters)
      add_once(all.of_states, option_of("state_" + std::string(p.name), p));
  }
  OptionSpec amplitude =
      option_of("friction_amplitude", {"amplitude", "1", Parameter::Range::not_negative, "", ""});
  add_profile(all.of_profiles, amplitude.name, amplitude);
  using R = Parameter::Range;
  for (const Parameter& p : {Parameter{"m", "1", R::positive, "", ""},
                             {"k0", "0.2", R::not_negative, "", ""},
                             {"k1", "0.2", R::not_negative, "", ""},
                             {"zeta", "0", R::not_negative, "", ""},
                             {"c", "1", R::not_negative, "length/time", ""},
                             {"delta", "0.2", R::not_negative, "", ""}}) {
    const OptionSpec parameter = option_of("model_" + std::string(p.name), p);
    add_profile(all.of_profiles, parameter.name, parameter);
  }
  for (const std::vector<OptionSpec>* family : {&all.of_laws, &all.of_states})
    for (const OptionSpec& parameter : *family)
      if (parameter.type == OptionType::real) add_profile(all.of_profiles, parameter.name, parameter);
  for (const Pair& pair : pairs) {
    pair.connect(all.of_laws);
    pair.connect(all.of_states);
  }
  all.default_state = [](const Options& o) { return Law(o.text("friction_law"))->states.front()->name; };
  all.has_threshold = [](const Options& o) { return Law(o.text("friction_law"))->jumps_at_rest; };
  return all;
}

}  // namespace stickslip
