#include "commands/continuation.hpp"

#include <vector>

#include "base/found_until.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

void check_continuation(const Options& options, const std::string& command, const std::string& suffix) {
  const std::string which = command + "_continue" + suffix, end = command + "_to" + suffix,
                    name = options.text(which);
  if (options.is_set(which) != options.is_set(end))
    throw UsageError(which + " and " + end + " belong together: which option to vary, and up to which value");
  if (!options.is_set(which)) return;
  const OptionSpec* spec = find_option(name);
  if (!spec) {
    std::vector<std::string> names;
    for (const OptionSpec& o : option_table())
      if (o.type == OptionType::real) names.push_back(o.name);
    const std::string near = nearest_name(name, names);
    throw UsageError(which + " " + name + ": no such option" +
                     (near.empty() ? "" : "; did you mean " + near + "?"));
  }
  if (spec->type != OptionType::real && spec->type != OptionType::real_or_word)
    throw UsageError(which + " " + name + ": a branch follows a real option, which this is not");
  if (options.text(name).empty())
    throw UsageError(which + " " + name + ": needs -" + name + " as the start of the branch");
  for (const std::string& word : spec->words)
    if (lower_case(options.text(name)) == word)
      throw UsageError(which + " " + name + ": the branch starts at a number, not at `" + word + "`");
  if (options.real(end) == options.real(name))
    throw UsageError(end + " " + options.text(end) + ": the branch starts there");
  (void)options.with(name, options.real(end));  // must be a value that the option can take
}

void end_at_signal(ResultFile& file, const Provenance& provenance) {
  keeping_what_is_found([] { beat("branches"); },
                        [&] {
                          if (provenance.ranks == 1) file.write();
                        });
}

}  // namespace stickslip
