// The motion of a few nodes whose friction sticks, from change to change to nearly round-off, with its
// deviations.
//
// A change is a start or a stop of a node. Between changes every node has a direction (1, -1, or 0 at rest)
// and the right-hand side is smooth: it is integrated at order 12 (numerics/extrapolation.hpp), and the
// change is where the last step, made of the length for it, ends. While every node rests eta is linear in
// time and the state known in closed form. The rules of starts and stops are those of runs (time/stick.hpp).
//
// With viscosity between neighbours the force on a node is eta + N D2 psi, which at rest only its neighbours'
// psi make differ from eta (`neighbour_force`).
//
// Under loads that repeat (sines alone) the time is one unknown more, the last, from which the load
// follows; it deviates by nothing. All rest is then integrated as any other motion.
//
// Deviations y_t = J(u) y are carried along, through changes by their jump matrices (model/stick_rule.hpp).
//
// Explicit and dense: for few nodes and friction that is not stiff. Local to the process; f, psi, eta and the
// state as in Model; times in the unit of time.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "base/idling.hpp"
#include "model/right_hand_side.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/cycles/stick_cycle.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/extrapolation.hpp"

namespace stickslip {

// A node starts (direction 1 or -1 after it, 0 before), stops (0 after) or turns back.
struct Change {
  double t;
  int node;
  double before, after;  // its direction
};

// A place of the motion.
struct StickState {
  double t = 0;
  std::vector<double> u;           // unknowns node by node
  std::vector<double> direction;   // of each node
  std::vector<double> deviations;  // `count` of them, one behind the other, each like u
  std::size_t count = 0;
  // Of the slips back (against the plate) that stop_slips_back stopped: the most by which eta was beyond the
  // threshold there.
  double excess = -std::numeric_limits<double>::infinity();
  long steps = 0;  // taken so far
  Idling idling{MPI_COMM_SELF};
};

class StickMotion {
 public:
  static constexpr double never = std::numeric_limits<double>::infinity();
  // Is called for each piece of time that was passed: `at` gives u anywhere in it. For pictures: what is
  // asked costs a step.
  using Passed =
      std::function<void(double from, double to, const std::function<void(double t, double* u)>& at)>;
  // Is called where |psi| of a sliding node is least, without having been 0.
  using Turned = std::function<void(double t, int node, const double* u)>;

  // `tolerance`: of the error estimate of a step, whose order is below that of the result. Throws UsageError
  // for friction that does not stick.
  explicit StickMotion(const Scene& scene, double tolerance = exact_step);

  // From now on a slip that turns without a stop is stopped there: psi becomes 0, and eta at most the
  // threshold. The motion changes smoothly with its start where a slip only just comes back to rest, and is
  // the true one where it does.
  void stop_at_turns() { stops_at_turns_ = true; }

  // From now on a slip against the plate's direction that comes back to psi = 0 is stopped there, eta at most
  // the threshold, and StickState::excess says whether it would have stopped by itself (negative) or have
  // passed on into the next slip.
  void stop_slips_back() { stops_slips_back_ = true; }

  const Scene& scene() const { return scene_; }
  int nodes() const { return nodes_; }
  int dof() const { return dof_; }
  bool forced() const { return scene_.forced(); }
  // What psi, a state and any unknown are measured by.
  double psi_scale() const { return scales_[0]; }
  double state_scale() const { return dof_ == 3 ? scales_[2] : 1; }
  double scale(std::size_t unknown) const { return scales_[unknown]; }
  std::size_t size() const { return std::size_t(nodes_ * dof_ + (forced() ? 1 : 0)); }
  bool held(int node) const;
  double longest() const { return longest_; }               // step
  double threshold(int node, const double* u) const;        // |eta| that holds the node
  double threshold_slope(int node, const double* u) const;  // by its state
  double threshold_rate(int node, const double* u) const;   // with the normal load, at a state that stands
  // N D2 psi at the node where it rests, of unknowns, rates or a deviation: the share of its neighbours.
  double neighbour_force(int node, const double* u) const;

  // The Jacobian of the rates, dense and row-major.
  void jacobian(const std::vector<double>& direction, const double* u, double* J) const;
  // Of the state of a node at rest: the factor by which two motions that are close come together on the way
  // from s0 to s1, `wait` later.
  double state_contraction(int node, double s0, double s1, double wait) const;

  // The directions that follow from u alone, as in a run.
  void decide(StickState& p) const;
  // u_t, with the directions given.
  void rates(const std::vector<double>& direction, const double* u, double* f) const;

  // What the changes from the directions `was` to those of p, which are made at p, do to deviations. With
  // viscosity neighbours that begin to slip at once with a jump in psi_t would do so in an order of their own
  // for every deviation: throws Failure.
  struct Jump {
    Change change;
    JumpMatrix matrix;
  };
  std::vector<Jump> jumps(const std::vector<double>& was, const StickState& p) const;
  void pass_jumps(const std::vector<double>& was, StickState& p) const;  // of the deviations of p

  // How many steps with so many deviations are at most taken from change to change: steps times nodes times
  // one more than the deviations is bounded, but for 5000 steps.
  long most_steps(std::size_t deviations) const;

  bool all_rest(const StickState& p) const;  // however long that lasts, it is passed at once
  bool free_nodes_rest(const StickState& p) const;  // beside ends that may move

  // On to the next change, and past it (several at once: nodes that change together), but not beyond the time
  // `until`. The changes; none: `until` came first, or nothing ever moves again (t is infinite). Throws
  // Failure where it does not get on.
  std::vector<Change> advance(StickState& p, double until, const Passed& passed = nullptr,
                              const Turned& turned = nullptr) const;
  // Where a slip that stops at p would turn if nothing stopped it: the least psi along `direction`, negative,
  // a smooth function of the motion before; `deepest` where it goes that far without turning.
  double turn_beyond(const StickState& p, int node, double direction, double deepest) const;

 private:
  struct PossibleChange {
    int node;
    double side;  // a node at rest: of the threshold; a sliding one: its direction
    bool rests;
    bool to_come;  // at the end of the step the change is past
    bool turns;    // it is a turn at which the node is to stop
  };
  bool never_rests(int node) const { return amplitude_[node] == 0 && !held(node); }  // it has no friction
  bool follow_frictionless(StickState& p) const;  // whether one of them has turned
  double normal(const double* u) const;  // load, by which friction is multiplied
  double law_threshold(int node, const double* u) const;
  double beyond(const PossibleChange& c, const double* u) const;
  double growth(const PossibleChange& c, const double* u, const double* f) const;
  void derivative(const StickState& p, const double* y, std::size_t count, double* f) const;
  void blocks(const std::vector<double>& direction, const double* u, std::vector<NodeBlock>& at) const;
  std::vector<Change> pass_rest(StickState& p, double until, const Passed& passed) const;
  double step_from(const StickState& p, const double* f0, double h, std::size_t count, double* into) const;
  void accept(StickState& p, const double* y, double h, const double* f0, const Passed& passed) const;
  double first_change(const StickState& p, const double* f0, const double* y1, const double* f1, double h,
                      std::vector<PossibleChange>& at, const Turned& turned) const;
  double locate(const StickState& p, const double* f0, const PossibleChange& c, double low, double high,
                bool turning) const;
  void snap(StickState& p, const std::vector<PossibleChange>& candidates, double h) const;
  std::vector<Change> change(StickState& p) const;
  void lift(StickState& p) const;

  Scene scene_;
  int nodes_, dof_, half_width_;
  bool stops_at_turns_ = false, stops_slips_back_ = false;
  double tolerance_, longest_;
  std::vector<double> scales_;  // of every unknown
  Frictions law_;
  std::vector<double> amplitude_;
  RightHandSide right_hand_side_;
  LinearPoint point_;
  std::vector<NodeCoefficients> own_;    // of the nodes, where they differ
  mutable std::vector<double> factors_;  // amplitudes under a normal load, as they were last
  std::vector<Combination> halo_, d2_;
  mutable Extrapolation method_, method_with_deviations_;
};

}  // namespace stickslip
