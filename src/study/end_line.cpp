#include "study/end_line.hpp"

#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

namespace {

constexpr double probes[] = {1e-4, -1e-4, 1e-5, -1e-5, 1e-6, -1e-6};  // aside of the first point, of the box
constexpr double vanished =
    0.03;  // amplitude over that of a strong cycle: the line ends there, where the cycle shrinks to nothing
constexpr double shortest_to_nothing = 3e-3;
constexpr double aside = 0.35;  // of the step, by which a point may miss where it was expected

PlanePoint plus(PlanePoint p, double s, PlanePoint d) { return {p.x + s * d.x, p.y + s * d.y}; }
PlanePoint on_side(PlanePoint n, PlanePoint like) {
  return n.x * like.x + n.y * like.y < 0 ? PlanePoint{-n.x, -n.y} : n;
}
// Across a direction, on the side of `like`.
PlanePoint across(PlanePoint d, PlanePoint like) { return on_side({-d.y, d.x}, like); }

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

double angle_of(PlanePoint a, PlanePoint b) { return std::atan2(b.y - a.y, b.x - a.x); }

}  // namespace

std::function<Scene(double)> scenes_across(const PlaneScene& scene, PlanePoint q, PlanePoint n) {
  return [scene, q, n](double s) { return scene(q.x + s * n.x, q.y + s * n.y); };
}

EndPlace end_place(std::shared_ptr<CycleFamily> path, const std::string& kind, PlanePoint at,
                   PlanePoint to_life) {
  EndPlace p{at, to_life, kind, nullptr, 0, 0, 0, std::nan("")};
  p.residual = std::abs(special_test(kind, *path, path->direction()));
  const Cycle cycle = path->cycle();
  p.period = cycle.period;
  p.amplitude = cycle.amplitude;
  p.path = std::move(path);
  return p;
}

namespace {

using Weighted = std::vector<std::pair<const EndPlace*, double>>;

// The point of the same kind as `near` on the line through q along n (unit vector, to life); empty where none
// is found near by. The cycle is sought from a mixture of those of other places, `near` with the weight that
// they leave of 1.
std::optional<EndPlace> end_on_line(const PlaneScene& scene, const EndPlace& near, PlanePoint q, PlanePoint n,
                                    const Weighted& others = {}) {
  CycleFamily::Others paths;
  for (const auto& [place, weight] : others) paths.push_back({place->path.get(), weight});
  try {
    std::shared_ptr<CycleFamily> path = near.path->beside(scenes_across(scene, q, n), 0, 1, paths);
    double slope = near.slope;
    const double s = settle_on_special(near.kind, *path, path->direction(), 1, slope);
    if (std::isnan(s)) return std::nullopt;
    EndPlace found = end_place(std::move(path), near.kind, plus(q, s, n), n);
    found.slope = slope;
    return found;
  } catch (const Error&) {  // no such cycle, or no such scene
    return std::nullopt;
  } catch (const Spent&) {  // the line ends here
    return std::nullopt;
  }
}

// The places of `line` about the place at the distance s along it (the polygon's), interpolated; number
// `near` is the nearest.
struct Mixture {
  std::size_t near;
  Weighted others;
  PlanePoint at;
};
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

// The line about `first`; the last place of a way may stand on the border, or be the first again.
class LineOfEnds : public PlaneLine {
 public:
  LineOfEnds(const PlaneScene& scene, const EndPlace& first) : scene_(scene), first_(first) {
    const PlanePoint along{-first.to_life.y, first.to_life.x};
    for (const double off : probes) {  // the first direction is but a guess
      const PlanePoint q = plus(first.at, off, along);
      if (!inside(q)) continue;
      const auto found = end_on_line(scene, first, q, first.to_life);
      if (!found || distance(found->at, q) > 20 * std::abs(off)) continue;
      heading_ = angle_of(first.at, found->at) + (off < 0 ? M_PI : 0);
      return;
    }
  }

  Way begin(bool forwards) override {
    way_ = &ways_[forwards ? 1 : 0];
    *way_ = {first_};
    along_ = {0};
    if (!heading_) return {};
    const double angle = *heading_ + (forwards ? 0 : M_PI);
    const bool out = border_ahead(first_.at, towards({0, 0}, angle, 1)).distance < 1e-9;
    return {out ? Way::outwards : Way::inwards, angle};
  }

  std::optional<NextPoint> ahead(double radius, double heading) override {
    const EndPlace& here = way_->back();
    const PlanePoint direction = towards({0, 0}, heading, 1);
    const Border border = border_ahead(here.at, direction);
    const bool arrives = border.distance <= 1.2 * radius;
    const double taken = arrives ? border.distance : radius;
    const Mixture m = mixture(*way_, along_, along_.back() + taken);
    const PlanePoint q = way_->size() > 2 && !arrives ? m.at : plus(here.at, taken, direction);
    const PlanePoint n = arrives ? on_side(border.along, here.to_life) : across(direction, here.to_life);
    next_ = end_on_line(scene_, here, q, n, m.others);
    const bool vanishes = next_ && next_->amplitude < vanished * first_.strong;
    vanishes_ = vanishes && taken < shortest_to_nothing;
    if (!next_ || vanishes || distance(next_->at, q) > aside * taken) return std::nullopt;
    if (arrives) next_->at = rounded(next_->at);
    if (!inside(next_->at)) return std::nullopt;
    const double angle = angle_of(here.at, next_->at);
    next_->to_life = across(towards({0, 0}, angle, 1), here.to_life);
    return NextPoint{next_->at, angle, arrives};
  }

  void accept() override {
    along_.push_back(along_.back() + distance(way_->back().at, next_->at));
    way_->push_back(*next_);
  }

  bool vanishes() const override { return vanishes_; }

  std::vector<EndPlace> places(bool closed) const {
    if (!closed) return joined(ways_[0], ways_[1]);
    std::vector<EndPlace> round = *way_;
    round.back() = first_;
    return round;
  }

 private:
  static PlanePoint rounded(PlanePoint p) {
    const auto snap = [](double x) { return std::abs(x) < 1e-9 ? 0. : std::abs(x - 1) < 1e-9 ? 1. : x; };
    return {snap(p.x), snap(p.y)};
  }

  const PlaneScene& scene_;
  EndPlace first_;
  std::optional<double> heading_;
  std::vector<EndPlace> ways_[2], *way_ = nullptr;  // backwards, forwards; the one that is gone
  std::vector<double> along_;                       // its polygon
  std::optional<EndPlace> next_;
  bool vanishes_ = false;
};

}  // namespace

EndLine follow_ends(const PlaneScene& scene, const EndPlace& first, double step) {
  LineOfEnds line(scene, first);
  EndLine found;
  found.piece = follow_both_ways(line, first.at, {step, step / 8});
  found.places = line.places(found.piece.closed);
  return found;
}

std::vector<NumberedEnd> even_ends(const PlaneScene& scene, const std::vector<EndLine>& lines,
                                   PetscInt count) {
  std::vector<CurvePiece> pieces;
  for (const EndLine& line : lines) pieces.push_back(line.piece);
  const std::vector<std::vector<CurvePlace>> all = even_places(pieces, count);
  std::vector<NumberedEnd> ends;
  for (std::size_t number = 0; number < lines.size(); ++number) {
    const std::vector<EndPlace>& places = lines[number].places;
    if (places.size() < 2) ends.push_back({number, places[0]});
    std::vector<double> along{0};
    for (std::size_t k = 1; k < places.size(); ++k)
      along.push_back(along.back() + distance(places[k].at, places[k - 1].at));
    for (const CurvePlace& place : all[number]) {
      const Mixture m = mixture(places, along, place.along);
      const EndPlace& near = places[m.near];
      const bool is_there = std::abs(along[m.near] - place.along) < 1e-9;
      const auto on =
          is_there ? std::optional<EndPlace>(near) : end_on_line(scene, near, m.at, near.to_life, m.others);
      if (on) ends.push_back({number, *on});
    }
  }
  return ends;
}

}  // namespace stickslip
