#include "commands/command_run.hpp"

#include "base/failure.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"

namespace stickslip {

Names names_of(const Options& options) {
  Names names{options.text("units_length"),
              options.text("units_time"),
              options.text("units_force"),
              options.text("model_form") == "chain",
              {}};
  for (const std::string& label : options.words("labels")) {
    const std::size_t colon = label.find(':');
    const std::string name = trimmed(label.substr(0, colon));
    const OptionSpec* spec = find_option(name);
    if (!spec)
      throw usage_error("labels: {}: no such option{}", stickslip::quoted(name),
                        did_you_mean(nearest_option(name)));
    if (colon == std::string::npos || trimmed(label.substr(colon + 1)).empty())
      throw usage_error("labels: {}: no words for it; write {}: WORDS", stickslip::quoted(label), name);
    names.labels[spec->name] = trimmed(label.substr(colon + 1));
  }
  return names;
}

CommandRun::CommandRun(const std::string& command, const Options& asked, const std::vector<SummaryKey>& keys)
    : options((note_names(names_of(asked)), asked)), provenance(Provenance::of(command, options.all())),
      lock_(check_outputs(options.text("out_file"), options.text("summary"))),
      summary(provenance, keys, options.text("summary")) {}

void CommandRun::end_at_signal(ResultFile& file) const {
  keeping_what_is_found([] { beat("branches"); },
                        [&] {
                          if (provenance.ranks == 1) file.write();
                        });
}

void check_continuation(const Options& options, const std::string& command, const std::string& suffix) {
  const std::string which = command + "_continue" + suffix, end = command + "_to" + suffix,
                    name = options.text(which);
  if (options.is_set(which) != options.is_set(end))
    throw UsageError(which + " and " + end + " belong together: which option to vary, and up to which value");
  if (!options.is_set(which)) return;
  const OptionSpec& spec = real_option(which, name, "a branch follows a real option");
  if (options.text(name).empty())
    throw UsageError(which + " " + name + ": needs -" + name + " as the start of the branch");
  for (const std::string& word : spec.words)
    if (lower_case(options.text(name)) == word)
      throw UsageError(which + " " + name + ": the branch starts at a number, not at `" + word + "`");
  if (options.real(end) == options.real(name))
    throw UsageError(end + " " + options.text(end) + ": the branch starts there");
  (void)options.with(name, options.real(end));  // must be a value that the option can take
}

}  // namespace stickslip
