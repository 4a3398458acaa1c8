#include "stickslip/model/medium.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>
#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

const ProfileAlongX* Medium::profile(const char* name) const {
  if (profiles.empty()) return nullptr;
  const auto found = profiles.find(name);
  return found == profiles.end() ? nullptr : &found->second;
}

void Medium::refuse_varying(const char* name) const {
  if (profile(name)) throw std::logic_error(std::string(name) + " differs along x: there is no one number");
}

Scene Scene::averaged() const {
  Scene mean = *this;
  mean.medium.profiles.clear();
  return mean;
}

NodeCoefficients Scene::coefficients(PetscInt i) const {
  const auto at = [&](const char* name, double same) {
    const ProfileAlongX* const profile = medium.profile(name);
    return profile ? profile->at(x(i)) : same;
  };
  if (form == Form::chain)
    return {f0 / at("model_m", m), at("model_zeta", zeta) / f0, at("model_k0", k0) / f0, 0};
  const double damping = at("model_delta", delta);
  return {gamma, 0, 1 / gamma, derived_sign ? damping : -damping};
}

namespace {

// c^2 between two places: half-way, or its harmonic mean where c jumps between them.
double square_between(const ProfileAlongX& c, const Scene& s, double from, double to) {
  const double near = 1e-9 * (to - from), half = c.at((from + to) / 2);
  std::vector<double> cuts = {from};
  for (const double x : c.jumps())
    for (const double at : {x - s.length, x, x + s.length})
      if (at > from + near && at < to - near && (s.ring() || at == x)) cuts.push_back(at);
  if (cuts.size() == 1) return half * half;
  std::sort(cuts.begin(), cuts.end());
  cuts.push_back(to);
  double resistance = 0;
  for (std::size_t k = 1; k < cuts.size(); ++k) {
    double middle = (cuts[k - 1] + cuts[k]) / 2;
    if (s.ring()) middle = std::fmod(middle + s.length, s.length);
    resistance += (cuts[k] - cuts[k - 1]) / std::pow(c.at(middle), 2);
  }
  return (to - from) / resistance;
}

}  // namespace

double Scene::link(PetscInt i) const {
  const double step = spacing(), scale = step * step;
  if (ring())
    i = (i + n) % n;
  else
    i = std::clamp(i, PetscInt(0), std::max(n - 2, PetscInt(0)));
  if (const ProfileAlongX* const springs = medium.profile("model_k1"))
    return springs->at(double(i) + 0.5) / f0;
  if (const ProfileAlongX* const speed = medium.profile("model_c"))
    return square_between(*speed, *this, x(i), x(i) + step) / gamma / scale;
  return mean_K1() / scale;
}

std::vector<NodeCoefficients> coefficients_along(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<NodeCoefficients> all;
  if (!scene.medium.nodes_differ()) return all;
  for (PetscInt i = 0; i < count; ++i) all.push_back(scene.coefficients(first + i));
  return all;
}

std::vector<double> links_along(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> all;
  if (!scene.medium.links_differ()) return all;
  for (PetscInt i = -1; i < count; ++i) all.push_back(scene.link(first + i));
  return all;
}

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
