// What `cycle`, `wave` and `boundary` have in common: the orbits that options ask for, and how they are
// written.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "commands/command.hpp"
#include "output/table.hpp"
#include "stickslip/base/provenance.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/verify.hpp"
#include "stickslip/waves/train.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

// What the options of `cycle` ask for: the cell, its cycle, and how that is continued and its waves are
// looked at.

// The cell of the options: one node, cycle_cell nodes of a ring, or the whole scene. Throws UsageError where
// the scene has no such cell.
Scene cell_of_options(const Options& options);

// The start of a cell, node by node, from init_*: the unknowns of nodes that are not held; where friction
// sticks, of all.
std::vector<double> start_of_cell(const Options& options, const Scene& cell);

// cycle_continue, cycle_to and cycle_spectrum, checked before any work. Throws UsageError.
void check_cycle_options(const Options& options, const Scene& cell);

// A cycle with what can be asked about it.
struct FoundCycle {
  Cycle cycle;
  std::vector<double> x;           // positions of its nodes
  std::size_t mesh_intervals = 0;  // of collocation; 0 where it has none
  // of so many wavenumbers; empty where the cell has no neighbours
  std::function<BlochSpectrum(int)> waves;
  bool alone = false;  // no neighbours, or none that it feels
  std::function<CycleBranch(const std::string& name, double to, int steps, bool with_waves)> branch;
};

// Throws Failure where there is none, which says what was found instead.
FoundCycle find_cycle(const Options& options, const Scene& cell);

// What the options wave_* ask for.

// The train. Throws UsageError where neither or both of length and speed are given.
TrainRequest train_request(const Options& options);
// The options wave_continue and wave_to, checked before any work. Throws UsageError.
void check_branch(const Options& options);
// The train as a function of the real option `name`.
TrainFamily train_family(const Options& options, const std::string& name);

// That of two options; the same name twice: of that one alone.
TrainFamily2 train_family(const Options& options, const std::string& name, const std::string& name2);

// What `boundary` says of what it found: lists of the summary, the file, lines for people.

// What the command found. The points of sliding come first, then those of stick-slip, of waves and of trains.
struct FoundBoundary {
  std::vector<Axis> axes;
  std::vector<Crossing> sliding, stick_slip, waves, trains;
  BoundaryFindings findings;
  // On even lattices of the axes, empty where not asked for: of stick-slip from its end; growth of waves on
  // the uniform oscillation.
  std::vector<double> distances, wave_growth;
  std::vector<TrainSample> train_samples;  // in coordinates on the axes
  bool cell = false;                       // stick_slip is that of a cell (cycle_cell), not of uniform motion
  std::vector<Verified> verified;
  bool checked = false;  // asked for these
  long evaluations = 0;
  std::vector<Crossing> points() const;  // all, pieces numbered one behind the other
};

Columns<FoundBoundary> boundary_keys();

// Lines of the summary for people.
void describe(Summary& summary, GrowthRate& growth, const FoundBoundary& found);
// Of one parameter: what a growth rate says between its points and turns.
void describe_sliding(Summary& summary, const std::string& what, const std::function<double(double)>& growth,
                      const FoundBoundary& found);
// A line for each point on stdout. Collective.
void print_points(const std::vector<Axis>& axes, const std::vector<Crossing>& points);

// Collective; nothing is written without -out_file.
void write_file(const CommandRun& run, const GrowthRate& growth, const FoundBoundary& found);
std::vector<TableText> boundary_tables();  // of what the command writes

}  // namespace stickslip
