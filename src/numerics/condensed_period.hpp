// The linear equations of one period, closed on themselves, and what they are eliminated with.
#pragma once

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

// Small dense matrices by Eigen, and row-major arrays seen as such. For sources only: Eigen takes long to
// compile.
template <class T>
using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <class T>
Eigen::Map<Matrix<T>> as_matrix(T* rows, Eigen::Index count, Eigen::Index columns) {
  return {rows, count, columns};
}
template <class T>
Eigen::Map<const Matrix<T>> as_matrix(const T* rows, Eigen::Index count, Eigen::Index columns) {
  return {rows, count, columns};
}

// Linear chains that close on themselves: y_{i+1} = Phi_i y_i + r_i, i = 0..N-1, y_N = bloch_phase y_0.
//
// Eliminated from the left by orthogonal transformations of two block rows at a time, which is stable whether
// the Phi grow or shrink, in O(N d^3). T is double or std::complex<double>. Arrays of small matrices are
// row-major. Local to the process.
template <class T>
class CyclicChain {
 public:
  // Phi: N matrices of d x d.
  CyclicChain(int d, std::size_t N, const std::vector<T>& phi);
  // The d x d matrix of the relation that is left, first y_0 + last y_N = rhs, closed by y_N = bloch_phase
  // y_0.
  Matrix<T> closure(T bloch_phase) const { return first_ + bloch_phase * last_; }
  const Matrix<T>& first() const { return first_; }
  const Matrix<T>& last() const { return last_; }
  // Eliminates in `columns` right-hand sides (rhs[(i d + a) columns + col], destroyed); returns the d x
  // columns right-hand side of the closure.
  Matrix<T> reduce(int columns, std::vector<T>& rhs) const;
  // From y_0 and the phase, y_0..y_{N-1}, one behind the other, for the combination of the reduced columns
  // with weights w.
  std::vector<T> expand(int columns, const std::vector<T>& reduced, const T* w, const T* y0,
                        T bloch_phase) const;

 private:
  Eigen::Index d_, n_;
  struct Reflections {  // of two block rows, d of them: I - tau v v^*, v = (1, what is below the diagonal)
    Matrix<T> v;        // 2d x d
    std::vector<T> tau;
    void apply(Matrix<T>& rows) const;
  };
  std::vector<Reflections> transforms_;
  std::vector<Matrix<T>> rows_;  // of y_k, upper triangular, y_0 and y_{k+1}
  Matrix<T> first_, last_;
};

// The linear collocation equations of one period with parameters, interval by interval
//     Y_j - y_i - h sum_k a_jk (J_k Y_k + slopes by the parameters) = right-hand side,
//     y_{i+1} - (the polynomial through y_i and Y at the right end) = right-hand side,
// y_N = y_0, closed by as many conditions on (y_0, parameters) as there are parameters.
//
// The Gauss points of each interval are eliminated first, then the nodes, in groups, by orthogonal
// transformations from the left (CyclicChain), which is stable however strongly deviations grow or decay on
// the way. Source: U. M. Ascher, R. M. M. Mattheij, R. D. Russell, Numerical Solution of Boundary Value
// Problems, SIAM 1995, chapter 7. Local to the process.

// Intervals in groups within which nothing grows by much, and the product of their d x d matrices over each.
template <class T>
struct IntervalGroups {
  std::vector<std::size_t> begin;  // first interval of each, and the number of intervals
  std::vector<T> products;
  std::size_t count() const { return begin.size() - 1; }

  IntervalGroups(int d, const std::vector<T>& matrices) {
    constexpr double most = 1e3;  // before the digits that it costs are felt
    const std::size_t dd = d * d, n = matrices.size() / dd;
    double growth = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto here = as_matrix(&matrices[i * dd], d, d);
      const double norm = std::max(1., here.cwiseAbs().rowwise().sum().maxCoeff());
      if (i == 0 || growth * norm > most) {
        begin.push_back(i);
        products.insert(products.end(), here.data(), here.data() + dd);
        growth = norm;
      } else {
        auto product = as_matrix(&products[products.size() - dd], d, d);
        product = here * product;
        growth *= norm;
      }
    }
    begin.push_back(n);
  }
};

// The stage equations of an interval, as solve_stages() of periodic_equations.hpp.
void solve_stages(const Collocation& method, int d, int band, double h, const double* J, Matrix<double>& R);

// d x columns: the value at the right end of stage values R, beside that at the left end.
Matrix<double> at_end(const Collocation& method, int d, const Matrix<double>& R);

class CondensedPeriod {
 public:
  CondensedPeriod(int d, int parameters) : d_(d), p_(parameters) {}

  // The next interval, of length h: J at its Gauss points, d x d each, of half band `band`; R: the right-hand
  // sides of its stages for y at the left node, for each parameter and of the equations, in columns; end: the
  // right-hand side of the right node. Throws Failure where it is singular.
  void add(double h, int band, const double* J, Matrix<double> R, const Matrix<double>& end);
  // With the conditions `rows` and their right-hand sides: y at the left node and the Gauss points of each
  // interval, then the parameters. Throws Failure where the equations are singular.
  std::vector<double> solve(const Matrix<double>& rows, const std::vector<double>& rights) const;

 private:
  int d_, p_;
  std::vector<Matrix<double>> response_, chain_;  // of the Gauss points, all columns; of the right node
  std::vector<double> phi_;                       // y at the right node, for y at the left one
};

}  // namespace stickslip
