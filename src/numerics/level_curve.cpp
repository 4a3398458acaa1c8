
#include "stickslip/numerics/level_curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

Lattice sampled(const PlaneFunction& f, int cells) {
  Lattice lattice{cells, {}};
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i) lattice.values.push_back(f(double(i) / cells, double(j) / cells));
  return lattice;
}

namespace {

// The zero line of f about a point of it. `side`: 1 where f is positive on the left of the way forwards.
class FunctionLine : public PlaneLine {
 public:
  FunctionLine(const PlaneFunction& f, double step, PlanePoint start, double heading, bool on_border)
      : f_(f), step_(step), start_(start), guess_(heading), on_border_(on_border) {}

  // The heading is found on a small circle.
  Way begin(bool forwards) override {
    at_ = start_;
    side_ = forwards ? 1 : -1;
    double angle = guess_ + (forwards ? 0 : M_PI);
    if (on_border_ && !inside(towards(start_, angle, 1e-3))) return {Way::outwards, angle};
    for (int k = 0; k < 2; ++k, angle += M_PI)
      if (turn(step_ / 8, angle)) return {Way::inwards, angle};
    return {};
  }

  std::optional<NextPoint> ahead(double radius, double heading) override {
    if (!turn(radius, heading)) return std::nullopt;
    const PlanePoint next = towards(at_, heading, radius);
    next_ = clamped(next);
    return NextPoint{next_, heading, !inside(next)};
  }

  void accept() override { at_ = next_; }

  // f may have changed since the point was found (a function that learns): the line passes by.
  std::optional<PlanePoint> corrected(double heading) override {
    double slope = std::numeric_limits<double>::quiet_NaN();
    const Placed q = put_on_curve(f_, at_, {-std::sin(heading), std::cos(heading)}, slope);
    if (q.found && distance(at_, q.at) < 2 * step_) at_ = q.at;
    return at_;
  }

 private:
  // The angle nearest to the given one at which the line leaves the circle with f positive on `side`.
  bool turn(double radius, double& angle) const {
    const auto g = [&](double a) {
      const PlanePoint q = clamped(towards(at_, a, radius));
      return side_ * f_(q.x, q.y);
    };
    double a = angle, ga = g(a);
    if (!std::isfinite(ga)) return false;
    if (ga == 0) return true;
    // g > 0 lies to the left: turn right until it is negative, or left until it is positive
    const double sense = ga > 0 ? -1 : 1;
    double b = a, gb = ga, increment = 0.1;
    while (std::abs(b - angle) < 2.7) {
      a = b;
      ga = gb;
      b += sense * increment;
      gb = g(b);
      if (!std::isfinite(gb)) return false;
      if (ga == 0 || gb == 0 || (ga < 0) != (gb < 0)) {
        angle = find_root(g, {a, ga, b, gb}, 1e-4);
        return std::isfinite(angle);
      }
      increment = std::min(0.35, 2 * increment);
    }
    return false;
  }

  const PlaneFunction& f_;
  double step_;
  PlanePoint start_, at_{}, next_{};
  double guess_, side_ = 1;
  bool on_border_;
};

// A place to start from: f changes its sign between a and b.
struct Edge {
  PlanePoint a, b;
  double fa, fb;
  bool border;              // lies on the border
  bool small = false;       // of a closed piece that no edge of the lattice crosses
  double heading() const {  // of the line, with f positive on the left
    return std::atan2(b.y - a.y, b.x - a.x) + (fb > fa ? -M_PI / 2 : M_PI / 2);
  }
};

// Edges with a change of sign, those of the border first.
std::vector<Edge> lattice_edges(const Lattice& lattice) {
  std::vector<Edge> edges;
  const int cells = lattice.cells;
  const double width = 1. / cells;
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i)
      for (const auto& [di, dj] : {std::pair<int, int>{1, 0}, {0, 1}}) {
        if (i + di > cells || j + dj > cells) continue;
        const double fa = lattice.at(i, j), fb = lattice.at(i + di, j + dj);
        if (!(fa * fb < 0) && !(fa == 0 && fb != 0)) continue;
        const bool border = di ? (j == 0 || j == cells) : (i == 0 || i == cells);
        edges.push_back({{i * width, j * width}, {(i + di) * width, (j + dj) * width}, fa, fb, border});
      }
  std::stable_partition(edges.begin(), edges.end(), [](const Edge& e) { return e.border; });
  return edges;
}

// A place of the lattice where |f| is least among its neighbours, none of which has another sign or no value.
struct Minimum {
  PlanePoint at;
  double value;
};

// The lowest eight.
std::vector<Minimum> lattice_minima(const Lattice& lattice) {
  const int cells = lattice.cells;
  std::vector<Minimum> minima;
  const auto is_minimum = [&](int i, int j) {
    const double here = lattice.at(i, j);
    bool flat = true;
    if (here == 0 || !std::isfinite(here)) return false;
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di) {
        if (i + di < 0 || i + di > cells || j + dj < 0 || j + dj > cells || (di == 0 && dj == 0)) continue;
        const double ratio = lattice.at(i + di, j + dj) / here;
        if (!(ratio >= 1)) return false;
        flat = flat && ratio < 1 + 1e-9;
      }
    return !flat;
  };
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i)
      if (is_minimum(i, j)) minima.push_back({{double(i) / cells, double(j) / cells}, lattice.at(i, j)});
  std::sort(minima.begin(), minima.end(),
            [](const Minimum& a, const Minimum& b) { return std::abs(a.value) < std::abs(b.value); });
  if (minima.size() > 8) minima.resize(8);
  return minima;
}

// Makes |f| smaller from a minimum of the lattice on, by a pattern of four neighbours that shrinks, until f
// changes its sign. Empty where it does not.
std::optional<Edge> fall_through_zero(const PlaneFunction& f, const Minimum& from, double width) {
  PlanePoint p = from.at;
  double now = from.value, reach = width / 2;
  for (int tries = 0; tries < 100 && reach > 1e-4 * width && now * from.value > 0;) {
    PlanePoint better = p;
    double best = now;
    for (const auto& [dx, dy] : {std::pair<double, double>{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      const PlanePoint q = clamped({p.x + reach * dx, p.y + reach * dy});
      const double there = f(q.x, q.y);
      ++tries;
      if (!(there / from.value < best / from.value)) continue;
      best = there;
      better = q;
    }
    if (best == now) reach /= 2;
    p = better;
    now = best;
  }
  if (!(now * from.value < 0)) return std::nullopt;
  return Edge{p, from.at, now, from.value, false, true};
}

// Turns edges into pieces, each piece once.
class CurveSearch {
 public:
  CurveSearch(const PlaneFunction& f, double width, const LevelCurveSettings& settings)
      : f_(f), sure_(settings.sure ? settings.sure : f), checks_(bool(settings.sure)), width_(width),
        step_(std::min(0.5 * width, settings.step)), start_(settings.start) {}

  LevelCurve found;

  void from(Edge e) {
    const PlanePoint about = between(e.a, e.b, e.fa / (e.fa - e.fb));  // a straight line's guess of the zero
    if (known(about, (e.small ? 0.01 : 0.05) * width_)) return;
    if (checks_ && !e.small) {
      e.fa = sure_(e.a.x, e.a.y);
      e.fb = sure_(e.b.x, e.b.y);
      if (!(e.fa * e.fb <= 0)) return;
    }
    const std::optional<PlanePoint> start = zero_on(e);
    if (!start || known(*start, (e.small ? 0.02 : 0.1) * width_)) return;
    if (e.small)
      small_piece(e, *start);
    else
      piece(e, *start);
  }

 private:
  bool known(PlanePoint p, double reach) const {
    for (const CurvePiece& piece : found.pieces)
      for (std::size_t k = 0; k + 1 < piece.points.size(); ++k)
        if (distance_to_segment(p, piece.points[k], piece.points[k + 1]) < reach) return true;
    return false;
  }

  // The zero on an edge, again where a sure value at it shows that f has changed.
  std::optional<PlanePoint> zero_on(const Edge& e) const {
    const auto at = [&](double t) { return between(e.a, e.b, t); };
    const auto along = [&](double t) { return f_(at(t).x, at(t).y); };
    double t = find_root(along, {0, e.fa, 1, e.fb}, start_);
    for (int again = 0; again < 3 && checks_ && std::isfinite(t); ++again) {
      const double before = t;
      if (std::abs(sure_(at(t).x, at(t).y)) < 1e-9) break;
      t = find_root(along, {0, e.fa, 1, e.fb}, start_);
      if (std::abs(t - before) < 1e-8) break;
    }
    return std::isfinite(t) ? std::optional<PlanePoint>(at(t)) : std::nullopt;
  }

  // A closed piece between the places of the lattice: by ever shorter steps.
  void small_piece(const Edge& e, PlanePoint start) {
    CurvePiece piece;
    for (double step = width_ / 4; step > 1e-4 * width_ && !piece.closed; step /= 4) {
      FunctionLine fine(f_, step, start, e.heading(), false);
      piece.closed =
          follow(fine, start, fine.begin(true), {step, step, 400}, piece.points) == LineEnd::closed;
    }
    if (piece.closed)
      found.pieces.push_back(std::move(piece));
    else
      found.lost.push_back(start);
  }

  void piece(const Edge& e, PlanePoint start) {
    FunctionLine line(f_, step_, start, e.heading(), e.border);
    CurvePiece piece = follow_both_ways(line, start, {step_, step_});
    if (piece.points.size() > 1 || !piece.stuck.empty()) found.pieces.push_back(std::move(piece));
  }

  const PlaneFunction& f_;
  PlaneFunction sure_;
  bool checks_;
  double width_, step_, start_;
};

}  // namespace

LevelCurve level_curve(const PlaneFunction& f, const Lattice& lattice, const LevelCurveSettings& settings) {
  const double width = 1. / lattice.cells;
  CurveSearch search(f, width, settings);
  std::vector<Edge> edges = lattice_edges(lattice);
  for (const Minimum& m : lattice_minima(lattice))
    if (const auto edge = fall_through_zero(f, m, width)) edges.push_back(*edge);
  for (const Edge& e : edges) search.from(e);
  return std::move(search.found);
}

Placed put_on_curve(const PlaneFunction& f, PlanePoint at, PlanePoint across, double& slope, double jump) {
  const auto off = [&](double d) { return clamped({at.x + d * across.x, at.y + d * across.y}); };
  const auto g = [&](double d) { return f(off(d).x, off(d).y); };
  const double here = g(0);
  const double d =
      root_near(g, 0, here, std::isfinite(slope) ? -here / slope : 1e-5, 1e-7, 0.1, &slope, jump);
  return std::isfinite(d) ? Placed{off(d), true} : Placed{clamped(at), false};
}

void place_evenly(const PlaneFunction& f, const std::vector<CurvePiece>& pieces, PetscInt points,
                  const TakePlace& take, double jump) {
  const std::vector<std::vector<CurvePlace>> all = even_places(pieces, points);
  for (std::size_t number = 0; number < all.size(); ++number) {
    double slope = std::nan("");
    for (std::size_t k = 0; k < all[number].size(); ++k) {
      double border = std::nan("");
      const CurvePlace& place = all[number][k];
      take(number, k, all[number].size(), place,
           put_on_curve(f, place.at, place.across, place.border ? border : slope, jump));
    }
  }
}

double distance(PlanePoint a, PlanePoint b) { return std::hypot(a.x - b.x, a.y - b.y); }

PlanePoint towards(PlanePoint p, double angle, double radius) {
  return {p.x + radius * std::cos(angle), p.y + radius * std::sin(angle)};
}

double distance_to_segment(PlanePoint p, PlanePoint a, PlanePoint b) {
  const double dx = b.x - a.x, dy = b.y - a.y, l = dx * dx + dy * dy;
  return distance(p,
                  between(a, b, l > 0 ? std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / l, 0., 1.) : 0));
}

LineEnd follow(PlaneLine& line, PlanePoint start, PlaneLine::Way way, const StepSettings& settings,
               std::vector<PlanePoint>& points) {
  constexpr double shortest = 1e-5;
  points = {start};
  if (way.leads == PlaneLine::Way::outwards) return LineEnd::border;
  if (way.leads == PlaneLine::Way::unknown) return LineEnd::stuck;
  const double longest = settings.longest;
  double heading = way.heading, radius = settings.first;
  bool corrected = false;
  for (int count = 0; count < settings.most;) {
    const PlanePoint p = points.back();
    const std::optional<PlaneLine::NextPoint> next = line.ahead(radius, heading);
    if (!next) {
      std::optional<PlanePoint> again;
      if (!corrected && points.size() > 1) again = line.corrected(heading);
      corrected = corrected || points.size() > 1;
      if (again)
        points.back() = *again;
      else if (line.vanishes())
        return LineEnd::vanishes;
      else if ((radius /= 4) < shortest)
        return LineEnd::stuck;
      continue;
    }
    const double bend = std::remainder(next->heading - heading, 2 * M_PI);
    if (std::abs(bend) > 0.5 && radius > longest / 32) {  // a corner, which a long step would cut
      radius /= 2;
      continue;
    }
    line.accept();
    ++count;
    corrected = false;
    points.push_back(next->at);
    if (next->border) return LineEnd::border;
    // of two sides of a thin region that pass near each other only one runs the way of the start
    if (count > 3 && std::cos(next->heading - way.heading) > 0 &&
        distance_to_segment(start, p, next->at) < 0.5 * distance(p, next->at)) {
      points.back() = start;
      return LineEnd::closed;
    }
    // fewer steps where the line runs straight, more where it turns
    const double factor = std::abs(bend) > 0.4 ? 0.5 : std::abs(bend) < 0.1 ? 2 : 1;
    radius = std::clamp(factor * radius, longest / 64, longest);
    heading = next->heading + (std::abs(bend) < 0.4 ? bend : 0);
  }
  return LineEnd::steps;
}

CurvePiece follow_both_ways(PlaneLine& line, PlanePoint start, const StepSettings& settings) {
  CurvePiece piece;
  std::array<std::vector<PlanePoint>, 2> ways;
  for (const bool forwards : {true, false}) {
    std::vector<PlanePoint>& points = ways[forwards ? 1 : 0];
    const LineEnd end = follow(line, start, line.begin(forwards), settings, points);
    piece.closed = end == LineEnd::closed;
    if (piece.closed) {
      piece.points = std::move(points);
      piece.stuck.clear();
      return piece;
    }
    if (end == LineEnd::stuck || end == LineEnd::steps) piece.stuck.push_back(points.back());
  }
  piece.points = joined(ways[0], ways[1]);
  return piece;
}

double length(const CurvePiece& piece) {
  double sum = 0;
  for (std::size_t k = 0; k + 1 < piece.points.size(); ++k)
    sum += distance(piece.points[k], piece.points[k + 1]);
  return sum;
}

namespace {

std::vector<CurvePlace> places_of(const CurvePiece& piece, int count) {
  std::vector<CurvePlace> places;
  const double whole = length(piece);
  std::size_t k = 0;
  double before = 0;
  for (int i = 0; i < count; ++i) {
    const double target = whole * i / (piece.closed ? count : count - 1);
    while (k + 2 < piece.points.size() && before + distance(piece.points[k], piece.points[k + 1]) < target) {
      before += distance(piece.points[k], piece.points[k + 1]);
      ++k;
    }
    const PlanePoint a = piece.points[k], b = piece.points[k + 1];
    const double l = std::max(distance(a, b), 1e-300), part = std::clamp((target - before) / l, 0., 1.);
    const PlanePoint q = between(a, b, part);
    const bool on_x = q.x <= 0 || q.x >= 1, on_y = q.y <= 0 || q.y >= 1;
    PlanePoint across{-(b.y - a.y) / l, (b.x - a.x) / l};
    if (on_x) across = {0, 1};
    if (on_y) across = {1, 0};
    places.push_back({q, across, on_x || on_y, target, k, part});
  }
  return places;
}

}  // namespace

std::vector<std::vector<CurvePlace>> even_places(const std::vector<CurvePiece>& pieces, PetscInt points) {
  double total = 0;
  for (const CurvePiece& piece : pieces) total += length(piece);
  std::vector<std::vector<CurvePlace>> places(pieces.size());
  for (std::size_t number = 0; number < pieces.size(); ++number) {
    const CurvePiece& piece = pieces[number];
    if (piece.points.size() < 2) continue;
    const long own = std::lround(double(points) * length(piece) / total);
    places[number] = places_of(piece, std::max(piece.closed ? 8 : 2, int(own)));
  }
  return places;
}

}  // namespace stickslip
