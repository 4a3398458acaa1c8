#include "numerics/cyclic.hpp"

#include <Eigen/Householder>
#include <complex>

namespace stickslip {

template <class T>
CyclicChain<T>::CyclicChain(int d, std::size_t N, const std::vector<T>& phi)
    : d_(d), n_(N), first_(-as_matrix(phi.data(), d, d)), last_(Matrix<T>::Identity(d, d)) {
  for (std::size_t k = 1; k < N; ++k) {
    Matrix<T> rows = Matrix<T>::Zero(2 * d, 3 * d);  // of y_k | y_0 | y_{k+1}
    rows.topLeftCorner(d, 2 * d) << last_, first_;
    rows.bottomLeftCorner(d, d) = -as_matrix(&phi[k * d * d], d, d);
    rows.bottomRightCorner(d, d).setIdentity();
    Reflections here{{}, std::vector<T>(d)};
    std::vector<T> room(3 * d);
    for (int j = 0; j < d; ++j) {
      double diagonal;
      rows.col(j).tail(2 * d - j).makeHouseholderInPlace(here.tau[j], diagonal);
      rows(j, j) = diagonal;
      rows.bottomRightCorner(2 * d - j, 3 * d - j - 1)
          .applyHouseholderOnTheLeft(rows.col(j).tail(2 * d - j - 1), here.tau[j], room.data());
    }
    here.v = rows.leftCols(d);
    transforms_.push_back(std::move(here));
    rows_.push_back(rows.topRows(d));
    first_ = rows.block(d, d, d, d);
    last_ = rows.bottomRightCorner(d, d);
  }
}

template <class T>
void CyclicChain<T>::Reflections::apply(Matrix<T>& rows) const {
  std::vector<T> room(rows.cols());
  const Eigen::Index d = v.cols();
  for (Eigen::Index j = 0; j < d; ++j)
    rows.bottomRows(2 * d - j).applyHouseholderOnTheLeft(v.col(j).tail(2 * d - j - 1), tau[j], room.data());
}

template <class T>
Matrix<T> CyclicChain<T>::reduce(int columns, std::vector<T>& rhs) const {
  auto all = as_matrix(rhs.data(), n_ * d_, columns);
  Matrix<T> both(2 * d_, columns);
  both.bottomRows(d_) = all.topRows(d_);
  for (Eigen::Index k = 1; k < n_; ++k) {
    both.topRows(d_) = both.bottomRows(d_).eval();
    both.bottomRows(d_) = all.middleRows(k * d_, d_);
    transforms_[k - 1].apply(both);
    all.middleRows(k * d_, d_) = both.topRows(d_);
  }
  return both.bottomRows(d_);
}

template <class T>
std::vector<T> CyclicChain<T>::expand(int columns, const std::vector<T>& reduced, const T* w, const T* y0,
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

template class CyclicChain<double>;
template class CyclicChain<std::complex<double>>;

}  // namespace stickslip
