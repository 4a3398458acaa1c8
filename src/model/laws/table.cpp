#include "model/laws/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/failure.hpp"
#include "model/laws/of_velocity.hpp"
#include "stickslip/base/text.hpp"

namespace stickslip {

namespace {

constexpr std::size_t most_points = 10000;
constexpr std::int64_t most_buckets = std::int64_t(1) << 22;
constexpr int mantissa_bits = 52;

// Of one direction: speed against the size of the force, from the slowest.
Points direction(const Points& points, double sign) {
  Points one;
  for (const auto& [velocity, force] : points)
    if (sign * velocity > 0 || velocity == 0) one.emplace_back(std::abs(velocity), std::abs(force));
  std::sort(one.begin(), one.end());
  return one;
}

bool has_backward(const Points& points) { return points.front().first < 0; }

// The numbers of the buckets at the resolution `shift`.
std::int64_t bucket_of(double x, double offset, int shift) {
  return std::int64_t(elementary::bits_of(x + offset) >> shift);
}

// Buckets of which none holds two points.
struct Buckets {
  double offset, last = 0, least = std::numeric_limits<double>::infinity();
  int shift = mantissa_bits;
  std::int64_t base = 0, count = 0;

  // With that offset the coarsest.
  Buckets(const std::vector<Points>& directions, double offset_wanted) : offset(offset_wanted) {
    for (const Points& one : directions)
      for (const auto& point : one)
        if (point.first > 0) {
          least = std::min(least, point.first);
          last = std::max(last, point.first);
        }
    if (offset == 0) offset = least;
    const auto apart = [&](const Points& one) {
      for (std::size_t i = 1; i < one.size(); ++i)
        if (bucket_of(one[i - 1].first, offset, shift) == bucket_of(one[i].first, offset, shift))
          return false;
      return true;
    };
    for (set_count(); !std::all_of(directions.begin(), directions.end(), apart) && count <= most_buckets;
         set_count())
      --shift;
  }
  void set_count() {
    base = bucket_of(0, offset, shift);
    count = bucket_of(last, offset, shift) - base + 1;
  }
};
// The fewest: a small offset suits velocities of many decades, a large one those that are evenly spaced.
Buckets buckets_of(const std::vector<Points>& directions) {
  Buckets best(directions, 0);
  for (double offset = 4 * best.least; offset < 8 * best.last; offset *= 4)
    if (const Buckets other(directions, offset); other.count < best.count) best = other;
  return best;
}

std::vector<Points> directions_of(const Points& points) {
  std::vector<Points> all = {direction(points, 1)};
  if (has_backward(points)) all.push_back(direction(points, -1));
  return all;
}

double end_slope(double h, double next_h, double secant, double next_secant) {
  const double slope = ((2 * h + next_h) * secant - h * next_secant) / (h + next_h);
  if (slope * secant <= 0) return 0;
  return secant * next_secant <= 0 && std::abs(slope) > 3 * std::abs(secant) ? 3 * secant : slope;
}

std::vector<double> slopes_at(const Points& p) {
  const std::size_t n = p.size();
  const auto h = [&](std::size_t i) { return p[i + 1].first - p[i].first; };
  const auto secant = [&](std::size_t i) { return (p[i + 1].second - p[i].second) / h(i); };
  if (n < 3) return std::vector<double>(n, n == 2 ? secant(0) : 0);
  std::vector<double> slopes(n);
  slopes.front() = end_slope(h(0), h(1), secant(0), secant(1));
  slopes.back() = end_slope(h(n - 2), h(n - 3), secant(n - 2), secant(n - 3));
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double before = secant(i - 1), behind = secant(i);
    const double w = 2 * h(i) + h(i - 1), w_behind = h(i) + 2 * h(i - 1);
    if (before * behind > 0) slopes[i] = (w + w_behind) / (w / before + w_behind / behind);
  }
  return slopes;
}

// The least and the largest slope of a piece of that length.
std::pair<double, double> slopes_of(double slope, double bend, double twist, double length) {
  const auto at = [&](double y) { return slope + y * (2 * bend + 3 * twist * y); };
  const double end = at(length), top = twist != 0 ? -bend / (3 * twist) : 0;
  std::pair<double, double> range = std::minmax({slope, end});
  if (top > 0 && top < length) range = {std::min(range.first, at(top)), std::max(range.second, at(top))};
  return range;
}

}  // namespace

std::string FrictionCurve::fault(const Points& points, std::size_t& at) {
  for (at = 0; at < points.size(); ++at) {
    const auto [velocity, force] = points[at];
    if (at > 0 && !(velocity > points[at - 1].first))
      return fmt::format("velocity {} after {}: velocities must ascend, each once", number_text(velocity),
                         number_text(points[at - 1].first));
    if (velocity * force < 0 || (velocity == 0 && force < 0))
      return fmt::format(
          "force {} at velocity {}: friction opposes motion, its force has the sign of the "
          "velocity (>= 0 at rest)",
          number_text(force), number_text(velocity));
    if (at > 0 && points[at - 1].first < 0 && velocity > 0)
      return fmt::format(
          "no point at rest between velocities {} and {}: a curve of both directions needs "
          "the threshold, a force at velocity 0",
          number_text(points[at - 1].first), number_text(velocity));
  }
  at = points.empty() ? 0 : points.size() - 1;
  if (points.size() < 2) return "one point; a curve needs two or more";
  if (points.size() > most_points)
    return fmt::format("{} points; at most {} are taken", points.size(), most_points);
  if (!(points.back().first > 0)) return "no point at a positive velocity; a curve needs one";
  const std::vector<Points> directions = directions_of(points);
  const auto steep = [](const Points& one) {  // its cubic has no coefficients
    for (std::size_t i = 0; i + 1 < one.size(); ++i) {
      const double h = one[i + 1].first - one[i].first;
      if (!std::isfinite((one[i].second + one[i + 1].second) / (h * h))) return true;
    }
    return false;
  };
  if (std::any_of(directions.begin(), directions.end(), steep) || buckets_of(directions).count > most_buckets)
    return "two velocities lie too close together beside the others; leave one of them out";
  return "";
}

FrictionCurve::FrictionCurve(const Points& points, bool straight_beyond) {
  const std::vector<Points> directions = directions_of(points);
  std::vector<Points> corners = directions;
  std::vector<std::vector<CubicPiece>> pieces_of_directions;
  for (Points& one : corners) {
    const CubicPiece& beyond = pieces_of_directions.emplace_back(pieces_of(one, straight_beyond)).back();
    if (beyond.from > one.back().first) one.emplace_back(beyond.from, beyond.value);
  }
  const Buckets b = buckets_of(corners);
  for (const auto& point : points) largest_ = std::max(largest_, std::abs(point.second));
  offset_ = b.offset;
  last_ = b.last;
  least_ = b.least;
  shift_ = b.shift;
  base_ = b.base;
  if (directions.size() > 1) backward_ = b.count;
  for (std::size_t d = 0; d < directions.size(); ++d) {
    const std::vector<CubicPiece>& pieces = pieces_of_directions[d];
    std::size_t k = 0;  // the piece at the begin of the bucket
    for (std::int64_t i = 0; i < b.count; ++i) {
      const CubicPiece& low = pieces[k];
      const bool met = k + 1 < pieces.size() && bucket_of(pieces[k + 1].from, offset_, shift_) - base_ == i;
      if (!met) {
        buckets_.push_back(
            {low.from, low.value, {low.slope, low.slope}, {low.bend, low.bend}, {low.twist, low.twist}});
        continue;
      }
      const CubicPiece& high = pieces[++k];
      const double h = high.from - low.from, bend = low.bend + 3 * h * low.twist;
      const double slope = low.slope + h * (2 * low.bend + 3 * h * low.twist);
      // beside the points given
      const bool kink = low.from < directions[d].front().first || k + 1 == pieces.size();
      buckets_.push_back({high.from,
                          high.value,
                          {kink ? slope : high.slope, high.slope},
                          {bend, high.bend},
                          {low.twist, high.twist}});
    }
  }
}

std::vector<FrictionCurve::CubicPiece> FrictionCurve::pieces_of(const Points& points, bool straight_beyond) {
  const std::vector<double> slopes = slopes_at(points);
  std::vector<CubicPiece> pieces;
  if (points.front().first > 0) pieces.push_back({0, points.front().second, 0, 0, 0});
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const double h = points[i + 1].first - points[i].first;
    const double secant = (points[i + 1].second - points[i].second) / h;
    pieces.push_back({points[i].first, points[i].second, slopes[i],
                      (3 * secant - 2 * slopes[i] - slopes[i + 1]) / h,
                      (slopes[i] + slopes[i + 1] - 2 * secant) / (h * h)});
    const auto [low, high] = slopes_of(slopes[i], pieces.back().bend, pieces.back().twist, h);
    bounds_ = {std::max(bounds_.falling, -low), std::max(bounds_.rising, high)};
  }
  // Friction that falls on does so to 0, where it stays: it does not come to push. A fall so short is none,
  // since buckets would have to be as narrow.
  constexpr double short_fall = 1e-4;  // of the last velocity
  const auto [last, force] = points.back();
  const double slope = straight_beyond ? slopes.back() : 0,
               fall = slope < 0 ? -force / slope : std::numeric_limits<double>::infinity();
  const bool goes_on = fall > short_fall * last;
  pieces.push_back({last, force, goes_on ? slope : 0, 0, 0});
  if (goes_on && slope < 0) pieces.push_back({last + fall, 0, 0, 0, 0});
  return pieces;
}

std::string StrengthTable::fault(const Points& points, std::size_t& at) {
  for (at = 0; at < points.size(); ++at) {
    const auto [slip, strength] = points[at];
    if (slip < 0) return fmt::format("slip {}: it counts from 0 on", number_text(slip));
    if (at > 0 && !(slip > points[at - 1].first))
      return fmt::format("slip {} after {}: slips must ascend, each once", number_text(slip),
                         number_text(points[at - 1].first));
    if (strength < 0 || (at == 0 && strength == 0))
      return fmt::format("strength {} at slip {}: it is never negative, and above 0 at first",
                         number_text(strength), number_text(slip));
  }
  at = points.empty() ? 0 : points.size() - 1;
  return points.size() < 2 ? "one point; a table needs two or more" : "";
}

StrengthTable::StrengthTable(const Points& points)
    : first_(points.front().second), largest_(points.front().second) {
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    const auto [slip, strength] = points[i];
    const double length = points[i + 1].first - slip;
    pieces_.push_back({slip, length, (points[i + 1].second - strength) / length});
    largest_ = std::max(largest_, points[i + 1].second);
  }
}

}  // namespace stickslip
