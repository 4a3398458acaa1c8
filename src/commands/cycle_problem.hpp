// What the options of `cycle` ask for: the cell, its cycle, and how that is continued and its waves are
// looked at.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stickslip/cycles/cycle.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

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

}  // namespace stickslip
