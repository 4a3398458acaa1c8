// The word for a motion (regime.hpp has the rules), from the record of its traces. Plain numbers, no
// communication.
#pragma once

#include <cmath>
#include <optional>

#include "output/traces.hpp"
#include "stickslip/output/regime.hpp"

namespace stickslip {

// What is known of the scene beside the record.
struct SceneContext {
  double v = 0;
  double scale = 1;  // of psi (scales.hpp, velocity)
  std::optional<double> growth;  // of perturbations of sliding, as the steps have it: its sign is certain
  bool stable = false, unstable = false;  // sliding of the scene itself, whatever the steps make of it
  double linear = 0;                      // its growth rate, where one of them is true
  bool unloaded = false;                  // nothing will ever move a medium at rest
  // time until the force on the first node that rests or lags reaches its friction
  double loading = 0;
  double cycle = 0;         // about the longest time between two slips, or the period of an oscillation
  double distance_now = 0;  // largest |psi - steady| of all nodes at the end
  double speed_now = 0;     // largest |psi|
  double forcing = 0;       // period of the load; 0: none
  bool sticks = false;      // friction may hold a node at psi = 0
};

struct Judgement {
  Motion motion = Motion::undecided;
  std::optional<double> rate, time_to_decide;
  std::optional<double> period;  // where the motion repeats
  double period_error = 0;       // as its passages tell
  // of forward psi, over the last period; the last quarter where it has none
  double low = HUGE_VAL, high = -HUGE_VAL;
};

Judgement judge(const MotionRecord& record, const SceneContext& around);

}  // namespace stickslip
