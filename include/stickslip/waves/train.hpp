// Travelling trains of pulses: psi(x, t) = f(t - x/V), periodic, as a boundary-value problem.
//
// Unknown are one period of (f, z[, s]) (see model/oscillator.hpp) and one number: the period T where the
// speed V is given, or V where the length L = n V T of a ring with n pulses is given. In phase p = t/T,
//     y' = T rhs(y; r2),  y(1) = y(0),  f(0) = v with f' > 0,
// a case of the periodic problem of numerics/periodic_equations.hpp on a mesh that follows the fronts.
// V/c - 1 is carried as ln sqrt(V^2 - c^2), so that it keeps all digits when V comes near c.
//
// Everything here is computed alike on every rank.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/model/oscillator.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/continuation.hpp"

namespace stickslip {

// Which train: n pulses, and exactly one of the ring's length and the speed (its sign is the direction).
struct TrainRequest {
  PetscInt pulses = 1;
  std::optional<double> length, speed;
};

struct TrainCase {
  Scene scene;
  TrainRequest request;
};

// A train that solves the boundary-value problem; psi(x, t) = f(t - x/V) by its phase, period and r2 = 1 -
// c^2/V^2.
struct Train : PeriodicMotion {
  PetscInt pulses = 1;
  double speed = 0, length = 0;
  double psi_min = 0, psi_max = 0;
  double residual = 0;  // largest residual of the collocation equations, in units of psi and eta
  // of the speed or the length, whichever was solved for; absolute, not below round-off
  double error_estimate = 0;
  bool length_given = true;
};

// psi_min and psi_max from the values.
void find_extrema(Train& train);

// Finds the train from nothing. `tolerance`: relative, for the unknown number. Throws UsageError (|speed| <=
// c) and Failure (none exists; the text says why and gives the bound).
Train solve_train(const Scene& scene, const TrainRequest& request, double tolerance = 1e-10);

// The length below which no train of large amplitude fits a pulse: V T as V -> c. In closed form for the
// cubic law without a state; NaN otherwise, where it takes an orbit at V = c to say
// (and there may be none).
double shortest_pulse(const Scene& scene);

// Throws UsageError where the scene cannot carry a smooth train (chain, spread, viscosity between
// neighbours, a law that jumps).
void check_train_scene(const Scene& scene);

// Branches of trains: how a train changes with one parameter of its scene or of what is asked of it.
//
// Pseudo-arclength continuation (H. B. Keller, in Applications of Bifurcation Theory, Academic Press 1977,
// 359-384) in (z(0), q, the parameter) with q = ln T or ln sqrt(V^2 - c^2): round folds, and through the
// canard explosion, where the parameter hardly changes. Computed alike on every rank.

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
