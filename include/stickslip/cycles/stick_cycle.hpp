// Cycles of friction that sticks: slips and rests with their changes located to nearly round-off, as fixed
// points of a return map.
//
// The section is the release of one node: psi = 0 there, eta at the threshold. From it the motion is
// integrated to the release that closes the cycle (src/cycles/stick_motion.hpp), with the deviations of every
// free coordinate: all unknowns of the cell but psi and eta of that node. Newton's method on the map is exact
// then, and the matrix that takes deviations round the cycle, with the jump matrices of starts and stops,
// gives the multipliers. One block without a state has no free coordinate: its cycle is the slip that begins
// at psi = 0, eta = threshold, and the rest that follows.
//
// Under a load that repeats (Scene::load, a sine alone) the section is a phase of the load, away from all
// starts and stops, and the map that of a whole number of its periods. Its free coordinates are all unknowns
// but psi of the nodes that rest at that phase.
//
// For cells of few nodes (stick_cycle_limit), on rings, between free or held ends. Nothing here is
// collective; every rank computes the same.
#pragma once

#include <complex>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// Nodes of a cell at most: the work of the return map grows like their third power.
constexpr PetscInt stick_cycle_limit = 20;

// The one node that moves as every node of a uniform scene does.
Scene one_node_of(const Scene& scene);

// What the motion from a start comes to.
enum class Fate {
  repeats,     // a cycle with rests
  repeats_only,  // the same, but of which nothing else can be said
  slides,      // steady sliding
  oscillates,  // without rest
  stuck,       // permanently at rest
  waits,       // at rest as long as was looked at, beside an end that moves
  grows,       // without bound
  wanders      // changes between rest and sliding without repeating within the time that was looked at
};
std::string to_string(Fate fate);  // in words: "slides steadily", ...

// The section of a cycle under a load.
struct LoadPhase {
  int periods = 0;            // of the load, in one of the cycle; 0: a plate that goes evenly
  double time = 0;            // of the section, 0 <= time < the periods
  std::vector<bool> rests{};  // of each node, whether it rests there
};

// Error of a step of a motion with exact stick, as a rule.
inline constexpr double exact_step = 1e-13;

// A cycle of a cell on its section.
struct StickCycle {
  std::vector<double>
      start;  // unknowns at the release of the node `node` towards `side`, then, under a load, time
  int node = 0;
  double side = 1;
  int releases = 1;  // of that node in one period
  LoadPhase load;    // under a load, in place of a node, its side and releases
  double period = 0;
  double residual = 0;   // |return map - start|, the largest of the free coordinates
  std::string sequence;  // of starts and stops, in words that differ where it does
  // Where a slip of the cycle would turn if nothing stopped it: the greatest over the slips of psi along its
  // direction, negative, but not below -(1 + |v|)/10; 0 where a slip only grazes rest.
  double depth = 0;
  double clearance = 0;  // least |psi| where a slip turns without a stop; infinite where none does
};

struct StickFate {
  Fate fate;
  // of `repeats`; else its clearance is |psi| where the last slip turned first, |v| where none did
  StickCycle cycle;
  double time;      // looked at
  std::string why;  // of `repeats_only`: after which time it repeats, and why no cycle can be made of it
};

// Follows the motion of `scene` (the cell) from `start` (unknowns node by node, as stored) until it repeats,
// slides, grows without bound, has turned without a stop or passed psi = 0 without a rest `patience` times,
// been released 50 `patience` times, or taken a million steps over the number of nodes; polishes what
// repeats. Throws Failure where the integration fails.
StickFate stick_fate(const Scene& scene, const std::vector<double>& start, int patience = 400);
// The same of a uniform scene's one node, from a release after a long rest.
StickFate uniform_stick_fate(const Scene& one_node);

// The same under a load: until what it does in up to 12 of its periods repeats, in `patience` of them, or of
// turns of a node if these are longer. `oscillates`: without a stop; the cycle's start is then where the
// motion had come to at phase 0.
StickFate forced_stick_fate(const Scene& scene, const std::vector<double>& start, int patience = 400);

// How far stick-slip of a uniform scene's one node is from its end by grazing, a smooth function of the
// scene: the depth of the cycle that the motion settles on from a release after a long rest (negative: it
// sticks and slips), or, where its slip turns before it stops, the psi at which it does (positive), the slip
// being stopped there. Where it settles on none, or never turns: |v|. NaN if it stays at rest. Where
// nothing damps and friction never rises with velocity, so that every slip comes back to psi = 0, be it after
// many turns: -|v| for its first turn.
//
// A slip may swing back beyond psi = 0 (soft friction, fast plate). Coming from there it stops where the
// threshold holds it, or passes on into the next slip and never rests; the cycle then is one without rests.
// `passes`: the distance is that from this end, |eta| less the threshold there, which is the greater of the
// two. `period`: of that cycle; 0 where there is none or none was looked at. `tolerance`: of a step.
struct Grazing {
  double distance, period;
  bool passes = false;
};
Grazing distance_from_graze(const Scene& one_node, double tolerance = exact_step);

// The cycle of another scene near this one, by Newton's method alone; its sequence may be another. Throws
// Failure.
StickCycle polish(const Scene& scene, const StickCycle& near);

// The one multiplier of a uniform scene's cycle that is neither the phase's nor 0: 0 without a state.
double uniform_multiplier(const Scene& one_node, const StickCycle& cycle);

// What is said of a cycle, its course sampled for pictures and measures.
Cycle described(const Scene& scene, const StickCycle& cycle);

// The branch of such a cycle: `at` gives the cell as a function of the parameter, `from` is where `first` was
// found, `range` the length of the range that counts. It goes round folds, and ends where the sequence
// changes or a slip no longer comes to rest.
std::unique_ptr<CycleFamily> stick_family(std::function<Scene(double)> at, double from, double range,
                                          const StickCycle& first);
// The cycle where such a path stands (its candidate).
const StickCycle& stick_candidate(const CycleFamily& path);

}  // namespace stickslip
