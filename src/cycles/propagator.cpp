#include "cycles/propagator.hpp"

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/dense.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

using std::size_t;

// Columns of the stages: y at the beginning, then u_a at each point in turn.
IntervalPropagator::IntervalPropagator(const Collocation& method, int d, int band, double h, const double* J,
                                       const LowRankCoupling& feed)
    : d_(size_t(d)), r_(feed.of.size()), points_(mesh_stages), end_(d_ * d_), end_of_u_(d_ * r_ * points_),
      psi_(r_ * points_ * d_), psi_of_u_(r_ * points_ * r_ * points_) {
  const size_t s = points_, fed = r_ * s, columns = d_ + fed;
  std::vector<double> R(s * d_ * columns);
  for (size_t j = 0; j < s; ++j)
    for (size_t p = 0; p < d_; ++p) {
      double* row = &R[(j * d_ + p) * columns];
      row[p] = 1;
      for (size_t a = 0; a < r_; ++a)
        for (size_t k = 0; k < s; ++k) row[d_ + a * s + k] = h * method.a[j * s + k] * feed.into[a][p];
    }
  solve_stages(method, d, band, h, J, int(columns), R);
  for (size_t p = 0; p < d_; ++p) {
    for (size_t l = 0; l < columns; ++l) {
      double sum = l == p ? method.end[0] : 0;
      for (size_t j = 0; j < s; ++j) sum += method.end[j + 1] * R[(j * d_ + p) * columns + l];
      (l < d_ ? end_[p * d_ + l] : end_of_u_[p * fed + l - d_]) = sum;
    }
  }
  for (size_t b = 0; b < r_; ++b)
    for (size_t j = 0; j < s; ++j)
      for (size_t m = 0; m < feed.width; ++m) {
        const double by = feed.by.empty() ? 1 : feed.by[(j * r_ + b) * feed.width + m];
        const double* row = &R[(j * d_ + feed.of[b] + m) * columns];
        for (size_t l = 0; l < d_; ++l) psi_[(b * s + j) * d_ + l] += by * row[l];
        for (size_t l = 0; l < fed; ++l) psi_of_u_[(b * s + j) * fed + l] += by * row[d_ + l];
      }
}

IntervalPropagator::IntervalPropagator(int d, std::vector<double> matrix, const LowRankCoupling& feed)
    : d_(size_t(d)), r_(feed.of.size()), points_(1), end_(std::move(matrix)), end_of_u_(d_ * r_),
      psi_(r_ * d_), psi_of_u_(r_ * r_) {
  for (size_t a = 0; a < r_; ++a) {
    for (size_t p = 0; p < d_; ++p) end_of_u_[p * r_ + a] = feed.into[a][p];
    psi_[a * d_ + feed.of[a]] = 1;
  }
}

// With z = psi_b at the points: z = psi y + psi_of_u (w x 1) z, and the end is end y + end_of_u (w x 1) z.
template <class T>
void IntervalPropagator::carry(const T* w, std::vector<T>& matrices) const {
  const size_t s = points_, fed = r_ * s, first = matrices.size();
  matrices.insert(matrices.end(), end_.begin(), end_.end());
  if (fed == 0) return;
  std::vector<T> S(fed * fed), z(psi_.begin(), psi_.end());
  const auto weighted = [&](const double* row, size_t b, size_t j) {  // entry (b, j) of row (w x 1)
    T sum = 0;
    for (size_t a = 0; a < r_; ++a) sum += row[a * s + j] * w[a * r_ + b];
    return sum;
  };
  for (size_t i = 0; i < fed; ++i)
    for (size_t b = 0; b < r_; ++b)
      for (size_t j = 0; j < s; ++j)
        S[i * fed + b * s + j] = (i == b * s + j ? 1. : 0.) - weighted(&psi_of_u_[i * fed], b, j);
  if (!solve_dense(int(fed), S.data(), int(d_), z.data()))
    throw Failure("the linearised oscillation cannot be integrated");
  for (size_t p = 0; p < d_; ++p)
    for (size_t b = 0; b < r_; ++b)
      for (size_t j = 0; j < s; ++j) {
        const T factor = weighted(&end_of_u_[p * fed], b, j);
        for (size_t l = 0; l < d_; ++l) matrices[first + p * d_ + l] += factor * z[(b * s + j) * d_ + l];
      }
}

template <class T>
std::vector<std::complex<double>> multipliers_of(int d, const std::vector<IntervalPropagator>& links,
                                                 const std::vector<T>& w) {
  std::vector<T> matrices;
  matrices.reserve(links.size() * size_t(d) * size_t(d));
  for (const IntervalPropagator& link : links) link.carry(w.data(), matrices);
  return multipliers_of(d, pencil_of(d, matrices));
}
template std::vector<std::complex<double>> multipliers_of(int, const std::vector<IntervalPropagator>&,
                                                          const std::vector<double>&);
template std::vector<std::complex<double>> multipliers_of(int, const std::vector<IntervalPropagator>&,
                                                          const std::vector<std::complex<double>>&);

}  // namespace stickslip
