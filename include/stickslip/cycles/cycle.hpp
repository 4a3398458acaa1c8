// Periodic oscillations (cycles) of a cell of nodes: what is known of one, whatever method found it.
//
// A cell is one node (uniform motion), m nodes that repeat round a ring, or a whole scene. Its unknowns stand
// node by node as in Model: psi, eta and, with a state law, the stored state (friction.hpp). psi is a
// velocity, eta a number, times have the unit of time. Nothing here communicates.
#pragma once

#include <petscsys.h>

#include <complex>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/continuation.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

// A stretch of time in which friction holds a node at psi = 0: 0 <= begin < period, end may lie in the next
// period.
struct Rest {
  PetscInt node;
  double begin, end;
};

struct Cycle {
  PetscInt nodes = 1;
  int dof = 2;  // unknowns a node
  double period = 0;
  int forcing_periods = 0;     // of the load, in one of the cycle; 0: the plate goes evenly
  std::vector<double> times;   // 0 = first < ... < last = period; dense where the motion is steep
  std::vector<double> states;  // (times, nodes, dof), row-major; the last equals the first
  std::vector<Rest> rests;     // exact stick only, in order of `begin`
  // Floquet multipliers: what becomes of a deviation in one period. Largest modulus first, complex ones as
  // neighbours, the phase mode's (1 but for the error) included: number phase_mode of the list, or of none
  // under a load, which sets the phase. Directions that a rest wipes out have the multiplier 0.
  std::vector<std::complex<double>> multipliers;
  std::size_t phase_mode = 0;
  std::string not_linear;  // why there are none: deviations do not add up

  double psi_min = 0, psi_max = 0;  // over the nodes and one period
  double amplitude = 0;             // half the largest range of psi at a node, as `run` has it
  double rest_fraction = 0;         // of the time, mean over the nodes
  double force_drop = 0;            // largest less least mean of eta over the nodes
  double residual = 0;              // of the equations, in units of psi and eta
  double error_estimate = 0;        // of the period, relative; not below round-off
  // Functions whose change of sign along a branch is a special point of that name, e.g. `graze`; beside those
  // that follow from the multipliers (continuation.hpp).
  std::map<std::string, double> tests;

  double psi(std::size_t time, PetscInt node = 0) const { return at(time, node)[0]; }
  double eta(std::size_t time, PetscInt node = 0) const { return at(time, node)[1]; }
  // psi, eta[, state] of a node.
  const double* at(std::size_t time, PetscInt node) const {
    return &states[(time * std::size_t(nodes) + std::size_t(node)) * std::size_t(dof)];
  }
};

// Largest growth rate ln|multiplier|/period but for the phase mode's; -infinity where every other deviation
// is wiped out.
double growth_rate(const Cycle& cycle);

// The least psi of a node along v: where it is positive none ever stops, and friction that sticks is that of
// sliding throughout.
double least_along(const Cycle& cycle, double v);

// psi_min, psi_max, amplitude and force_drop from `states`, which must be dense enough to show them;
// rest_fraction from `rests`.
void measure(Cycle& cycle);

// Branches of cycles in one parameter (numerics/continuation.hpp), for any kind of cycle: of smooth friction,
// or with rests. Computed alike on every rank.

// A cycle as a point of its branch is seen.
struct CycleLook : Look {
  Cycle cycle;
  double growth_rate = 0;  // largest, the phase mode left out; with `watch`: its waves' too
};

// The cycles of a cell in one parameter.
class CycleFamily : public Family {
 public:
  virtual Cycle cycle() const = 0;      // the candidate
  virtual Place direction() const = 0;  // the tangent that was asked for last, once more
  std::shared_ptr<Look> look() override;
  Words words() const override { return {"cycle", "cycle_steps", ": steady sliding"}; }
  Ending ending(const Look& last) const override;
  // Another family, at() of its parameter, which has a cycle near `from`: solve() starts there from a mixture
  // of candidates, this one with the weight that the others leave of 1. These are of the same kind.
  using Others = std::vector<std::pair<const CycleFamily*, double>>;
  virtual std::unique_ptr<CycleFamily> beside(std::function<Scene(double)> at, double from, double range,
                                              const Others& others = {}) const = 0;

 protected:
  explicit CycleFamily(double range) : range_(range) {}
  // Where solve() has thrown last since the cycle is of another kind there: the kind of special point
  // between.
  virtual std::string ends() const { return ""; }
  virtual std::vector<double> halves() const { return {}; }  // of Look
  double range_;  // of the parameter
};

// Special points of cycles (SpecialPoint), beside those of every branch:
//   long-wave        the phase diffusion changes its sign
//   wave             a wave of finite length begins or ceases to grow while long ones decay: `wavenumber`
//   graze            a slip just reaches rest: the branch of a cycle with rests ends, or of one under a load
//                    that never rests
//   pass             a slip swings back and just stops, or passes psi = 0 into the next: likewise
//   release          the force on a node at rest just reaches its threshold: likewise
//   order            two nodes start or stop at the same time, on either side of it one after the other: here
//                    too the branch ends
// and the names of Cycle::tests. At `hopf` the motion is steady sliding.

struct CyclePoint {
  double value = 0;
  Cycle cycle;
  bool stable = false;     // with `watch`: to its waves too
  double growth_rate = 0;  // largest, the phase mode left out
  double wavenumber = 0;   // which grows so; 0 without waves
};

struct CycleBranch {
  std::vector<CyclePoint> points;
  std::vector<SpecialPoint> special;
  std::string end;  // why it ends, in words
};

// What is said of every cycle of a branch besides its own multipliers, and functions whose changes of sign
// are special points: `long-wave` and `wave`.
struct Watched {
  bool stable = false;
  double growth_rate = 0, wavenumber = 0;
  std::map<std::string, double> tests;
};
using CycleWatch = std::function<Watched(double value, const Cycle& cycle)>;

// Follows the branch of a cycle (numerics/continuation.hpp).
CycleBranch continue_cycle(CycleFamily& family, const Way& way, const CycleWatch& watch = nullptr,
                           Follow until = Follow::whole);

// Cycles of smooth friction by collocation in time: found, solved to an accuracy, continued.
//
// A scene's nodes are the cell: one node alone is uniform motion. Collocation at five Gauss points an
// interval on a mesh that follows the motion (numerics/periodic_equations.hpp); the phase is that of a plane
// across the motion. Computed alike on every rank, nothing communicates.
//
// Under a load that repeats (Scene::load, a sine alone) a cycle takes a whole number of its periods, and its
// multipliers are those of the map over them. Friction that sticks is allowed where the motion never stops.
class CellField;

// Most unknowns of a cell: the equations take 60 unknowns^2 numbers of memory and 100 unknowns^3 operations a
// step of Newton's method, about.
constexpr int most_cell_unknowns = 300;

// A cycle with what its stability and a branch start from: unknowns of collocation on a mesh of phases, node
// by node in the order of `field`.
struct SmoothCycle {
  std::shared_ptr<const CellField> field;
  std::vector<double> mesh, values;  // as numerics/periodic_equations.hpp
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

// Nodes of a cell at most: the work of the return map grows like their third power.
constexpr PetscInt stick_cycle_limit = 20;

// The one node that moves as every node of a uniform scene does.
Scene one_node_of(const Scene& scene);

// What the motion from a start comes to.
enum class Fate {
  repeats,     // a cycle with rests
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
  double time;  // looked at
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

// Stability of cycles to waves: Floquet-Bloch multipliers over the wavenumber.
//
// A cell's motion repeats on an infinite line or a ring of any number of cells. A deviation that is exp(i
// theta) times as large in the next cell obeys the linearised equations of one cell with its neighbours with
// this Bloch phase; about uniform motion exp(ikx) obeys those of one node with kappa^2(k) for -D2: k^2 in the
// continuum, whatever the grid, and the symbol of the difference in the chain. Each wavenumber has as many
// multipliers as the cell has unknowns. Alike on every rank, nothing communicates. Wavenumbers are 1/length
// (1/block in the chain), growth rates ln|multiplier|/period.
struct BlochPoint {
  double wavenumber = 0;
  std::vector<std::complex<double>> multipliers;  // largest first
  double growth_rate = 0;                         // of the largest
};

struct BlochSpectrum {
  std::vector<BlochPoint> points;  // k > 0, rising
  // The largest growth rate over the wavenumbers from the first of `points` on, those below where they grow,
  // and k = 0 but for the phase mode; the wavenumber that has it. Refined between the points: see
  // src/cycles/bloch.cpp.
  double growth_rate = 0, wavenumber = 0;
  std::complex<double> multiplier = 0;
  // The phase mode of a long wave grows at -diffusion k^2 + O(k^4); unit length^2/time. NaN under a load,
  // which sets the phase.
  double diffusion = 0;
  // Every deviation decays but the phase mode of k = 0, whose branch has a positive diffusion: no rate given
  // here is positive then. `decided`: false where a growth rate that matters is nearer to 0 than its error
  // and none grows.
  bool stable = false, decided = true;
  bool coupled = true;  // false: neighbours do not feel each other, every phase stays as it is
  // growth rate that waves tend to as k grows: of uniform motion of the continuum, else NaN
  double short_waves = 0;
  double largest_at_zero = 0;  // growth rate of the largest multiplier but the phase mode's at k = 0
  // largest growth rate of a wave that is not on the branch of the phase mode, near k = 0
  double largest_of_finite = 0;
};

// Of the waves on the cycle of a cell, `wavenumbers` of which are listed. Throws UsageError where the cell is
// no ring (its ends are not those of one of many).
BlochSpectrum bloch_spectrum(const SmoothCycle& cycle, int wavenumbers);
// With exact stick `course` is what described() says of the cycle. Throws Failure where waves have no linear
// answer: with viscosity between neighbours and nodes that begin to slip at once with a jump in their
// acceleration.
BlochSpectrum bloch_spectrum(const StickCycle& cycle, const Cycle& course, const Scene& cell,
                             int wavenumbers);

// What a branch watches besides the cycles' own multipliers: `long-wave` (the diffusion) and, where long
// waves decay, `wave` (the largest growth rate of a wave of finite length).
Watched watch_waves(const BlochSpectrum& spectrum);

}  // namespace stickslip
