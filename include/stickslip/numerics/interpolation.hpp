// Interpolation by polynomials: through given points, and locally on a uniform grid. Local to the process.
//
// Source: J.-P. Berrut and L. N. Trefethen, Barycentric Lagrange interpolation, SIAM Review 46 (2004)
// 501-517.
#pragma once

#include <petscsys.h>

#include <cstddef>
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

}  // namespace stickslip
