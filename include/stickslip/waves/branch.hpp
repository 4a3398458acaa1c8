// Branches of trains: how a train changes with one parameter of its scene or of what is asked of it.
//
// Pseudo-arclength continuation (H. B. Keller, in Applications of Bifurcation Theory, Academic Press 1977,
// 359-384) in (z(0), q, the parameter) with q = ln T or ln sqrt(V^2 - c^2): round folds, and through the
// canard explosion, where the parameter hardly changes. Computed alike on every rank.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stickslip/numerics/continuation.hpp"
#include "stickslip/waves/train.hpp"

namespace stickslip {

// What a train is asked of, as a function of a parameter. `at` may throw Failure or UsageError where there is
// nothing; the branch ends before.
struct TrainFamily {
  std::string name;  // of the parameter, for messages
  std::function<TrainCase(double)> at;
};

// One point of a branch of trains. `fold`: the parameter turned round between the point before and this one.
struct BranchPoint {
  double value;
  Train train;
  bool fold;
};
struct Branch {
  std::vector<BranchPoint> points;
  std::vector<SpecialPoint> special;  // folds; the Hopf point
  std::string end;  // why it ends, in words
};

// Follows the train of the family from one value of its parameter towards another, in at most `steps` steps.
// Ends at `to`; where the amplitude vanishes (the Hopf point of uniform sliding, whose value is added to
// `end`); where the parameter comes back past its start; after `steps`. Throws Failure for a parameter that
// does not enter.
Branch continue_train(const TrainFamily& family, double from, double to, int steps);

// The train at a fold of its branch.
const Train& train_at(const SpecialPoint& point);

}  // namespace stickslip
