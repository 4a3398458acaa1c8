#include "stickslip/model/profile.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip {

ProfileAlongX::ProfileAlongX(std::vector<std::pair<double, double>> points, Between between, double period)
    : points_(std::move(points)), between_(between), period_(period) {
  if (points_.empty()) return;
  // Nodes stand at multiples of a spacing, which are rounded: on which side of a jump one lies must not
  // depend on that.
  snap_ = 1e-12 * std::max({std::abs(points_.front().first), std::abs(points_.back().first), period_});
}

double ProfileAlongX::at(double x) const {
  const auto behind = std::upper_bound(points_.begin(), points_.end(), x + snap_,
                                       [](double at, const auto& point) { return at < point.first; });
  const bool first = behind == points_.begin(), last = behind == points_.end();
  if (period_ == 0 && (first || last)) return first ? points_.front().second : points_.back().second;
  const auto& low = first || last ? points_.back() : *(behind - 1);
  const auto& high = first || last ? points_.front() : *behind;
  if (between_ == Between::step) return low.second;
  const double begin = low.first - (first ? period_ : 0), end = high.first + (last ? period_ : 0);
  if (!(end > begin)) return low.second;
  const double s = std::clamp((x - begin) / (end - begin), 0., 1.);
  const double w = between_ == Between::smooth ? s * s * s * (10 + s * (6 * s - 15)) : s;
  return low.second + w * (high.second - low.second);
}

bool ProfileAlongX::is_constant() const {
  return std::all_of(points_.begin(), points_.end(),
                     [&](const auto& p) { return p.second == points_.front().second; });
}

std::vector<double> ProfileAlongX::jumps() const {
  std::vector<double> places;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const auto& before = points_[i > 0 ? i - 1 : points_.size() - 1];
    const auto& here = points_[i];
    if (before.second == here.second || (i == 0 && period_ == 0)) continue;
    if (between_ == Between::step || (i > 0 && before.first == here.first)) places.push_back(here.first);
  }
  return places;
}

std::pair<double, double> ProfileAlongX::range() const {
  const auto by_value = [](const auto& a, const auto& b) { return a.second < b.second; };
  const auto [low, high] = std::minmax_element(points_.begin(), points_.end(), by_value);
  return {low->second, high->second};
}

double ProfileAlongX::shortest() const {
  double shortest = std::numeric_limits<double>::infinity();
  const auto look = [&](const auto& low, const auto& high, double distance) {
    if (low.second != high.second && distance > snap_) shortest = std::min(shortest, distance);
  };
  for (std::size_t i = 1; i < points_.size(); ++i)
    look(points_[i - 1], points_[i], points_[i].first - points_[i - 1].first);
  if (period_ > 0 && !points_.empty())
    look(points_.back(), points_.front(), points_.front().first + period_ - points_.back().first);
  return shortest;
}

}  // namespace stickslip
