#include "numerics/infinite_period.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/numerics/interpolation.hpp"

namespace stickslip {

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

}  // namespace stickslip
