// Tables of collocation methods. Local to the process.
//
// Source: E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, sections IV.5 and IV.8.
#pragma once

#include <vector>

namespace stickslip {

// Collocation at c_1 < ... < c_s in [0, 1]: a_ij is the integral of the Lagrange polynomial l_j over
// [0, c_i], b_j that over [0, 1]; a is row-major.
struct Tableau {
  int s;
  std::vector<double> c, a, b;
  static Tableau gauss(int s);  // order 2 s, symmetric
  static Tableau radau(int s);  // Radau IIA: order 2 s - 1, stiffly accurate
};

}  // namespace stickslip
