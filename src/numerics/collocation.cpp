
#include "stickslip/numerics/collocation.hpp"

#include <petscdt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "numerics/condensed_period.hpp"
#include "stickslip/base/error.hpp"

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

namespace {

using std::size_t;

constexpr size_t terms = 7;            // three powers of T
constexpr size_t samples = terms + 2;  // three sums
constexpr double ratio = 1.4;          // of T from one to the next: together a factor of 15

// The last entry of the table's column of the highest even order. `s`: an odd number of terms.
double epsilon_sum(std::vector<double> s) {
  std::vector<double> before(s.size() + 1, 0.);
  double best = s.back();
  for (size_t order = 1; s.size() > 1; ++order) {
    std::vector<double> next;
    for (size_t k = 0; k + 1 < s.size(); ++k) {
      const double change = s[k + 1] - s[k];
      if (change == 0) return best;  // the sequence stands still
      next.push_back(before[k + 1] + 1 / change);
    }
    before = std::move(s);
    s = std::move(next);
    if (order % 2 == 0) best = s.back();
  }
  return best;
}

}  // namespace

std::optional<InfinitePeriodLimit> infinite_period_limit(const std::vector<double>& periods,
                                                         const std::vector<double>& values) {
  size_t first = periods.size() - 1;
  while (first > 0 && periods[first - 1] < periods[first]) --first;
  std::vector<double> x, y;
  for (size_t k = first; k < periods.size(); ++k) {
    x.push_back(std::log(periods[k]));
    y.push_back(values[k]);
  }
  constexpr size_t points = 6;  // of the interpolation
  if (x.size() < points || x.back() - x.front() < double(samples - 1) * std::log(ratio)) return std::nullopt;
  std::vector<double> s;
  for (size_t n = samples; n-- > 0;) {
    const double at = x.back() - double(n) * std::log(ratio);
    const size_t after = size_t(std::lower_bound(x.begin(), x.end(), at) - x.begin());
    const size_t from = std::min(x.size() - points, after < points / 2 ? 0 : after - points / 2);
    s.push_back(Lagrange({x.begin() + long(from), x.begin() + long(from + points)}).value(&y[from], at));
  }
  for (size_t k = 0; k + 2 < samples; ++k)  // it settles
    if (!(std::abs(s[k + 2] - s[k + 1]) <= std::abs(s[k + 1] - s[k]))) return std::nullopt;
  double sums[samples - terms + 1], change = 0;
  for (size_t k = 0; k <= samples - terms; ++k) {
    sums[k] = epsilon_sum({s.begin() + long(k), s.begin() + long(k + terms)});
    if (k > 0) change = std::max(change, std::abs(sums[k] - sums[k - 1]));
  }
  if (!std::isfinite(change)) return std::nullopt;
  // they come nearer by a factor of at least 1.4 each
  return InfinitePeriodLimit{sums[samples - terms], change * ratio / (ratio - 1)};
}

namespace {

// The n zeros of the Jacobi polynomial P^(alpha, 0) and the weights of their quadrature, taken over to [0,
// 1].
void jacobi(int n, double alpha, std::vector<double>& points, std::vector<double>& weights) {
  points.resize(n);
  weights.resize(n);
  SS_TRY(PetscDTGaussJacobiQuadrature(n, -1, 1, alpha, 0, points.data(), weights.data()));
  for (double& x : points) x = (1 + x) / 2;
  for (double& w : weights) w /= 2;
}

// The integrals of l_j by Gauss's rule of s points, which is exact for them.
Tableau tableau(const std::vector<double>& c) {
  const std::size_t s = c.size();
  Tableau t{int(s), c, std::vector<double>(s * s), std::vector<double>(s)};
  const Lagrange basis(c);
  std::vector<double> points, weights, l(s);
  jacobi(int(s), 0, points, weights);
  const auto integrate = [&](double to, double* row) {
    for (std::size_t m = 0; m < s; ++m) {
      basis.weights(to * points[m], l.data());
      for (std::size_t j = 0; j < s; ++j) row[j] += to * weights[m] * l[j];
    }
  };
  for (std::size_t i = 0; i < s; ++i) integrate(c[i], &t.a[i * s]);
  integrate(1, t.b.data());
  return t;
}

}  // namespace

Tableau Tableau::gauss(int s) {
  std::vector<double> c, weights;
  jacobi(s, 0, c, weights);
  return tableau(c);
}

Tableau Tableau::radau(int s) {
  std::vector<double> c, weights;
  jacobi(s - 1, 1, c, weights);
  c.push_back(1);
  return tableau(c);
}

Collocation::Collocation(const Tableau& tableau)
    : Tableau(tableau), basis([&] {
        std::vector<double> points{0};
        points.insert(points.end(), tableau.c.begin(), tableau.c.end());
        return points;
      }()),
      end(tableau.c.size() + 1), a2(a.size()) {
  basis.weights(1, end.data());
  const auto integrals = as_matrix(a.data(), s, s);
  as_matrix(a2.data(), s, s) = integrals.lazyProduct(integrals);
}

const Collocation& Collocation::gauss5() {
  static const Collocation method(Tableau::gauss(5));
  return method;
}

const Collocation& Collocation::radau5() {
  static const Collocation method(Tableau::radau(5));
  return method;
}

}  // namespace stickslip
