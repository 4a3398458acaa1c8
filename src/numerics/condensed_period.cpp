
#include "numerics/condensed_period.hpp"

#include <complex>

#include <Eigen/Householder>
#include <Eigen/LU>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

Matrix<double> at_end(const Collocation& method, int d, const Matrix<double>& R) {
  Matrix<double> sum = Matrix<double>::Zero(d, R.cols());
  for (int j = 0; j < method.s; ++j) sum += method.end[j + 1] * R.middleRows(j * d, d);
  return sum;
}

// Elimination that takes no memory anew: of full blocks, and within the band of wide ones.
void solve_stages(const Collocation& method, int d, int band, double h, const double* J, Matrix<double>& R) {
  const int s = method.s, n = d * s;
  Matrix<double> M = Matrix<double>::Zero(n, n);
  bool solved = true;
  if (2 * band + 1 >= d) {
    stage_matrix(method, d, h, J, M.data());
    solved = solve_dense(n, M.data(), int(R.cols()), R.data());
  } else {  // unknown by unknown, the stages together: a band
    Matrix<double> ordered(n, R.cols());
    for (int p = 0; p < d; ++p)
      for (int i = 0; i < s; ++i) {
        ordered.row(p * s + i) = R.row(i * d + p);
        M(p * s + i, p * s + i) = 1;
        for (int q = std::max(0, p - band); q < std::min(d, p + band + 1); ++q)
          for (int j = 0; j < s; ++j)
            M(p * s + i, q * s + j) -= h * method.a[i * s + j] * J[(j * d + p) * d + q];
      }
    solved = solve_banded(n, s * (band + 1) - 1, M.data(), int(R.cols()), ordered.data());
    for (int p = 0; p < d; ++p)
      for (int i = 0; i < s; ++i) R.row(i * d + p) = ordered.row(p * s + i);
  }
  if (!solved) throw Failure("the collocation equations of an interval are singular");
}

void CondensedPeriod::add(double h, int band, const double* J, Matrix<double> R, const Matrix<double>& end) {
  const Collocation& gauss = Collocation::gauss5();
  solve_stages(gauss, d_, band, h, J, R);
  Matrix<double> at = at_end(gauss, d_, R);
  at.col(d_ + p_) += end;
  const Matrix<double> phi = at.leftCols(d_) + gauss.end[0] * Matrix<double>::Identity(d_, d_);
  phi_.insert(phi_.end(), phi.data(), phi.data() + phi.size());
  chain_.push_back(at.rightCols(p_ + 1));
  response_.push_back(std::move(R));
}

// The nodes in groups, y_0 and the parameters with the conditions, then everything inside.
std::vector<double> CondensedPeriod::solve(const Matrix<double>& rows,
                                           const std::vector<double>& rights) const {
  const int d = d_, p = p_;
  const std::size_t block = d * (mesh_stages + 1), end = response_.size() * block;
  const auto phi = [&](std::size_t i) { return as_matrix(&phi_[i * d * d], d, d); };
  const IntervalGroups<double> groups(d, phi_);
  std::vector<double> reduced(groups.count() * d * (p + 1));
  for (std::size_t g = 0; g < groups.count(); ++g) {
    auto sum = as_matrix(&reduced[g * d * (p + 1)], d, p + 1);
    for (std::size_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i)
      sum = (phi(i) * sum + chain_[i]).eval();
  }
  const CyclicChain<double> cyclic(d, groups.count(), groups.products);
  const Matrix<double> right = cyclic.reduce(p + 1, reduced);
  Matrix<double> S(d + p, d + p), z(d + p, 1);
  S << cyclic.closure(1.), -right.leftCols(p), rows;
  z << right.col(p), as_matrix(rights.data(), p, 1);
  z = S.partialPivLu().solve(z).eval();
  if (!z.allFinite()) throw Failure("the periodic equations are singular");
  Matrix<double> w = Matrix<double>::Ones(p + 1, 1);
  w.topRows(p) = z.bottomRows(p);
  std::vector<double> x(end + p);
  std::copy_n(w.data(), p, &x[end]);
  const std::vector<double> nodes = cyclic.expand(p + 1, reduced, w.data(), z.data(), 1.);
  for (std::size_t g = 0; g < groups.count(); ++g) {
    Matrix<double> yw(d + p + 1, 1);  // y at the left node, the parameters, 1
    yw << as_matrix(&nodes[g * d], d, 1), w;
    for (std::size_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i) {
      std::copy_n(yw.data(), d, &x[i * block]);
      as_matrix(&x[i * block + d], mesh_stages * d, 1) = response_[i] * yw;
      yw.topRows(d) = (phi(i) * yw.topRows(d) + chain_[i] * w).eval();
    }
  }
  return x;
}

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
