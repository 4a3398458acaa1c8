#include "study/end_line.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/interpolation.hpp"

namespace stickslip {

namespace {

constexpr double first_step = 1e-4, shortest = 1e-7;  // step, of the box
constexpr double vanished =
    0.03;  // amplitude over the first point's: the line ends there, where the cycle shrinks to nothing
constexpr double shortest_to_nothing = 3e-3;
constexpr double aside = 0.35;  // of the step, by which a point may miss where it was expected

bool inside(PlanePoint p) { return p.x >= 0 && p.x <= 1 && p.y >= 0 && p.y <= 1; }
PlanePoint plus(PlanePoint p, double s, PlanePoint d) { return {p.x + s * d.x, p.y + s * d.y}; }
PlanePoint from_to(PlanePoint a, PlanePoint b) {
  const double length = distance(a, b);
  return {(b.x - a.x) / length, (b.y - a.y) / length};
}
// Across a direction, on the side of `like`.
PlanePoint across(PlanePoint d, PlanePoint like) {
  const PlanePoint n{-d.y, d.x};
  return n.x * like.x + n.y * like.y < 0 ? PlanePoint{-n.x, -n.y} : n;
}

// How far from p, which is inside, along d the border is, and the border's direction there.
struct Border {
  double distance;
  PlanePoint along;
};
Border border_ahead(PlanePoint p, PlanePoint d) {
  const auto reach = [](double at, double rate) {
    return rate > 0 ? (1 - at) / rate : rate < 0 ? -at / rate : 1e300;
  };
  const double x = reach(p.x, d.x), y = reach(p.y, d.y);
  return x < y ? Border{x, {0, 1}} : Border{y, {1, 0}};
}

}  // namespace

std::function<Scene(double)> scenes_across(const PlaneScene& scene, PlanePoint q, PlanePoint n) {
  return [scene, q, n](double s) { return scene(q.x + s * n.x, q.y + s * n.y); };
}

EndPlace end_place(std::shared_ptr<CyclePath> path, const std::string& kind, PlanePoint at,
                   PlanePoint to_life) {
  EndPlace p{at, to_life, kind, nullptr, 0, 0, 0, std::nan("")};
  p.residual = std::abs(special_test(kind, *path, path->direction()));
  const Cycle cycle = path->cycle();
  p.period = cycle.period;
  p.amplitude = cycle.amplitude;
  p.path = std::move(path);
  return p;
}

std::optional<EndPlace> end_on_line(const PlaneScene& scene, const EndPlace& near, PlanePoint q, PlanePoint n,
                                    const Weighted& others) {
  CyclePath::Others paths;
  for (const auto& [place, weight] : others) paths.push_back({place->path.get(), weight});
  try {
    std::shared_ptr<CyclePath> path = near.path->beside(scenes_across(scene, q, n), 0, 1, paths);
    double slope = near.slope;
    const double s = settle_on_special(near.kind, *path, 1, slope);
    if (std::isnan(s)) return std::nullopt;
    EndPlace found = end_place(std::move(path), near.kind, plus(q, s, n), n);
    found.slope = slope;
    return found;
  } catch (const Error&) {  // no such cycle, or no such scene
    return std::nullopt;
  }
}

Mixture mixture(const std::vector<EndPlace>& line, const std::vector<double>& along, double s) {
  constexpr std::size_t most = 3;
  const std::size_t count = std::min(most, line.size());
  const std::size_t above = std::size_t(std::lower_bound(along.begin(), along.end(), s) - along.begin());
  const std::size_t first = std::min(line.size() - count, above < 2 ? 0 : above - 2);
  std::vector<double> weights(count);
  Lagrange({along.begin() + long(first), along.begin() + long(first + count)}).weights(s, weights.data());
  Mixture m{first, {}, {0, 0}};
  for (std::size_t k = 0; k < count; ++k) {
    if (std::abs(along[first + k] - s) < std::abs(along[m.near] - s)) m.near = first + k;
    m.at = plus(m.at, weights[k], line[first + k].at);
  }
  for (std::size_t k = 0; k < count; ++k)
    if (first + k != m.near) m.others.push_back({&line[first + k], weights[k]});
  return m;
}

namespace {

// From `first` one way; the last place stands on the border, or is the first again.
class EndLineTracer {
 public:
  EndLineTracer(const PlaneScene& scene, double step) : scene_(scene), longest_(step) {}

  // The places behind `first`, which is not among them.
  std::vector<EndPlace> follow(const EndPlace& first, PlanePoint direction) {
    std::vector<EndPlace> line{first};
    std::vector<double> along{0};  // the polygon of the line
    double step = first_step;
    closed = stuck = false;
    while (step > shortest && line.size() < 2000) {
      const EndPlace& here = line.back();
      const Border border = border_ahead(here.at, direction);
      const bool arrives = border.distance <= 1.2 * step;
      if (border.distance < 1e-9) return behind_first(line);
      const double taken = arrives ? border.distance : step;
      const Mixture ahead = mixture(line, along, along.back() + taken);
      const PlanePoint q = line.size() > 2 && !arrives ? ahead.at : plus(here.at, taken, direction);
      std::optional<EndPlace> next =
          end_on_line(scene_, here, q, arrives ? along_border(border, here) : across(direction, here.to_life),
                      ahead.others);
      const PlanePoint turned = next ? from_to(here.at, next->at) : direction;
      const bool vanishes = next && next->amplitude < vanished * first.amplitude;
      if (vanishes && taken < shortest_to_nothing) return behind_first(line);
      if (!next || vanishes || distance(next->at, q) > aside * taken ||
          (arrives && !inside(rounded(next->at)))) {
        step = std::min(step, taken) / 3;
        if (line.size() == 1) direction = turned;  // but a guess
        continue;
      }
      if (arrives) next->at = rounded(next->at);
      next->to_life = across(turned, here.to_life);
      along.push_back(along.back() + distance(here.at, next->at));
      line.push_back(*next);
      if (arrives) return behind_first(line);
      if (line.size() > 4 && distance(next->at, first.at) < .8 * taken) {
        closed = true;
        return behind_first(line);
      }
      step = std::min(longest_, distance(next->at, q) < .05 * taken ? 2 * step : step);
      direction = turned;
    }
    stuck = true;
    return behind_first(line);
  }

  bool closed = false, stuck = false;

 private:
  static std::vector<EndPlace> behind_first(const std::vector<EndPlace>& line) {
    return {line.begin() + 1, line.end()};
  }
  static PlanePoint rounded(PlanePoint p) {
    const auto snap = [](double x) { return std::abs(x) < 1e-9 ? 0. : std::abs(x - 1) < 1e-9 ? 1. : x; };
    return {snap(p.x), snap(p.y)};
  }
  static PlanePoint along_border(const Border& border, const EndPlace& here) {
    const double side = border.along.x * here.to_life.x + border.along.y * here.to_life.y;
    return side < 0 ? PlanePoint{-border.along.x, -border.along.y} : border.along;
  }

  const PlaneScene& scene_;
  double longest_;
};

}  // namespace

EndLine follow_ends(const PlaneScene& scene, const EndPlace& first, double step) {
  EndLineTracer follower(scene, step);
  const PlanePoint along{-first.to_life.y, first.to_life.x};
  EndLine line;
  std::vector<EndPlace> ahead = follower.follow(first, along);
  line.piece.closed = follower.closed;
  if (follower.stuck) line.piece.stuck.push_back(ahead.empty() ? first.at : ahead.back().at);
  if (!follower.closed) {
    line.places = follower.follow(first, {-along.x, -along.y});
    if (follower.stuck) line.piece.stuck.push_back(line.places.empty() ? first.at : line.places.back().at);
    std::reverse(line.places.begin(), line.places.end());
  }
  line.places.push_back(first);
  line.places.insert(line.places.end(), ahead.begin(), ahead.end());
  if (follower.closed) line.places.back() = first;
  for (const EndPlace& place : line.places) line.piece.points.push_back(place.at);
  return line;
}

}  // namespace stickslip
