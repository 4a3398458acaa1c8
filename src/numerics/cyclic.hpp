// Linear chains that close on themselves: y_{i+1} = Phi_i y_i + r_i, i = 0..N-1, y_N = bloch_phase y_0.
//
// Eliminated from the left by orthogonal transformations of two block rows at a time, which is stable whether
// the Phi grow or shrink, in O(N d^3). T is double or std::complex<double>. Arrays of small matrices are
// row-major. Local to the process.
#pragma once

#include <Eigen/QR>
#include <vector>

#include "numerics/matrix.hpp"

namespace stickslip {

template <class T>
class CyclicChain {
 public:
  // Phi: N matrices of d x d.
  CyclicChain(int d, std::size_t N, const std::vector<T>& phi)
      : d_(d), n_(N), first_(-as_matrix(phi.data(), d, d)), last_(Matrix<T>::Identity(d, d)) {
    for (std::size_t k = 1; k < N; ++k) {
      Matrix<T> rows = Matrix<T>::Zero(2 * d, 3 * d);  // of y_k | y_0 | y_{k+1}
      rows.topLeftCorner(d, 2 * d) << last_, first_;
      rows.bottomLeftCorner(d, d) = -as_matrix(&phi[k * d * d], d, d);
      rows.bottomRightCorner(d, d).setIdentity();
      transforms_.emplace_back(rows.leftCols(d));
      rows.applyOnTheLeft(transforms_.back().householderQ().adjoint());
      rows_.push_back(rows.topRows(d));
      first_ = rows.block(d, d, d, d);
      last_ = rows.bottomRightCorner(d, d);
    }
  }

  // The d x d matrix of the relation that is left, first y_0 + last y_N = rhs, closed by y_N = bloch_phase
  // y_0.
  Matrix<T> closure(T bloch_phase) const { return first_ + bloch_phase * last_; }
  const Matrix<T>& first() const { return first_; }
  const Matrix<T>& last() const { return last_; }

  // Eliminates in `columns` right-hand sides (rhs[(i d + a) columns + col], destroyed); returns the d x
  // columns right-hand side of the closure.
  Matrix<T> reduce(int columns, std::vector<T>& rhs) const {
    auto all = as_matrix(rhs.data(), n_ * d_, columns);
    Matrix<T> both(2 * d_, columns);
    both.bottomRows(d_) = all.topRows(d_);
    for (Eigen::Index k = 1; k < n_; ++k) {
      both.topRows(d_) = both.bottomRows(d_).eval();
      both.bottomRows(d_) = all.middleRows(k * d_, d_);
      both.applyOnTheLeft(transforms_[k - 1].householderQ().adjoint());
      all.middleRows(k * d_, d_) = both.topRows(d_);
    }
    return both.bottomRows(d_);
  }

  // From y_0 and the phase, y_0..y_{N-1}, one behind the other, for the combination of the reduced columns
  // with weights w.
  std::vector<T> expand(int columns, const std::vector<T>& reduced, const T* w, const T* y0,
                        T bloch_phase) const {
    std::vector<T> y(n_ * d_);
    auto all = as_matrix(y.data(), n_, d_);
    all.row(0) = as_matrix(y0, 1, d_);
    Matrix<T> known(2 * d_, 1);  // y_0, and y_{k+1}
    known << all.row(0).transpose(), bloch_phase * all.row(0).transpose();
    for (Eigen::Index k = n_; k-- > 1;) {
      const Matrix<T>& rows = rows_[k - 1];
      known.bottomRows(d_) = rows.leftCols(d_).template triangularView<Eigen::Upper>().solve(
          as_matrix(&reduced[k * d_ * columns], d_, columns) * as_matrix(w, columns, 1) -
          rows.rightCols(2 * d_) * known);
      all.row(k) = known.bottomRows(d_).transpose();
    }
    return y;
  }

 private:
  Eigen::Index d_, n_;
  std::vector<Eigen::HouseholderQR<Matrix<T>>> transforms_;
  std::vector<Matrix<T>> rows_;  // of y_k, upper triangular, y_0 and y_{k+1}
  Matrix<T> first_, last_;
};

}  // namespace stickslip
