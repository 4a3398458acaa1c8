// Interpolation by polynomials: through given points, and locally on a uniform grid. Local to the process.
//
// Source: J.-P. Berrut and L. N. Trefethen, Barycentric Lagrange interpolation, SIAM Review 46 (2004)
// 501-517.
#pragma once

#include <petscsys.h>

#include <cstddef>
#include <optional>
#include <utility>
#include <vector>

namespace stickslip {

// The polynomial of degree n - 1 through the values at n distinct points, anywhere.
class Lagrange {
 public:
  explicit Lagrange(std::vector<double> points);
  // n weights, so that the interpolant at `at` is sum weights[i] value[i]; its derivative likewise. Outside
  // the points the polynomial is continued.
  void weights(double at, double* weights) const;
  void derivative_weights(double at, double* weights) const;
  // The interpolant of these values, and its derivative.
  double value(const double* values, double at) const { return sum(&Lagrange::weights, values, at); }
  double slope(const double* values, double at) const {
    return sum(&Lagrange::derivative_weights, values, at);
  }
  // sum leading()[i] value[i] is the coefficient of the highest power: the divided difference over all
  // points.
  const std::vector<double>& leading() const { return leading_; }
  const std::vector<double>& points() const { return points_; }

 private:
  double sum(void (Lagrange::*weigh)(double, double*) const, const double* values, double at) const;

  std::vector<double> points_, leading_;
};

// How a stencil that would reach beyond an end of a grid keeps inside.
enum class GridEnd {
  periodic,   // node n is node 0 (both ends or neither)
  one_sided,  // the stencil is shifted inwards
  mirrored    // node -i is node i: an even function
};

// The `count` nodes around `at` (in units of the spacing from node 0; 0 <= at <= n - 1, on a ring 0 <= at <=
// n) with the weights of their interpolating polynomial, of degree count - 1 and centred as well as it can
// be: sum weight value[node] is the interpolant. One node alone, of weight 1, where `at` is one to round-off.
// At most n nodes are taken (mirrored: a node may stand there twice).
std::vector<std::pair<PetscInt, double>> grid_interpolation(PetscInt n, GridEnd left, GridEnd right,
                                                            int count, double at);

// Where the parameter of a branch goes to as the period grows without bound.
//
// With T the period, the parameter lambda differs from its limit by powers of T (1/T where loading takes ever
// longer, 1/T^2 where a place of rest is born on the cycle, and higher ones that go with them) or by
// exp(-T/...) (where the cycle passes a place of rest ever nearer). At T, T/r, T/r^2, ... the powers are
// geometric sequences, which Wynn's epsilon algorithm sums whatever the powers are, and the exponentials have
// died out.
//
// Source: P. Wynn, On a device for computing the e_m(S_n) transformation, MTAC 10 (1956) 91. Local to the
// process.
struct InfinitePeriodLimit {
  double value, error;
};
// Of the points of a branch, the last of which has the largest period of all behind the last turn of the
// period. Nothing where these do not span a factor of ten or the parameter does not settle.
std::optional<InfinitePeriodLimit> infinite_period_limit(const std::vector<double>& periods,
                                                         const std::vector<double>& values);

// Tables of collocation methods. Local to the process.
//
// Source: E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, sections IV.5 and IV.8.

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
