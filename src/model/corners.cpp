#include "stickslip/model/corners.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace stickslip {

namespace {

using Point = std::pair<double, double>;

constexpr int jump = 1, bend = 2, third_derivative = 4, none = 8;

// How smoothly a profile leaves the value of `low` on its way to `high`, and comes there. A quarter of the
// way tells how it goes.
std::pair<int, int> leaves_and_comes(const ProfileAlongX& profile, const Point& low, const Point& high,
                                     double length) {
  if (low.second == high.second) return {none, none};
  if (!(high.first > low.first)) return {none, jump};
  double quarter = low.first + (high.first - low.first) / 4;
  if (length > 0) quarter = std::fmod(quarter + length, length);
  const double part = (profile.at(quarter) - low.second) / (high.second - low.second);
  if (std::abs(part) < 1e-9) return {none, jump};
  return std::abs(part - 0.25) < 1e-9 ? std::make_pair(bend, bend)
                                      : std::make_pair(third_derivative, third_derivative);
}

// Of no lower order than `least`.
void add_corners(const ProfileAlongX& profile, const Scene& scene, std::map<double, int>& corners,
                 int least = jump) {
  const std::vector<Point>& points = profile.points();
  const double length = scene.ring() ? scene.length : 0, near = 1e-12 * scene.length;
  const auto add = [&](double x, int order) {
    if (length > 0 && x >= length - near) x -= length;
    if (order == none || (length == 0 && (x < near || x > scene.length - near))) return;
    const auto known = corners.lower_bound(x - near);
    if (known != corners.end() && known->first <= x + near)
      known->second = std::min(known->second, order);
    else
      corners[x] = order;
  };
  const std::size_t pairs = points.empty() ? 0 : points.size() - (length > 0 ? 0 : 1);
  for (std::size_t i = 0; i < pairs; ++i) {
    Point high = points[(i + 1) % points.size()];
    if (i + 1 == points.size()) high.first += length;
    const auto [leaves, comes] = leaves_and_comes(profile, points[i], high, length);
    add(points[i].first, std::max(leaves, least));
    add(high.first, std::max(comes, least));
  }
}

}  // namespace

std::vector<Corner> corners_of(const Scene& scene) {
  std::map<double, int> found;
  add_corners(scene.amplitude, scene, found);
  for (const auto& [name, profile] : scene.friction.profiles) add_corners(profile, scene, found);
  // at a jump of c flux and psi are continuous, and so they are in the differences (medium.hpp)
  for (const auto& [name, profile] : scene.medium.profiles)
    add_corners(profile, scene, found, name == "model_c" ? bend : jump);
  std::vector<Corner> corners;
  for (const auto& [x, order] : found) corners.push_back({x, order});
  return corners;
}

SmoothStretch stretch_around(const std::vector<Corner>& corners, const Scene& scene, double x) {
  const double beyond = std::numeric_limits<double>::infinity(), near = 1e-12 * scene.length;
  if (corners.empty()) return {-beyond, beyond, false};
  const auto next = std::upper_bound(corners.begin(), corners.end(), x + near,
                                     [](double at, const Corner& c) { return at < c.x; });
  const bool ring = scene.ring(), first = next == corners.begin(), last = next == corners.end();
  const double from = !first ? (next - 1)->x : ring ? corners.back().x - scene.length : -beyond;
  const double to = !last ? next->x : ring ? corners.front().x + scene.length : beyond;
  const bool jumps = !last ? next->order == jump : ring && corners.front().order == jump;
  return {from, to, jumps};
}

PetscInt cells_between_corners(const std::vector<Corner>& corners, const Scene& scene, int order,
                               PetscInt most) {
  for (PetscInt cells = 1; cells <= most; ++cells) {
    const auto at_node = [&](const Corner& c) {
      const double at = c.x / scene.length * double(cells);
      return c.order > order || std::abs(at - std::round(at)) < 1e-9 * double(cells);
    };
    if (std::all_of(corners.begin(), corners.end(), at_node)) return cells;
  }
  return 0;
}

}  // namespace stickslip
