// A sweep under way: a command as one of many in the same process; the points shared out over groups of
// ranks, their rows noted, the table written.
#pragma once

#include <exception>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/json_values.hpp"
#include "base/pulse.hpp"
#include "commands/command.hpp"
#include "output/table.hpp"
#include "stickslip/options/options.hpp"
#include "study/sweep_plan.hpp"

namespace stickslip {

// A command as one of many in the same process.
class PointRunner {
 public:
  // `base`: whose library options are in PETSc's database. Both must outlive it.
  PointRunner(const Command& command, const Options& base) : command_(command), base_(base) {}

  struct Outcome {
    Json row;      // flat_row of its summary; of a point that fails at least status and reason
    int code = 0;  // exit code: 0, or that of a signal it stopped for
    // What one rank of several met alone, while others may wait for it: for the caller to throw.
    std::exception_ptr alone;
  };
  // On the ranks of PETSC_COMM_WORLD, with nothing written but what `options` ask for. Collective.
  Outcome run(const Options& options) const;

 private:
  const Command& command_;
  const Options& base_;
};

// The points shared out over groups of ranks, their rows noted, the table written.
class SweepSession {
 public:
  // `sweep`: the options of the sweep; `base`: those of the command at every point but for what is varied.
  // All must outlive it. Throws UsageError. Collective.
  SweepSession(const Options& sweep, const Options& base, const SweepPlan& plan, const Command& command);

  // Computes what no journal beside out_file holds. Returns the signal that it stopped for, 0 where it came
  // to the end: then the table is whole and the journals are gone. Collective.
  int run();

  const SweepTable& table() const { return table_; }  // on rank 0
  // The text of sweep_key at a point there is, `failed` where it failed; on rank 0.
  std::string kind_of(long point) const;
  std::string key() const;  // of the summaries, whose changes are sought
  int groups() const { return groups_; }
  long failed() const;  // points; on rank 0

 private:
  // What all ranks know of a finished point.
  struct Known {
    long point;
    int kind;   // equal where kind_of is
    int whole;  // has its command come to its end?
  };
  void read_rows();
  void write_table(bool complete);
  void compute(RankGroups& groups, const std::vector<long>& units);
  void compute_unit(RankGroups& groups, long unit);
  Options options_at(long point, const std::vector<long>& wholes) const;
  void note(long point, const Json& row);
  void refine(RankGroups& groups);
  void look_at_clock(long taken, long units);

  const Options &sweep_, &base_;
  const SweepPlan& plan_;
  std::string path_;
  bool files_;
  PointRunner runner_;
  Provenance provenance_;
  SignalWatch watch_;
  Progress progress_;
  std::unique_ptr<SweepJournal> journal_;  // of the leader of a group
  int rank_ = 0, groups_ = 1;
  SweepTable table_;
  std::unordered_map<long, Known> known_;  // of the journals when last read
  int stopped_by_ = 0;
  double next_table_ = 0;
};

}  // namespace stickslip
