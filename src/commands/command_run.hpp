// What every command has around its computation: where its results come from, the lock on the files that it
// may write, its summary, its pulse, the file of its results, and what of them stays where a signal ends it.
// And the options of a branch, alike for every command that follows one: COMMAND_continue and COMMAND_to.
#pragma once

#include <string>
#include <type_traits>
#include <vector>

#include "base/found_until.hpp"
#include "base/names.hpp"
#include "output/table.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

// What the options units_* and labels say. Throws UsageError where a label is of no option.
Names names_of(const Options& options);

class CommandRun {
 public:
  // `keys`: the command's own, in its summary. Throws UsageError where a file cannot be written. Collective.
  CommandRun(const std::string& command, const Options& asked, const std::vector<SummaryKey>& keys);

  const Options& options;  // which outlive this
  const Provenance provenance;

 private:
  const OutputLock lock_;  // before anything is written

 public:
  Summary summary;

  // The exit code of `body`, 0 where it returns none; what it throws stands in the summary. Collective.
  template <class Body>
  int carry_out(const Body& body) {
    return with_summary(summary, [&] {
      if constexpr (std::is_void_v<decltype(body())>)
        return body(), 0;
      else
        return body();
    });
  }
  // Of a command that searches: with a pulse, which shows how far it is and hears signals. `stage`: the first
  // one, "" where it has no name.
  template <class Body>
  int search(const char* stage, const Body& body) {
    return carry_out([&] {
      const Pulse pulse(options.text("progress"), provenance.command);
      if (*stage) Pulse::stage(stage);
      return body();
    });
  }

  bool has_file() const { return !options.text("out_file").empty(); }
  ResultFile file() const { return {PETSC_COMM_WORLD, options.text("out_file"), provenance}; }
  // Where a signal ended a branch, which stands in the file as far as it was followed: writes that and throws
  // Interrupted. Several ranks stopped at several places, and write none.
  void end_at_signal(ResultFile& file) const;
};

// Both are given or neither, the first names a real option, and the second is a value that this can take and
// does not have. `suffix`: behind their names, "2" of a second option. Throws UsageError.
void check_continuation(const Options& options, const std::string& command, const std::string& suffix = "");

}  // namespace stickslip
