// The options of friction laws and state laws, as their classes declare them.
#include <algorithm>
#include <limits>

#include "model/friction_curve.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

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
