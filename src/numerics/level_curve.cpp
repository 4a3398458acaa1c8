#include "stickslip/numerics/level_curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

double distance(PlanePoint a, PlanePoint b) { return std::hypot(a.x - b.x, a.y - b.y); }

namespace {

PlanePoint clamped(PlanePoint p) { return {std::clamp(p.x, 0., 1.), std::clamp(p.y, 0., 1.)}; }
bool inside(PlanePoint p) { return p.x >= 0 && p.x <= 1 && p.y >= 0 && p.y <= 1; }
PlanePoint towards(PlanePoint p, double angle, double radius) {
  return {p.x + radius * std::cos(angle), p.y + radius * std::sin(angle)};
}
PlanePoint between(PlanePoint a, PlanePoint b, double t) {
  return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
}

double distance_to_segment(PlanePoint p, PlanePoint a, PlanePoint b) {
  const double dx = b.x - a.x, dy = b.y - a.y, l = dx * dx + dy * dy;
  return distance(p,
                  between(a, b, l > 0 ? std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / l, 0., 1.) : 0));
}

// Follows the line from a point on it. `side` is the hand on which f is positive: 1 left, -1 right.
class CurveTracer {
 public:
  CurveTracer(const PlaneFunction& f, double step) : f_(f), step_(step) {}

  enum class End { border, closed, stuck };

  // Until the border, the start again, or a place where no way on is found.
  End follow(PlanePoint start, double heading, double side, std::vector<PlanePoint>& points,
             int most = 20000) const {
    points = {start};
    // of two sides of a thin region that pass near each other only one runs this way
    const double first = heading;
    double radius = step_;
    bool corrected = false;
    for (int count = 0; count < most;) {
      const PlanePoint p = points.back();
      double angle = heading;
      if (!turn(p, radius, side, angle)) {
        if (!corrected && points.size() > 1) {
          corrected = true;
          correct(points.back(), heading);
        } else if ((radius /= 4) < 1e-5) {
          return End::stuck;
        }
        continue;
      }
      const double bend = std::remainder(angle - heading, 2 * M_PI);
      if (std::abs(bend) > 0.5 && radius > step_ / 32) {  // a corner, which a long step would cut
        radius /= 2;
        continue;
      }
      const PlanePoint next = towards(p, angle, radius);
      ++count;
      corrected = false;
      points.push_back(clamped(next));
      if (!inside(next)) return End::border;
      if (count > 3 && std::cos(angle - first) > 0 && distance_to_segment(start, p, next) < 0.5 * radius) {
        points.back() = start;
        return End::closed;
      }
      // fewer steps where the line runs straight, more where it turns
      const double factor = std::abs(bend) > 0.4 ? 0.5 : std::abs(bend) < 0.1 ? 2 : 1;
      radius = std::clamp(factor * radius, step_ / 64, step_);
      heading = angle + (std::abs(bend) < 0.4 ? bend : 0);
    }
    return End::stuck;
  }

  // The heading of the line at a point of it, found on a small circle.
  std::optional<double> heading(PlanePoint p, double side, double guess) const {
    double angle = guess;
    for (int k = 0; k < 2; ++k, angle += M_PI)
      if (turn(p, step_ / 8, side, angle)) return angle;
    return std::nullopt;
  }

 private:
  // Puts a point back on the line where f has changed since it was found (a function that learns): the line
  // passes by.
  void correct(PlanePoint& p, double heading) const {
    double slope = std::numeric_limits<double>::quiet_NaN();
    const PlanePoint across{-std::sin(heading), std::cos(heading)};
    const Placed q = put_on_curve(f_, p, across, slope);
    if (q.found && distance(p, q.at) < 2 * step_) p = q.at;
  }

  // The angle nearest to the given one at which the line leaves the circle with f positive on `side`.
  bool turn(PlanePoint p, double radius, double side, double& angle) const {
    const auto g = [&](double a) {
      const PlanePoint q = clamped(towards(p, a, radius));
      return side * f_(q.x, q.y);
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
        follower_(f, std::min(0.5 * width, settings.step)) {}

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
    double t = find_root(along, {0, e.fa, 1, e.fb}, 1e-9);
    for (int again = 0; again < 3 && checks_ && std::isfinite(t); ++again) {
      const double before = t;
      if (std::abs(sure_(at(t).x, at(t).y)) < 1e-9) break;
      t = find_root(along, {0, e.fa, 1, e.fb}, 1e-9);
      if (std::abs(t - before) < 1e-8) break;
    }
    return std::isfinite(t) ? std::optional<PlanePoint>(at(t)) : std::nullopt;
  }

  // A closed piece between the places of the lattice: by ever shorter steps.
  void small_piece(const Edge& e, PlanePoint start) {
    CurvePiece piece;
    for (double step = width_ / 4; step > 1e-4 * width_ && !piece.closed; step /= 4) {
      const CurveTracer fine(f_, step);
      if (const auto heading = fine.heading(start, 1, e.heading()))
        piece.closed = fine.follow(start, *heading, 1, piece.points, 400) == CurveTracer::End::closed;
    }
    if (piece.closed)
      found.pieces.push_back(std::move(piece));
    else
      found.lost.push_back(start);
  }

  // Both ways from the start: f positive on the left of the way forward, on the right of the way back.
  void piece(const Edge& e, PlanePoint start) {
    CurvePiece piece;
    std::array<std::vector<PlanePoint>, 2> ways{std::vector<PlanePoint>{start},
                                                std::vector<PlanePoint>{start}};
    for (const std::size_t way : {0, 1}) {
      const double side = way == 0 ? 1 : -1, guess = e.heading() + (way == 0 ? 0 : M_PI);
      if (e.border && !inside(towards(start, guess, 1e-3))) continue;
      const auto heading = follower_.heading(start, side, guess);
      const CurveTracer::End end =
          heading ? follower_.follow(start, *heading, side, ways[way]) : CurveTracer::End::stuck;
      if (end == CurveTracer::End::stuck) piece.stuck.push_back(ways[way].back());
      piece.closed = end == CurveTracer::End::closed;
      if (piece.closed) {
        piece.points = ways[way];
        piece.stuck.clear();
        break;
      }
    }
    if (!piece.closed) {
      piece.points.assign(ways[1].rbegin(), ways[1].rend());
      piece.points.insert(piece.points.end(), ways[0].begin() + 1, ways[0].end());
    }
    if (piece.points.size() > 1 || !piece.stuck.empty()) found.pieces.push_back(std::move(piece));
  }

  const PlaneFunction& f_;
  PlaneFunction sure_;
  bool checks_;
  double width_;
  CurveTracer follower_;
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

double length(const CurvePiece& piece) {
  double sum = 0;
  for (std::size_t k = 0; k + 1 < piece.points.size(); ++k)
    sum += distance(piece.points[k], piece.points[k + 1]);
  return sum;
}

int points_of_piece(const CurvePiece& piece, PetscInt points, double total) {
  return std::max(piece.closed ? 8 : 2, int(std::lround(double(points) * length(piece) / total)));
}

std::vector<CurvePlace> even_places(const CurvePiece& piece, int count) {
  std::vector<CurvePlace> places;
  if (piece.points.size() < 2) return places;
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
    const double l = std::max(distance(a, b), 1e-300);
    const PlanePoint q = between(a, b, std::clamp((target - before) / l, 0., 1.));
    const bool on_x = q.x <= 0 || q.x >= 1, on_y = q.y <= 0 || q.y >= 1;
    PlanePoint across{-(b.y - a.y) / l, (b.x - a.x) / l};
    if (on_x) across = {0, 1};
    if (on_y) across = {1, 0};
    places.push_back({q, across, on_x || on_y});
  }
  return places;
}

Placed put_on_curve(const PlaneFunction& f, PlanePoint at, PlanePoint across, double& slope) {
  const auto off = [&](double d) { return clamped({at.x + d * across.x, at.y + d * across.y}); };
  const auto g = [&](double d) { return f(off(d).x, off(d).y); };
  const double here = g(0);
  const double d = root_near(g, 0, here, std::isfinite(slope) ? -here / slope : 1e-5, 1e-7, 0.1, &slope);
  return std::isfinite(d) ? Placed{off(d), true} : Placed{clamped(at), false};
}

void place_evenly(const PlaneFunction& f, const std::vector<CurvePiece>& pieces, PetscInt points,
                  const TakePlace& take) {
  double total = 0;
  for (const CurvePiece& piece : pieces) total += length(piece);
  for (std::size_t number = 0; number < pieces.size(); ++number) {
    if (pieces[number].points.size() < 2) continue;
    const std::vector<CurvePlace> places =
        even_places(pieces[number], points_of_piece(pieces[number], points, total));
    double slope = std::nan("");
    for (std::size_t k = 0; k < places.size(); ++k) {
      double border = std::nan("");
      const CurvePlace& place = places[k];
      take(number, k, places.size(), place,
           put_on_curve(f, place.at, place.across, place.border ? border : slope));
    }
  }
}

}  // namespace stickslip
