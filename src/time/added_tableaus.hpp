// Explicit Runge-Kutta methods that the library lacks.
#pragma once

#include <vector>

#include "stickslip/time/methods.hpp"

namespace stickslip {

// Type rk, the name of the tableau, and what else the table of methods holds; with the tableau, s stages.
struct AddedTableau {
  Method method;
  std::vector<double> A;  // s x s, row-major, below its diagonal
  std::vector<double> b;  // weights of the step
  // weights of the pair's other step, for the error estimate; none: fixed steps only
  std::vector<double> embedded;
};

std::vector<AddedTableau> added_tableaus();

}  // namespace stickslip
