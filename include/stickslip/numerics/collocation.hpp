// Tables of collocation methods. Local to the process.
//
// Source: E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, sections IV.5 and IV.8.
#pragma once

#include <vector>

#include "stickslip/numerics/interpolation.hpp"

namespace stickslip {

// Collocation at c_1 < ... < c_s in [0, 1]: a_ij is the integral of the Lagrange polynomial l_j over
// [0, c_i], b_j that over [0, 1]; a is row-major.
struct Tableau {
  int s;
  std::vector<double> c, a, b;
  static Tableau gauss(int s);  // order 2 s, symmetric
  static Tableau radau(int s);  // Radau IIA: order 2 s - 1, stiffly accurate
};

// A method with the polynomial of its solution in a step, through the value at 0 and those at the s points.
struct Collocation : Tableau {
  Lagrange basis;           // on 0, c_1 ... c_s
  std::vector<double> end;  // its s + 1 weights at 1
  std::vector<double> a2;   // a a: of integrals of integrals
  explicit Collocation(const Tableau& tableau);
  static const Collocation& gauss5();
  static const Collocation& radau5();
};

// The matrix 1 - h a (x) J of the stages of a linear system, s d rows: J holds the s Jacobians, d x d each.
// All row-major.
template <class T>
void stage_matrix(const Tableau& t, int d, double h, const T* J, T* matrix) {
  for (int i = 0; i < t.s; ++i)
    for (int p = 0; p < d; ++p)
      for (int j = 0; j < t.s; ++j)
        for (int q = 0; q < d; ++q)
          *matrix++ =
              (i == j && p == q ? 1. : 0.) - h * t.a[i * t.s + j] * J[(j * d + p) * d + q];
}

}  // namespace stickslip
