#include "commands/command_run.hpp"

#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/output/reader.hpp"

namespace stickslip {

CommandRun::CommandRun(const std::string& command, const Options& asked, const std::vector<SummaryKey>& keys)
    : options(asked),
      provenance(Provenance::of(command, options.all())),
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
