// Kinks of the equations along a periodic motion: where a velocity passes 0 and the rates, which contain
// |psi|, turn a corner; or where it passes from one piece of friction into the next.
//
// Inside an interval of collocation a kink costs all but the second order, and halving the interval says
// little of what is left, for that hangs on where in the interval it lies. With a node at the kink both sides
// are smooth. Local to the process.
#pragma once

#include <functional>
#include <vector>

namespace stickslip {

// Where kinks may be: unknowns that are velocities, and where beside 0 pieces of friction meet.
struct Joints {
  std::vector<int> velocities;
  std::vector<double> levels;
};

struct Kinks {
  std::vector<double> phases;  // rising
  // the Jacobian grows beyond bounds there, as psi ln|psi| makes it: of second order with a node too
  bool singular = false;

  // The farthest of them from the nearest node of a mesh.
  double farthest_off(const std::vector<double>& mesh) const;
};

// Of the motion x on a mesh (d values; numerics/periodic_mesh.hpp): where a velocity passes a level; and 0,
// if the Jacobian of the rates differs on its sides. Pieces so short that more levels are passed than the
// mesh has intervals are left alone: what they do to a solution is as small as they are.
Kinks kinks_of(const std::vector<double>& mesh, const double* x, int d, const Joints& joints,
               const std::function<void(const double* y, double* J)>& jacobian);

// The mesh with a node at each kink: the nearest moved there where it is near, else one more.
std::vector<double> with_nodes(std::vector<double> mesh, const Kinks& kinks);

}  // namespace stickslip
