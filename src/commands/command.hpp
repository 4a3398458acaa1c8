// What commands share: their list, a command from its options to its summary, groups of ranks, and how runs
// are ended.
#pragma once

#include <petscsys.h>

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <type_traits>
#include <vector>

#include "base/pulse.hpp"
#include "output/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

// Who of the ranks works: as many as there is work for, or all of them in groups of equal size, each of which
// takes the next number when it is free.

// What body() returns, on the first `count` ranks of PETSC_COMM_WORLD, which are that while it lasts; the
// others rest, without a processor, until those are done, and return the same. So what `body` computes and
// writes is what it is on `count` ranks. Collective.
int on_ranks(int count, const std::function<int()>& body);
// Whether ranks may: those of a group of a sweep all want what its point gives.
inline bool may_rest() { return PETSC_COMM_WORLD == MPI_COMM_WORLD; }
// On no more ranks than the scene has nodes, where they may rest.
int on_ranks_of(const Options& options, const std::function<int()>& body);

// Says where psi, which goes from `low` to `high`, leaves a measured curve of friction.
void say_beyond_table(const Options& options, double low, double high, Summary& summary);

// Thrown where what is to be done is done by one rank, which finds out in setting up. Collective; before
// anything is written.
class OneRankWorks : public Error {
 public:
  OneRankWorks() : Error(2, true, "this runs on one rank") {}
};

// While it lives, PETSC_COMM_WORLD is the group of this rank (PETSc's sub-communicator), so that whatever
// runs here runs on the group alone. The numbers are counted in memory of rank 0 that all reach without its
// help.
class RankGroups {
 public:
  // `ranks_each` must have passed check(). Collective over all ranks.
  explicit RankGroups(PetscInt ranks_each);
  static void check(PetscInt ranks_each);  // throws UsageError where the ranks cannot be shared out evenly
  ~RankGroups();                           // collective, unless an exception passes
  RankGroups(const RankGroups&) = delete;
  RankGroups& operator=(const RankGroups&) = delete;

  int index() const { return index_; }
  int count() const { return count_; }
  int ranks_each() const { return size_; }
  bool leads() const { return rank_ == 0; }  // is this the first rank of its group?

  // 0, 1, 2, ...: each number once, to one group; -1, for good, from the moment that a rank of the group
  // stops. Collective in the group.
  long take(bool stops);
  bool any(bool here) const;  // is it so on a rank of the group? Collective in the group.
  void from_zero();           // collective over all ranks

 private:
  PetscSubcomm parts_ = nullptr;
  MPI_Win window_ = MPI_WIN_NULL;
  long* counter_ = nullptr;
  long own_counter_ = 0;  // of a single group
  int index_ = 0, count_ = 1, size_ = 1, rank_ = 0, exceptions_ = 0;
};

// What may stop a run or make it write a checkpoint: signals, the clock, a number of steps.
class RunControl {
 public:
  // `first_step`: from which this command goes on. The wall clock starts here.
  RunControl(const Options& options, std::int64_t first_step);

  // What to do after an accepted step, the same on every rank.
  struct Decision {
    bool stop = false;        // end the run here
    bool checkpoint = false;  // write one
    bool restart = false;     // and let the method forget what it remembers of earlier steps
  };
  // Of several ranks, what only one of them may know (a signal, the clock) is found after 20 ms or 100 steps
  // at the latest, by one reduction over all. Collective.
  // `over`: the run ends here, also where t is not ts_max_time.
  Decision after(std::int64_t step, double t, bool over = false);
  void checkpoint_written();

  bool wants_checkpoints() const { return every_.steps > 0 || every_.seconds > 0; }
  bool checkpoints_by_steps() const { return every_.steps > 0; }  // after() is to see every step then
  std::int64_t most_steps() const { return most_steps_; }
  int signal() const { return stopped_by_; }           // that ended the run, 0: none
  bool wall_is_over() const { return wall_is_over_; }  // ts_max_wall came before the end

 private:
  std::array<int, 4> ask();

  SignalWatch watch_;
  StepsOrSeconds every_;
  double most_seconds_, t_end_, begin_, last_checkpoint_, asked_;  // 0 seconds: no limit
  bool alone_ = true;                                              // one rank
  int steps_since_ = 0, steps_between_ = 1;                        // the ranks asked each other
  std::int64_t first_step_, most_steps_;
  int stopped_by_ = 0;
  bool wall_is_over_ = false;
};

// The commands by name, and what the program says of them and of itself. Not collective.

// A command: its row is made by a function that stands in its own source and is named in table.cpp.
struct Command {
  const char* name;
  const char* does;
  // Reads its options, does its work and returns the exit code (0, or that of a signal it stopped for).
  // Errors leave as exceptions (error.hpp). Collective.
  int (*body)(const Options&);
  bool has_grid;
  std::vector<TableText> (*tables)();  // what it writes, first the keys of its summary
};

const std::vector<Command>& commands();
std::vector<std::string> command_names();
const Command& command_named(const std::string& name);  // one of command_names()

std::string tables_text();  // of all commands, for scripts/tables.py
std::string general_help();
// Of all groups of options, or of that whose name begins with the word `topic`. Throws UsageError where there
// is no such group.
std::string command_help(const Command& command, const std::string& topic = "");
std::string version_text();  // versions of the libraries too: once they have started
void print_library_help();   // what PETSc and SLEPc print of their options; collective

// What every command has around its computation: where its results come from, the lock on the files that it
// may write, its summary, its pulse, the file of its results, and what of them stays where a signal ends it.
// And the options of a branch, alike for every command that follows one: COMMAND_continue and COMMAND_to.

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
