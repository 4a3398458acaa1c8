// The options of friction laws and state laws, as their classes declare them.
#include <algorithm>
#include <limits>

#include "stickslip/model/friction.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

namespace {

OptionSpec option_of(const std::string& name, const Parameter& p) {
  constexpr double inf = std::numeric_limits<double>::infinity();
  OptionSpec spec{name, OptionType::real, p.value, p.default_help, p.unit, 0, inf, false, {}, p.help, "", "", nullptr};
  spec.open_low = p.range == Parameter::Range::positive;
  return spec;
}

// One quantity under two names, e.g. friction_D and state_D of rate-and-state friction: while the law that says so is
// chosen, each follows the other where only that is set.
struct Pair {
  Law law;
  std::string name, same_as;

  void connect(std::vector<OptionSpec>& options) const {
    for (OptionSpec& spec : options) {
      if (spec.name != name && spec.name != same_as) continue;
      const std::string own = spec.default_text;
      spec.default_text.clear();
      const bool of_law = spec.name == name;
      spec.default_of = [pair = *this, of_law, own, otherwise = spec.default_of](const Options& o) {
        if (o.text("friction_law") != pair.law->name) return otherwise ? otherwise(o) : own;
        if (of_law) return o.is_set(pair.same_as) ? o.text(pair.same_as) : own;
        return o.text(pair.name);
      };
    }
  }
};

void add_once(std::vector<OptionSpec>& options, OptionSpec spec) {
  for (const OptionSpec& other : options)
    if (other.name == spec.name) return;
  options.push_back(std::move(spec));
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
      if (*p.same_as) pairs.push_back({law, name, p.same_as});
    }
  }
  for (const StateLaw state : all_state_laws()) {
    all.states.push_back(state->name);
    for (const Parameter& p : state->parameters) add_once(all.of_states, option_of("state_" + std::string(p.name), p));
  }
  for (const Pair& pair : pairs) {
    pair.connect(all.of_laws);
    pair.connect(all.of_states);
  }
  all.default_state = [](const Options& o) { return Law(o.text("friction_law"))->states.front()->name; };
  return all;
}

}  // namespace stickslip
