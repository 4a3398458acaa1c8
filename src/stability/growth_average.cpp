#include "stickslip/stability/growth_average.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace stickslip {

namespace {
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t blocks = 16;
}  // namespace

std::size_t GrowthAverage::add(double begin, double end, const std::vector<double>& growth) {
  const auto complete = [&](double t) {
    return t > from_ && interval_ > 0 ? std::size_t((t - from_) / interval_ * (1 + 1e-12)) : 0;
  };
  for (double at = std::max(begin, from_); at < end && interval_ > 0;) {
    const std::size_t interval = complete(at);
    const double until = std::min(end, std::max(end_of(interval), std::nextafter(at, end)));
    if (sums_.size() < (interval + 1) * count_) sums_.resize((interval + 1) * count_, 0.);
    for (std::size_t k = 0; k < count_; ++k)
      sums_[interval * count_ + k] += growth[k] * ((until - at) / (end - begin));
    measured_ += until - at;
    at = until;
  }
  return complete(end);
}

std::size_t GrowthAverage::whole() const {
  const auto count = std::size_t(measured_ / interval_ * (1 + 1e-12));
  return std::min(count, sums_.size() / count_);
}

// Over `count` intervals.
double GrowthAverage::slope(std::size_t k, std::size_t first, std::size_t count) const {
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double s = (double(i) + 0.5) / double(count), weight = s * (1 - s);
    sum += weight * rate(first + i, k);
    weights += weight;
  }
  return sum / weights;
}

std::vector<Estimate> GrowthAverage::exponents() const {
  std::vector<Estimate> all(count_, Estimate{nan, nan});
  if (!(measured_ > 0)) return all;
  for (std::size_t k = 0; k < count_; ++k) {
    double sum = 0;
    for (std::size_t i = k; i < sums_.size(); i += count_) sum += sums_[i];
    const bool enough = whole() >= blocks && std::isfinite(sum);
    all[k] = {enough ? slope(k, 0, whole()) : sum / measured_, enough ? error(k) : nan};
  }
  return all;
}

double GrowthAverage::error(std::size_t k) const {
  const std::size_t length = whole() / blocks, first = whole() - blocks * length;
  std::array<double, blocks> slopes{};
  double mean = 0, squares = 0;
  for (std::size_t b = 0; b < blocks; ++b)
    mean += (slopes[b] = slope(k, first + b * length, length)) / double(blocks);
  for (const double one : slopes) squares += (one - mean) * (one - mean);
  return std::sqrt(squares / double(blocks - 1) / double(blocks));
}

std::optional<Estimate> kaplan_yorke(const std::vector<Estimate>& exponents, std::size_t unknowns) {
  double sum = 0, variance = 0;
  for (std::size_t j = 0; j < exponents.size(); ++j) {
    const Estimate& e = exponents[j];
    if (std::isnan(e.value)) return std::nullopt;
    const bool is_zero = std::abs(e.value) <= e.error;
    const double value = is_zero ? 0 : e.value;
    if (sum + value < 0) {
      if (std::isinf(value)) return Estimate{double(j), 0};
      // D = j + sum/|value|
      const double part = sum / -value, own = std::isnan(e.error) ? 0 : part * e.error / value;
      return Estimate{double(j) + part, std::sqrt(variance / (value * value) + own * own)};
    }
    sum += value;
    if (!is_zero && !std::isnan(e.error)) variance += e.error * e.error;
  }
  if (exponents.size() == unknowns) return Estimate{double(unknowns), 0};
  return std::nullopt;
}

}  // namespace stickslip
