#include "stickslip/model/friction.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <limits>
#include <stdexcept>
#include <utility>

#include "base/failure.hpp"
#include "model/dispatch.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/model.hpp"
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
    spec.fault = p.fault;
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

namespace {

// Those that friction alone asks for.
FrictionPlaces law_places(const Scene& scene, PetscInt count, const std::function<PetscInt(PetscInt)>& node) {
  FrictionPlaces places;
  if (!scene.laws_differ()) {
    if (!scene.friction.terms.none()) places.push_back({});
    return places;
  }
  for (PetscInt i = 0; i < count; ++i)
    places.push_back({scene.x(node(i)), friction_amplitude(scene, node(i), 1)[0]});
  return places;
}

}  // namespace

Frictions::Frictions(const Scene& scene, PetscInt first, PetscInt count) : vary_(scene.laws_differ()) {
  const auto node = [first](PetscInt i) { return first + i; };
  if (const FrictionPlaces places = law_places(scene, count, node); !places.empty())
    list_ = Friction::along(scene.friction, places);
  else if (!vary_)
    list_ = {Friction::of(scene.friction)};
}

FrictionPlaces friction_places(const Scene& scene, PetscInt count,
                               const std::function<PetscInt(PetscInt)>& node) {
  FrictionPlaces places = law_places(scene, count, node);
  if (!scene.medium.nodes_differ()) return places;
  if (!scene.laws_differ()) places.assign(std::size_t(count), FrictionPlace{});
  for (PetscInt i = 0; i < count; ++i) places[std::size_t(i)].medium = scene.coefficients(node(i));
  return places;
}

FrictionPlaces friction_places(const Scene& scene, PetscInt first, PetscInt count) {
  return friction_places(scene, count, [first](PetscInt i) { return first + i; });
}

std::vector<double> positions(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> x;
  for (PetscInt i = first; i < first + count; ++i) x.push_back(scene.x(i));
  return x;
}

// Spread of the friction amplitude: the same medium for any number of ranks and, in the continuum, for any
// grid.

namespace {

// A bijective mixing of 64 bits (xor-shift-multiply rounds, constants of splitmix64): neighbouring counters
// give unrelated numbers.
std::uint64_t mix(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

double uniform_from(std::uint64_t key) { return (static_cast<double>(mix(key) >> 11) + 0.5) * 0x1p-53; }

std::uint64_t key_of(PetscInt seed, PetscInt index) {
  return mix(static_cast<std::uint64_t>(seed)) ^ (static_cast<std::uint64_t>(index) * 2);
}

// One draw of the amplitude.
double draw(const Scene& scene, PetscInt index) {
  if (scene.spread_kind == SpreadKind::uniform)
    return 1 + scene.spread * (2 * counter_uniform(scene.friction_seed, index) - 1);
  const double z = counter_normal(scene.friction_seed, index);
  return std::exp(scene.spread * z - scene.spread * scene.spread / 2);
}

}  // namespace

double counter_uniform(PetscInt seed, PetscInt index) { return uniform_from(key_of(seed, index)); }

double counter_normal(PetscInt seed, PetscInt index) {
  const std::uint64_t key = key_of(seed, index);
  const double r = std::sqrt(-2 * std::log(uniform_from(key)));
  return r * std::cos(2 * M_PI * uniform_from(key ^ 1));
}

namespace {

// Draws at points `length` apart; on a ring a whole number of them, so that it closes. Between them the
// quintic 10 s^3 - 15 s^4 + 6 s^5, with two continuous derivatives; it keeps the mean and the range of the
// draws.
template <class Draw>
double between_draws(const Scene& scene, double length, double x, const Draw& draw_at) {
  const PetscInt cells = std::max<PetscInt>(1, static_cast<PetscInt>(std::llround(scene.length / length)));
  const double q = x / (scene.ring() ? scene.length / double(cells) : length);
  const PetscInt corner = static_cast<PetscInt>(std::floor(q));
  const double s = q - double(corner), w = s * s * s * (10 + s * (6 * s - 15));
  const auto at = [&](PetscInt j) { return draw_at(scene.ring() ? j % cells : j); };
  return (1 - w) * at(corner) + w * at(corner + 1);
}

double profile_at(const Scene& scene, double x) {
  return scene.amplitude.points().empty() ? 1 : scene.amplitude.at(x);
}

}  // namespace

std::vector<double> friction_amplitude(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> a(count, 1.);
  if (scene.unit_amplitude()) return a;
  const bool block_by_block = scene.form == Form::chain && scene.spread != 0;
  for (PetscInt i = 0; i < count; ++i) {
    const double x = scene.x(first + i);
    a[i] = block_by_block ? draw(scene, first + i) * profile_at(scene, x) : friction_amplitude_at(scene, x);
  }
  return a;
}

double friction_amplitude_at(const Scene& scene, double x) {
  const double profile = profile_at(scene, x);
  if (scene.spread == 0) return profile;
  return between_draws(scene, scene.spread_length, x, [&](PetscInt j) { return draw(scene, j); }) * profile;
}

double Scene::friction_length() const {
  double least = spread != 0 ? spread_length : std::numeric_limits<double>::infinity();
  least = std::min(least, amplitude.shortest());
  for (const auto* profiles : {&friction.profiles, &medium.profiles})
    for (const auto& [name, profile] : *profiles) least = std::min(least, profile.shortest());
  return least;
}

double noise_at(const Scene& scene, double length, PetscInt seed, PetscInt node) {
  const auto draw_at = [&](PetscInt j) { return 2 * counter_uniform(seed, j) - 1; };
  if (scene.form == Form::chain || length == 0) return draw_at(node);
  return between_draws(scene, length, scene.x(node), draw_at);
}

}  // namespace stickslip
