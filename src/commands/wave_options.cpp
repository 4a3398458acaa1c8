#include "commands/wave_options.hpp"

#include <algorithm>

#include "stickslip/base/error.hpp"

namespace stickslip {

TrainRequest train_request(const Options& options) {
  TrainRequest request{options.integer("wave_pulses"), options.real_if_set("wave_length"),
                       options.real_if_set("wave_speed"), true};
  if (bool(request.length) == bool(request.speed))
    throw UsageError(request.length ? "wave_length and wave_speed are both set: exactly one of the two is needed"
                                    : "wave_length or wave_speed is needed: exactly one of the two");
  return request;
}

void check_branch(const Options& options) {
  const std::string name = options.text("wave_continue");
  if (options.is_set("wave_continue") != options.is_set("wave_to"))
    throw UsageError("wave_continue and wave_to belong together: which option to vary, and up to which value");
  if (!options.is_set("wave_continue")) return;
  const std::vector<OptionSpec>& table = option_table();
  const auto spec = std::find_if(table.begin(), table.end(), [&](const OptionSpec& o) { return o.name == name; });
  if (spec == table.end()) {
    std::vector<std::string> names;
    for (const OptionSpec& o : table)
      if (o.type == OptionType::real) names.push_back(o.name);
    const std::string near = nearest_name(name, names);
    throw UsageError("wave_continue " + name + ": no such option" +
                     (near.empty() ? "" : "; did you mean " + near + "?"));
  }
  if (spec->type != OptionType::real && spec->type != OptionType::real_or_word)
    throw UsageError("wave_continue " + name + ": a branch follows a real option, which this is not");
  if ((name == "wave_length" || name == "wave_speed") && !options.is_set(name))
    throw UsageError("wave_continue " + name + ": needs -" + name + " as the start of the branch");
  if (options.real("wave_to") == options.real(name))
    throw UsageError("wave_to " + options.text("wave_to") + ": the branch starts there");
  (void)options.with(name, options.real("wave_to"));  // must be a value that the option can take
}

TrainFamily train_family(const Options& options, const std::string& name) {
  return {name, [options, name](double value) {
            const Options here = options.with(name, value);
            return TrainCase{Scene::from(here, true), train_request(here)};
          }};
}

}  // namespace stickslip
