// The motion of a cell whose nodes stick: its steps, its course from change to change, and its return map.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/process.hpp"
#include "model/right_hand_side.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

// Steps of y' = f(y) of order 12 by extrapolation of the midpoint rule, for smooth problems that are not
// stiff and answers to nearly round-off. Local to the process.
//
// In a step of length h the midpoint rule with n = 2, 4, ..., 12 parts has an error in even powers of h/n;
// the polynomial in (h/n)^2 through the six results is taken at 0. The error estimate is its difference from
// that through the last five, of order 10. 36 evaluations of f a step beside that at its start.
//
// Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, Springer 1993,
// section II.9.
class Extrapolation {
 public:
  // Results of unknowns 0..size-1; the first `controlled` count in the error estimate.
  explicit Extrapolation(std::size_t size)
      : size_(size), columns_(parts * size), a_(size), b_(size), f_(size) {}

  // `into` becomes y after h; f(y, rates) is the right-hand side, f0 its value at y. Returns the largest
  // error estimate of an unknown over `tolerance` (scale + |y|), its scale that of the list: at most 1 is
  // within it; not finite where f is not.
  template <class F>
  double step(F&& f, const double* y, const double* f0, double h, std::size_t controlled, double tolerance,
              const double* scales, double* into) {
    for (int j = 0; j < parts; ++j) {
      double* const result = &columns_[j * size_];
      midpoint(f, y, f0, h, 2 * (j + 1), result);
    }
    // Aitken and Neville: column j becomes the value of the polynomial through results 0..j.
    double error = 0;
    for (std::size_t k = 0; k < size_; ++k) {
      double t[parts];
      for (int j = 0; j < parts; ++j) t[j] = columns_[j * size_ + k];
      double before = t[parts - 1];
      for (int level = 1; level < parts; ++level) {
        before = t[parts - 1];
        for (int j = parts - 1; j >= level; --j) {
          const double ratio = double(j + 1) / double(j + 1 - level);
          t[j] += (t[j] - t[j - 1]) / (ratio * ratio - 1);
        }
      }
      into[k] = t[parts - 1];
      if (k < controlled)
        error = worse(error, std::abs(t[parts - 1] - before) / (tolerance * (scales[k] + std::abs(y[k]))));
    }
    return error;
  }

  // The length of the next step, by that of this one and its error.
  static double next(double h, double error) {
    if (!std::isfinite(error)) return h / 8;
    return h * std::clamp(0.8 * std::pow(std::max(error, 1e-30), -1. / 11), 0.125, 4.);
  }

 private:
  static constexpr int parts = 6;
  // NaN is worst, and stays
  static double worse(double a, double b) { return b <= a || std::isnan(a) ? a : b; }

  template <class F>
  void midpoint(F&& f, const double* y, const double* f0, double h, int n, double* result) {
    const double part = h / n;
    std::copy(y, y + size_, a_.begin());
    for (std::size_t k = 0; k < size_; ++k) b_[k] = y[k] + part * f0[k];
    for (int i = 1; i < n; ++i) {
      f(b_.data(), f_.data());
      for (std::size_t k = 0; k < size_; ++k) a_[k] += 2 * part * f_[k];
      std::swap(a_, b_);
    }
    std::copy(b_.begin(), b_.end(), result);
  }

  std::size_t size_;
  std::vector<double> columns_, a_, b_, f_;
};

// The motion of a few nodes whose friction sticks, from change to change to nearly round-off, with its
// deviations.
//
// A change is a start or a stop of a node. Between changes every node has a direction (1, -1, or 0 at rest)
// and the right-hand side is smooth: it is integrated at order 12 (Extrapolation above), and the
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

// The return map of friction that sticks and its fixed points; see cycle.hpp.

// One time round: from a release to as many releases later as `from.releases` says.
struct StickReturnMap {
  StickState at;  // right after that release, with the deviations that were asked for
  double period = 0;
  std::string sequence;
  double depth = 0, clearance = 0;  // see StickCycle; depth with `turns`
  double excess = 0;                // see StickState
  std::vector<Rest> rests;
};
struct StickReturnMapOptions {
  std::vector<double> deviations = {};  // at the start, right after the release, each as long as the unknowns
  bool turns = false;
  StickMotion::Passed passed = nullptr;
  // Is called right after the release with the directions as they are, and at each change with those before
  // it.
  std::function<void(const std::vector<double>& was, const StickState& now)> changed = nullptr;
};

// Under a load: from its section on, over its periods.
//
// From `from.start` with eta of the node set to its threshold. Throws Failure where the node does not start
// there, or the motion does not come back.
StickReturnMap return_map_of(const StickMotion& motion, const StickCycle& from,
                             const StickReturnMapOptions& wishes);

// The coordinates that tell points of the section apart: all unknowns but those of held nodes, and psi and
// eta of the node that is released (under a load, all but psi of those that rest there).
std::vector<std::size_t> free_unknowns(const StickMotion& motion, const StickCycle& cycle);
std::vector<double> free_values(const StickMotion& motion, const StickCycle& cycle);
void set_free_values(const StickMotion& motion, const std::vector<double>& values, StickCycle& cycle);

// The return map in these coordinates: what comes back, and its derivative, row-major. Throws Failure as
// return_map_of().
struct MapAt {
  StickReturnMap round;
  std::vector<double> image, slopes;
};
MapAt map_at(const StickMotion& motion, const StickCycle& cycle);
// Sets what is known of a cycle whose start is a fixed point.
void close_cycle(const StickMotion& motion, StickCycle& cycle);

// The fixed point near a guess, by Newton's method. Throws Failure.
StickCycle polished(const StickMotion& motion, const StickCycle& guess);

// The places of the unknowns of nodes that are not held.
std::vector<std::size_t> moving_unknowns(const StickMotion& motion);
// The matrix that takes deviations of those right after the release round the cycle, column by column.
std::vector<double> monodromy_matrix(const StickMotion& motion, const StickCycle& cycle);

// Its eigenvalues, largest modulus first.
std::vector<std::complex<double>> multipliers_of(std::size_t size, const std::vector<double>& map);
// The cycle near what a motion has come to: made exact, and the shorter one where it has repeated within its
// releases (its periods of the load), as it seems to beside a doubling. Nothing where it is far from there;
// throws Failure as polished().
std::optional<StickCycle> cycle_near(const StickMotion& motion, const StickCycle& near);
// Of the deviation that grows most, or of that along the motion, which stays: the logarithm.
double growth_in_period(const StickMotion& motion, const StickCycle& cycle);

}  // namespace stickslip
