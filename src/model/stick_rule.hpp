// The rule of friction that sticks (stick.hpp), of one node: whether it begins to slip or stops, and where in
// a step. What walks over nodes, of a whole model or of what moves alone, asks here.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <petscsystypes.h>

#include "model/release.hpp"
#include "numerics/first_rise.hpp"
#include "numerics/hermite.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip::stick_rule {

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

}  // namespace stickslip::stick_rule
