// Cycles of smooth friction by collocation in time: found, solved to an accuracy, continued.
//
// A scene's nodes are the cell: one node alone is uniform motion. Collocation at five Gauss points an
// interval on a mesh that follows the motion (numerics/periodic_equations.hpp); the phase is that of a plane
// across the motion. Computed alike on every rank, nothing communicates.
//
// Under a load that repeats (Scene::load, a sine alone) a cycle takes a whole number of its periods, and its
// multipliers are those of the map over them. Friction that sticks is allowed where the motion never stops.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "stickslip/cycles/cycle.hpp"
#include "stickslip/cycles/smooth_cycle.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

class CellField;

// Most unknowns of a cell: the equations take 60 unknowns^2 numbers of memory and 100 unknowns^3 operations a
// step of Newton's method, about.
constexpr int most_cell_unknowns = 300;

// A cycle with what its stability and a branch start from: unknowns of collocation on a mesh of phases, node
// by node in the order of `field`.
struct SmoothCycle {
  std::shared_ptr<const CellField> field;
  std::vector<double> mesh, values;  // as numerics/periodic_mesh.hpp
  Cycle cycle;
};

// A start: one period, y at any phase node by node as in Model (all nodes of the cell, held ones too).
struct CycleGuess {
  double period = 0;
  std::function<void(double phase, double* y)> at;
  std::vector<double> mesh;  // of phases that follow it
  int periods = 0;           // of the load, if there is one: they say the period
};

// Throws UsageError where friction jumps at rest and nothing forces, or the cell has more than
// most_cell_unknowns.
void check_smooth_cell(const Scene& cell);

// The cycle near a guess, with a period to the relative accuracy `tolerance`. Throws Failure where Newton's
// method does not converge to one.
SmoothCycle solve_cycle(const Scene& cell, const CycleGuess& guess, double tolerance = 1e-10);

// The uniform oscillation of a scene (one node), from slips of several sizes that settle on it
// (model/oscillator.hpp), the first of which begins `slip` friction forces above sliding; one that repels
// only where they settle on no other. Throws Failure where none is found, which says what was found instead.
SmoothCycle uniform_cycle(const Scene& scene, double tolerance = 1e-10, double slip = 1);

// Turns of a cell's own motion within which it is to settle on a cycle.
constexpr int turns_to_settle = 400;

// The cycle of a cell that its own motion from `start` (node by node as in Model, held ones too) settles on
// within `turns` turns, or else one that repels, near to which it came: of its shortest period. The motion
// goes by the steps of a run (time/time.hpp); from sliding that is unstable it is pushed off. Throws Failure
// where it settles on sliding, never repeats, repeats without collocation finding its cycle, or takes too
// many steps: 2 10^6 over 1 + unknowns/30, or 500 MB of them in a dozen turns.
SmoothCycle settled_cycle(const Scene& cell, const std::vector<double>& start, int turns,
                          double tolerance = 1e-10);

// The branch of a cycle: `at` gives the cell as a function of the parameter, `from` is where `first` was
// found, `range` the length of the range of the parameter that counts.
std::unique_ptr<CycleFamily> smooth_family(std::function<Scene(double)> at, double from, double range,
                                           const SmoothCycle& first);
// The cycle where such a path stands (its candidate).
SmoothCycle smooth_candidate(const CycleFamily& path);

// The motion that steady sliding becomes as the sine of the load of `cell` grows from nothing: of its period,
// stable or not. Throws Failure where it is lost on the way. Friction that sticks is that of sliding also
// where psi comes to 0: least_along() of the cycle shows it.
SmoothCycle forced_slide(const Scene& cell, double tolerance = 1e-10);
// The one that lies near the slide of another scene of the same kind, whose parameters differ a little.
// Throws Failure where there is none so near.
SmoothCycle forced_slide_near(const SmoothCycle& other, const Scene& cell, double tolerance = 1e-10);

}  // namespace stickslip
