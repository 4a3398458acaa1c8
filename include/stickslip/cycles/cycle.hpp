// Periodic oscillations (cycles) of a cell of nodes: what is known of one, whatever method found it.
//
// A cell is one node (uniform motion), m nodes that repeat round a ring, or a whole scene. Its unknowns stand
// node by node as in Model: psi, eta and, with a state law, the stored state (friction.hpp). psi is a
// velocity, eta a number, times have the unit of time. Nothing here communicates.
#pragma once

#include <petscsys.h>

#include <complex>
#include <map>
#include <string>
#include <vector>

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

  double psi_min = 0, psi_max = 0;  // over the nodes and one period
  double amplitude = 0;             // half the largest range of psi at a node, as `run` has it
  double rest_fraction = 0;         // of the time, mean over the nodes
  double force_drop = 0;            // largest less least mean of eta over the nodes
  double residual = 0;              // of the equations, in units of psi and eta
  double error_estimate = 0;        // of the period, relative; not below round-off
  // Functions whose change of sign along a branch is a special point of that name, e.g. `graze`; beside those
  // that follow from the multipliers (branch.hpp).
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

}  // namespace stickslip
