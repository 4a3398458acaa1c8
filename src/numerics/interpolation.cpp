#include "stickslip/numerics/interpolation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace stickslip {

Lagrange::Lagrange(std::vector<double> points) : points_(std::move(points)) {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    double f = 1;
    for (std::size_t j = 0; j < points_.size(); ++j)
      if (j != i) f /= points_[i] - points_[j];
    leading_.push_back(f);
  }
}

void Lagrange::weights(double at, double* w) const {
  const std::size_t n = points_.size();
  for (std::size_t i = 0; i < n; ++i) {
    w[i] = leading_[i];
    for (std::size_t j = 0; j < n; ++j)
      if (j != i) w[i] *= at - points_[j];
  }
}

void Lagrange::derivative_weights(double at, double* w) const {
  const std::size_t n = points_.size();
  for (std::size_t i = 0; i < n; ++i) {
    w[i] = 0;
    for (std::size_t k = 0; k < n; ++k) {
      if (k == i) continue;
      double product = leading_[i];
      for (std::size_t j = 0; j < n; ++j)
        if (j != i && j != k) product *= at - points_[j];
      w[i] += product;
    }
  }
}

double Lagrange::sum(void (Lagrange::*weigh)(double, double*) const, const double* values, double at) const {
  std::array<double, 32> w;
  if (points_.size() > w.size()) throw std::length_error("a polynomial through more than 32 points");
  (this->*weigh)(at, w.data());
  return std::inner_product(values, values + points_.size(), w.data(), 0.);
}

std::vector<std::pair<PetscInt, double>> grid_interpolation(PetscInt n, GridEnd left, GridEnd right,
                                                            int count, double at) {
  const auto node = [&](PetscInt i) {
    if (left == GridEnd::periodic) return (i % n + n) % n;
    return i < 0 ? -i : i >= n ? 2 * (n - 1) - i : i;
  };
  const double nearest = std::round(at);
  if (std::abs(at - nearest) < 1e-12 * (1 + at)) return {{node(PetscInt(nearest)), 1.}};
  count = int(std::min<PetscInt>(count, n));
  PetscInt first = PetscInt(std::floor(at - count / 2.)) + 1;
  if (right == GridEnd::one_sided) first = std::min(first, n - count);
  if (left == GridEnd::one_sided) first = std::max<PetscInt>(first, 0);
  std::vector<std::pair<PetscInt, double>> row;
  double binomial = 1, sum = 0;  // barycentric weights of equal spacing: with alternating signs
  for (int k = 0; k < count; ++k) {
    const double weight = binomial / (at - double(first + k));
    row.emplace_back(node(first + k), weight);
    sum += weight;
    binomial *= -double(count - 1 - k) / (k + 1);
  }
  for (auto& [index, weight] : row) weight /= sum;
  return row;
}

}  // namespace stickslip
