// When a node at rest begins to slip. Its force changes with the plate and as its neighbours have it, its
// threshold with its state and with the normal load; all of this is known ahead, so that the first time at
// which the force comes up to the threshold is enclosed and found, however short it stays beyond it.
#pragma once

#include <petscsystypes.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

// The loads of a scene from the time t0 on, in the pieces between corners that begin at t0 or hold it; none
// by default.
class LoadsFrom {
 public:
  LoadsFrom() = default;
  LoadsFrom(const Scene& scene, double t0);

  bool vary() const { return scene_ != nullptr; }
  double velocity(double wait) const;  // of the plate where that varies, else 0
  double way(double wait) const;       // how far that has come since t0
  NormalLoad normal(double wait) const;
  // In so short a time no load has more than one extremum, and three values tell how its slope turns.
  double smooth_time() const { return scene_ ? scene_->smooth_time() / 4 : infinity; }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  const Scene* scene_ = nullptr;
  double t0_ = 0, travelled_ = 0;
  int plate_piece_ = -1, normal_piece_ = -1;  // -1: constant
};

// A node at rest and one side of it, 1 or -1, to which it may begin to slip.
struct RestingNode {
  const Friction& law;
  double amplitude, side;
  double force, state;  // at first; the force is eta + N D2 psi
  double rate;          // at which the force grows at first beside what a plate whose velocity varies adds
  double K0 = 0;        // by which it adds that
  double bend = 0, twist = 0;  // so the force gains rate wait + bend wait^2 + twist wait^3

  // Neighbours that move on the way through a step add what makes the force and its rate these at its end.
  void moves(const LoadsFrom& loads, double step, double force_then, double rate_then);
};

// What loads do at most within a step, to pass over nodes far from their thresholds, and those of which the
// ends of the step tell enough.
class LoadBounds {
 public:
  LoadBounds(const Scene& scene, const LoadsFrom& loads, double step);
  // `limit`: the less of the node's thresholds at both ends of the step.
  bool out_of_reach(const RestingNode& node, double limit) const;
  // The force comes up to the threshold once, or there is no load.
  bool plain(const ValueAndSlope& begin, const ValueAndSlope& end) const {
    return !loaded_ || (smooth_ && begin.value < 0 && end.value > 0 && begin.slope > 0 && end.slope > 0);
  }

 private:
  bool loaded_, smooth_;
  double step_, forth_ = 0, back_ = 0, falls_ = 1;  // of the plate's way; by what factor the normal load
};

// After which time it comes up to its threshold, growing: the first such, not earlier than 0, of two
// neighbours the later one, where the force is no less than the threshold. Infinite where it never comes, or
// not up to `latest`. Local, not collective. Under loads besides, until when the force goes on gaining on
// the threshold, at what rate it does at first.
struct Release {
  double wait = std::numeric_limits<double>::infinity(), gains_until = 0, gain = 0;
};
Release release(const RestingNode& node, const LoadsFrom& loads, double latest);

}  // namespace stickslip

namespace stickslip::stick_rule {

// The rule of friction that sticks (stick.hpp), of one node: whether it begins to slip or stops, and where in
// a step. What walks over nodes, of a whole model or of what moves alone, asks here.
constexpr double landing = 3e-13;   // of a step: how well a change is located
constexpr double close = 1e-12;     // relative: changes this near to each other happen at once
constexpr double locating = 1e-15;  // of a step: on the cubic, which only says where to look

// So short a time, with that frequency of the shortest wave, may a node slip without anyone seeing it.
inline double unseen_slip(double frequency) { return frequency > 0 ? 1e-9 / frequency : 0; }

inline double sign_of(double x) { return x > 0 ? 1. : x < 0 ? -1. : 0.; }

// A node at rest, whose force lies `excess` beyond its threshold `limit` and gains on it at the rate `gain`.
// `none`: an excess that is 0 but for round-off.
inline bool begins(double excess, double limit, double gain, double none = 0) {
  return excess > close * limit || (excess >= -none && gain > 0);
}
// It is at the threshold, to round-off, and has come nearer since `before`.
inline bool arrives(double excess, double before, double limit) {
  return std::abs(excess) <= close * limit && excess > before;
}
// A node that slides in the direction `going` has come to rest, to round-off, since it had psi `before`.
inline bool stops(double going, double before, double psi) {
  return going * before > 0 && going * psi <= close * going * before;
}

// How what holds or releases a node changes in a step.
struct CubicBetween : HermiteCubic {
  using HermiteCubic::HermiteCubic;

  // Where it is largest, if it rises at 0 and falls at 1.
  double peak() const {
    return last_place([&](double s) { return slope(s) > 0; }, 0, 1, locating);
  }
  // Where it becomes positive before `until`, where it is; it is taken to be negative right after 0.
  double root(double until) const {
    return last_place([&](double s) { return (*this)(s) < 0; }, 0, until, locating * until);
  }
};

// A change that comes within a step.
struct Candidate {
  PetscInt node;
  double side;        // a node at rest: of the threshold in question; a sliding one: its direction
  bool rests, fresh;  // fresh: began to slip at the start of the step
  double weight;      // turns its distance from the change into a part of the step

  // How far it is beyond its change at a part of the step, as a part of the step: negative before it. A node
  // at rest by its force and threshold, a sliding one by its psi. What has begun to slip at the start of the
  // step begins like its square, or faster: divided by that, it does not begin at zero.
  double beyond(double force_or_psi, double limit, double part) const {
    if (rests) return weight * (side * force_or_psi - limit);
    return -weight * side * force_or_psi / (fresh ? part * part : 1);
  }
};

// The changes within a step of length dt, from values and slopes at its ends.
struct Candidates {
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  double dt = 0;
  std::vector<Candidate> list = {};
  double estimate = infinity;  // about when the first comes
  double reached = infinity;   // a part of the step by which one has come

  void begin(double step) {
    dt = step;
    list.clear();
    estimate = reached = infinity;
  }
  void slides(PetscInt node, double going, double psi0, double psi1, double rate0, double rate1) {
    const double g0 = -going * psi0, g1 = -going * psi1;
    const bool fresh = psi0 == 0, at_end = fresh ? g1 > 0 : g1 >= 0;
    if (!at_end && !(going * rate0 < 0 && going * rate1 > 0)) return;
    examine({node, going, false, fresh, 0}, g0, g1, -going * rate0, -going * rate1, at_end);
  }
  // What the force has beyond the threshold on that side at both ends of the step.
  void rests(PetscInt node, double side, const ValueAndSlope& begin, const ValueAndSlope& end,
             double limit1) {
    examine({node, side, true, false, 0}, begin.value, end.value, begin.slope, end.slope,
            begins(end.value, limit1, end.slope));
  }
  // Likewise under loads, where the release is known, if there is one.
  void rests(PetscInt node, double side, const ValueAndSlope& begin, const ValueAndSlope& end, double limit1,
             const Release& release) {
    if (release.wait <= dt)
      add({node, side, true, false, 0}, release.wait / dt, std::min(release.gains_until / dt, 1.),
          std::max(release.gain * dt, 1e-3 * std::abs(begin.value)));
    else if (begins(end.value, limit1, end.slope))
      add({node, side, true, false, 0}, 1, 1, std::max(end.slope * dt, 1e-3 * std::abs(begin.value)));
  }

 private:
  // g: negative before the change; `at_end`: the change has come by the end of the step
  void examine(const Candidate& c, double g0, double g1, double m0, double m1, bool at_end) {
    if (!at_end && !(m0 > 0 && m1 < 0)) return;
    const CubicBetween g(g0, g1, dt * m0, dt * m1);
    const double until = at_end ? 1 : g.peak();
    if (!at_end && g(until) <= 0) return;
    const double root = g.root(until),
                 slope = std::max(std::abs(g.slope(root)), 1e-3 * std::abs(g(until) - g0));
    add(c, root, until, slope);
  }
  void add(const Candidate& c, double root, double until, double slope) {
    list.push_back(c);
    list.back().weight = 1 / std::max(slope, 1e-300);
    estimate = std::min(estimate, root);
    reached = std::min(reached, until);
  }
};

enum class Found { none, at, too_coarse };
struct Place {
  Found found;
  double part;  // of the step
};

// The largest Candidate::beyond at a part of the step: of all, and of those that began to slip at its start.
struct Furthest {
  double all = -Candidates::infinity, fresh = -Candidates::infinity;
  void take(const Candidate& c, double beyond) {
    all = std::max(all, beyond);
    if (c.fresh) fresh = std::max(fresh, beyond);
  }
};

// The first change within a step. furthest(part), Furthest, is asked last where the change is found.
// too_coarse: a node that began to slip stops again in the same step, or runs backwards at once; what looks
// at ends of steps would not see that it slips. `shortest`: the part of the step below which nobody is to
// see it.
template <class FurthestAt>
Place locate(double estimate, double reached, double shortest, const FurthestAt& furthest) {
  // the last place looked at; the earliest where a change is known to have come
  double evaluated = 0, high = 1;
  Furthest there;
  const auto furthest_at = [&](double part) {
    there = furthest(part);
    evaluated = part;
    if (there.all >= -landing) high = std::min(high, part);
    return std::abs(there.all) <= landing ? 0 : there.all;
  };
  // Where the method's own polynomial does not go beyond, although the cubic does, there is no change but at
  // the end.
  double at_high = furthest_at(reached);
  if (at_high < 0 && reached < 1) at_high = furthest_at(1);
  if (at_high < 0) return {Found::none, 1};
  // While nothing is known below, downwards in growing steps, the first of which takes furthest() for what it
  // nearly is, the distance in parts of the step.
  double part = std::min(estimate, 0.999 * high), value = furthest_at(part);
  for (int round = 1; value > 0 && high >= 1e-9; ++round) {
    at_high = value;
    part = std::max(high / 2, high - std::ldexp(value, round));
    value = furthest_at(part);
  }
  if (value > 0 && there.fresh > -Candidates::infinity) return {Found::too_coarse, 0};
  if (value < 0) {
    if (at_high > 0)
      find_root([&](double s) { return value = furthest_at(s); }, {part, value, high, at_high}, 1e-15 * high);
    if (value != 0 && evaluated != high) furthest_at(high);  // at a jump
  }
  if (there.fresh >= -landing && evaluated > shortest) return {Found::too_coarse, 0};
  return {Found::at, evaluated};
}

// Node k stands at k strides: its psi, its force eta + N D2 psi and its state (nullptr without one). Of a
// slope: psi_t and the rate of the force.
struct StridedNodes {
  const double *psi = nullptr, *force = nullptr, *state = nullptr;
  PetscInt stride = 1;
  double psi_of(PetscInt k) const { return psi[k * stride]; }
  double force_of(PetscInt k) const { return force[k * stride]; }
  double state_of(PetscInt k) const { return state ? state[k * stride] : 0; }
};
// A step of the nodes first, first + 1, ... of the model's local ones, on a ring round it.
struct StepOfNodes {
  double t, dt;
  PetscInt first, count;
  const double* direction;
  StridedNodes begin = {}, begin_slope = {}, end = {}, end_slope = {};
  // Thresholds and their rates at both ends, of nodes that rest, where they are kept from step to step;
  // else nullptr.
  const WithSlope* begin_limit = nullptr;
  WithSlope* end_limit = nullptr;
};

// A node that is to be at its threshold, on that side.
struct NodeLimit {
  PetscInt node;
  double side;
};

}  // namespace stickslip::stick_rule

namespace stickslip {

// Where nodes side by side start and stop: those of a rank, or of what moves alone. All of stick_rule is
// asked here for many nodes, wherever they stand in memory. Local: what is the same on all ranks is reduced
// by who asks.
class StickEvents {
 public:
  explicit StickEvents(const Model& model);

  // Of node i of the model, with its state; the same product as on the right-hand side, so that a node at its
  // threshold is there to the last bit when it begins to slip.
  double threshold(PetscInt i, double state, const NormalLoad& normal = {}) const {
    return normal.N * model_.amplitude()[std::size_t(i)] *
           (has_state_ ? model_.friction_law(i).threshold(state).value : fixed_[std::size_t(i)]);
  }
  // And its rate, while the node rests.
  WithSlope moving_threshold(PetscInt i, double state, const NormalLoad& normal = {}) const;
  // A node that is not held, and has friction; without friction it never rests.
  bool takes_part(PetscInt i) const { return is_free(i) && !never_rests(i); }
  bool is_free(PetscInt i) const { return i >= free_begin_ && i < free_end_; }
  bool never_rests(PetscInt i) const { return is_free(i) && model_.amplitude()[std::size_t(i)] == 0; }
  PetscInt free_begin() const { return free_begin_; }
  PetscInt free_end() const { return free_end_; }

  // In which direction a free node at psi = 0 goes on: 0 where it rests. `none`: see begins().
  double start(double force, double force_rate, const WithSlope& limit, double none = 0) const;
  // At rest from the time on at which the loads begin, one side of it; `rate`: of its force there, of which
  // the plate's part may vary.
  RestingNode resting(PetscInt i, double side, double force, double rate, double state,
                      const LoadsFrom& loads) const;
  LoadsFrom loads_from(double t) const { return loaded_ ? LoadsFrom(model_.scene(), t) : LoadsFrom(); }
  template <class Body>
  void for_each_side(const Body& body) const {
    body(1.);
    if (both_sides_) body(-1.);
  }

  // The changes within the step.
  void find(const stick_rule::StepOfNodes& step, stick_rule::Candidates& found) const;
  // Of the candidates at a part of the step, where the nodes are `there`.
  stick_rule::Furthest furthest(const stick_rule::StepOfNodes& step, const stick_rule::Candidates& candidates,
                                const stick_rule::StridedNodes& there, double part) const;
  // At a part of the step those whose change has come, to round-off, get psi = 0, or are named: their forces
  // are to become their thresholds (put_at()). First every psi, which others may feel.
  // Who stops has the state 0 where that is renewed at stops. psi, state: those of `there`.
  std::vector<stick_rule::NodeLimit> snap(const stick_rule::StepOfNodes& step,
                                          const stick_rule::Candidates& candidates,
                                          const stick_rule::StridedNodes& there, double* psi, double* state,
                                          double part) const;
  // The eta with which the force on a node, eta + besides, is its threshold, from which start() lets it go;
  // not less by round-off.
  static double put_at(double limit, double side, double besides);

 private:
  PetscInt model_node(const stick_rule::StepOfNodes& step, PetscInt k) const {
    const PetscInt i = step.first + k;
    return i < model_.local() ? i : i - model_.local();
  }

  const Model& model_;
  bool has_state_, both_sides_, loaded_;  // loaded_: at rest the plate's velocity or the normal load varies
  PetscInt free_begin_ = 0, free_end_;    // the local nodes that are not held
  std::vector<double> fixed_;             // the laws' thresholds, without a state
};

// How a deviation from a motion passes a start or a stop of one node of friction that sticks: the saltation
// matrix.
//
// A motion u(t) meets g(u) = 0 (a stop: g = psi of the node; a start: g = side eta - threshold(state)), u
// stays and its rates change from `before` to `after`. A motion that deviates by y meets it earlier by (grad
// g . y)/(grad g . before) and goes on at the other rates for so long:
//     y_after = y + (after - before) (grad g . y)/(grad g . before).
// The rates of the other nodes depend on this one's psi alone, which is continuous, so that they do not
// change: only the node's own psi, eta and state do. A deviation of several nodes that start or stop at once
// (alike, so that each would go first in turn) passes the matrix of each of them, in any order. After a stop
// y.psi is 0, and y.state too where a stop renews the state; at a start y.psi is to be 0.
//
// With viscosity between neighbours the force on a node at rest is eta + N D2 psi (stick.hpp): at a start g
// has the share N D2 psi of its neighbours, which move, and whose rates depend on this node's psi, continuous
// still. `neighbour_force` below is that share of what the gradient is applied to. It holds for one node at a
// time, or where nodes start without a jump in psi_t.
//
// Source: R. I. Leine and H. Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, Springer
// 2004. Nothing here communicates or allocates. Rates have the units of the unknowns over time, as stored
// (friction.hpp).
class JumpMatrix {
 public:
  // `dof` (2 or 3) rates of the node: psi, eta and the stored state, right before and right after.
  static JumpMatrix at_stop(int dof, const double* before, const double* after, bool renewed) {
    JumpMatrix jump(dof, {1, 0, 0}, before, after);
    jump.renewed_ = renewed;
    return jump;
  }
  // `side`: of the threshold, 1 or -1; `threshold_slope`: of the threshold in the stored state (0 without a
  // state); `neighbour_force`: N D2 of the nodes' psi_t before, less, under a normal load N(t), `side` times
  // what the threshold gains with time at a state that stands.
  static JumpMatrix at_start(int dof, double side, double threshold_slope, const double* before,
                             const double* after, double neighbour_force = 0) {
    JumpMatrix jump(dof, {0, side, -threshold_slope}, before, after);
    jump.event_rate_ += side * neighbour_force;
    return jump;
  }

  // grad g . before: how fast the motion goes through the event. Not 0, but where it only touches (grazing).
  double event_rate() const { return event_rate_; }
  // The deviation of the node, dof numbers, in place; `neighbour_force`: N D2 of the nodes' deviations in
  // psi, at a start.
  template <class T>
  void apply(T* y, T neighbour_force = 0) const {
    T event = gradient_.at[1] * neighbour_force;
    for (int k = 0; k < dof_; ++k) event += gradient_.at[k] * y[k];
    for (int k = 0; k < dof_; ++k) y[k] += jump_.at[k] / event_rate_ * event;
    if (renewed_) y[2] = 0;
  }
  // dof rows of dof entries, one behind the other.
  void write(double* rows) const {
    for (int i = 0; i < dof_; ++i)
      for (int k = 0; k < dof_; ++k)
        rows[i * dof_ + k] = (i == k ? 1. : 0.) + jump_.at[i] / event_rate_ * gradient_.at[k];
    if (renewed_) std::fill_n(rows + 2 * dof_, dof_, 0.);
  }

 private:
  struct Three {
    double at[3];
  };
  JumpMatrix(int dof, Three gradient, const double* before, const double* after)
      : dof_(dof), gradient_(gradient) {
    for (int k = 0; k < dof; ++k) {
      jump_.at[k] = after[k] - before[k];
      event_rate_ += gradient.at[k] * before[k];
    }
  }

  int dof_;
  Three gradient_, jump_{{0, 0, 0}};
  double event_rate_ = 0;
  bool renewed_ = false;
};

}  // namespace stickslip
