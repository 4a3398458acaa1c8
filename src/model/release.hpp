// When a node at rest begins to slip. Its force changes with the plate and as its neighbours have it, its
// threshold with its state and with the normal load; all of this is known ahead, so that the first time at
// which the force comes up to the threshold is enclosed and found, however short it stays beyond it.
#pragma once

#include <limits>

#include "numerics/first_rise.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/model.hpp"

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
