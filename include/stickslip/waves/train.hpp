// Travelling trains of pulses: psi(x, t) = f(t - x/V), periodic, as a boundary-value problem.
//
// Unknown are one period of (f, z[, s]) (see ode.hpp) and one number: the period T where the speed V is given, or V
// where the length L = n V T of a ring with n pulses is given. In phase p = t/T,
//     y' = T rhs(y; r2),  y(1) = y(0),  f(0) = v with f' > 0,
// by collocation at five Gauss points an interval on a mesh that follows the fronts; Newton's method by SNES, each
// step one elimination of cost O(mesh) by orthogonal transformations. V/c - 1 is carried as
// ln sqrt(V^2 - c^2), so that it keeps all digits when V comes near c.
//
// Everything here is computed alike on every rank; only SNES on PETSC_COMM_SELF is used.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "stickslip/waves/oscillator.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// Which train: n pulses, and exactly one of the ring's length and the speed (its sign is the direction).
struct TrainRequest {
  PetscInt pulses = 1;
  std::optional<double> length, speed;
  bool library_options = false;  // does SNES listen to the user's -snes_ options?
};

// A train that solves the boundary-value problem.
struct Train {
  PetscInt pulses = 1;
  double speed = 0, length = 0, period = 0;
  double r2 = 0;              // 1 - c^2/V^2
  double psi_min = 0, psi_max = 0;
  double residual = 0;        // largest residual of the collocation equations, in units of psi and eta
  double error_estimate = 0;  // of the speed or the length, whichever was solved for; absolute, not below round-off
  double profile_error = 0;   // estimate of the largest error of psi over the profile
  bool length_given = true;

  std::shared_ptr<const Oscillator> oscillator;
  std::vector<double> mesh;    // 0 = mesh[0] < ... < mesh[N] = 1: phases
  std::vector<double> nodes;   // N points of dim values: y at mesh[i]
  std::vector<double> stages;  // N x 5 points: y at the Gauss points of interval i

  size_t intervals() const { return mesh.size() - 1; }
  // y = (f, z[, s]) at a phase.
  void at(double phase, double* y) const;
  double psi_at(double phase) const;
  double eta_at(double phase) const;
  double state_at(double phase) const;  // as stored
};

// Points of collocation of a train: Gauss, five an interval; and 0 followed by them, for interpolation.
const Tableau& train_tableau();
const Lagrange& train_dense();

// Finds the train from nothing. `tolerance`: relative, for the unknown number. Throws UsageError (|speed| <= c) and
// Failure (none exists; the text says why and gives the bound).
Train solve_train(const Scene& scene, const TrainRequest& request, double tolerance = 1e-10);

// Solves again from a train nearby, on its mesh, adapted first where `adapt`.
Train correct_train(const Scene& scene, const TrainRequest& request, const Train& guess, bool adapt);

// The length below which no train of large amplitude fits a pulse: V T as V -> c. In closed form for the cubic law,
// without a state; NaN otherwise, where it takes an orbit at V = c to say (and there may be none).
double shortest_pulse(const Scene& scene);

// Throws UsageError where the scene cannot carry a smooth train (chain, spread, a law that jumps).
void check_train_scene(const Scene& scene);

}  // namespace stickslip
