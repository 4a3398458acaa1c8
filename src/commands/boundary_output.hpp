// What `boundary` says of what it found: lists of the summary, the file, lines for people.
#pragma once

#include <string>
#include <vector>

#include "commands/command_run.hpp"
#include "output/table.hpp"
#include "stickslip/base/provenance.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/verify.hpp"
#include "stickslip/waves/train_limits.hpp"

namespace stickslip {

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
// A line for each point on stdout. Collective.
void print_points(const std::vector<Axis>& axes, const std::vector<Crossing>& points);

// Collective; nothing is written without -out_file.
void write_file(const CommandRun& run, const GrowthRate& growth, const FoundBoundary& found);
std::vector<TableText> boundary_tables();  // of what the command writes

}  // namespace stickslip
