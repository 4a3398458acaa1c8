#include "stickslip/boundary.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "stickslip/error.hpp"
#include "stickslip/stencil.hpp"

namespace stickslip {

std::optional<double> closed_form_velocity(const Scene& s) {
  const bool flat = s.left != End::velocity && s.right != End::velocity;
  if (s.spread != 0 || s.friction.state != StateLaw::none || s.friction.regularised || !flat) return std::nullopt;
  if (s.friction.law == Law::cubic) {
    const double a2 = s.form == Form::continuum ? 1 - s.s_delta() / s.gamma : 1 - s.zeta / s.f0;
    if (a2 >= 0) return std::sqrt(a2);
  }
  if (s.friction.law == Law::carlson_langer && s.form == Form::chain && s.zeta > 0 && s.zeta <= s.f0)
    return std::sqrt(s.f0 / s.zeta) - 1;
  // continuum: gamma/(1 + |v|)^2 = s delta
  if (s.friction.law == Law::carlson_langer && s.form == Form::continuum && s.s_delta() > 0 && s.s_delta() <= s.gamma)
    return std::sqrt(s.gamma / s.s_delta()) - 1;
  return std::nullopt;
}

// ---- one option ---------------------------------------------------------------------------------------------------

namespace {

// The zero of f between a and b, where f changes sign: regula falsi with halved weights (Illinois), bisection where it
// stalls. The bracket shrinks to `tolerance`, or f is zero.
double bracketed_root(const std::function<double(double)>& f, double a, double fa, double b, double fb,
                      double tolerance) {
  double x = a, last_width = std::abs(b - a);
  for (int k = 0; k < 200; ++k) {
    if (fa == 0) return a;
    if (fb == 0) return b;
    const double width = std::abs(b - a);
    if (width <= tolerance) break;
    x = (k % 4 == 3 && width > 0.5 * last_width) ? (a + b) / 2 : b - fb * (b - a) / (fb - fa);
    if (k % 4 == 3) last_width = width;
    const double edge = 0.3 * tolerance;
    if (std::abs(x - a) < edge) x = a + std::copysign(edge, b - a);
    if (std::abs(x - b) < edge) x = b + std::copysign(edge, a - b);
    const double fx = f(x);
    if (!std::isfinite(fx)) return std::numeric_limits<double>::quiet_NaN();
    if ((fx > 0) == (fb > 0)) {
      fa *= 0.5;
    } else {
      a = b;
      fa = fb;
    }
    b = x;
    fb = fx;
  }
  return b;
}

// Newton's iteration with the slope from the eigenvectors, kept in the bracket; each step is one eigenproblem.
double newton_root(GrowthRate& growth, double a, double fa, double b, double fb) {
  double x = a - fa * (b - a) / (fb - fa);
  for (int k = 0; k < 60; ++k) {
    const auto at = growth.leading(x);
    if (!at) throw Failure("no steady sliding near a zero of the growth rate");
    const double f = at->mode.value.real();
    if (f == 0) return x;
    ((f > 0) == (fa > 0) ? a : b) = x;
    double next = x - f / growth.slope(x, *at);
    if (!(next > std::min(a, b) && next < std::max(a, b))) next = (a + b) / 2;
    const double step = std::abs(next - x);
    x = next;
    if (step <= 1e-14 || std::abs(b - a) <= 1e-14) return x;
  }
  return x;
}

}  // namespace

namespace {

// The zero in a bracket. `counted`: on the place found the growing modes are counted; those that were missed are
// sought, and the zero lies further on the stable side.
Crossing zero_between(GrowthRate& growth, double a, double fa, double b, double fb, bool counted) {
  for (int attempt = 0;; ++attempt) {
    Crossing c = growth.crossing(newton_root(growth, a, fa, b, fb));
    if (counted) growth.count_growing(c);
    if (!c.complete || *c.complete || attempt == 5) return c;
    growth.seek(c.x, c.y);
    const double f = growth(c.x);
    if (!(f > 0)) return c;
    (fa > 0 ? a : b) = c.x;
    (fa > 0 ? fa : fb) = f;
  }
}

// Of `points` points, every so many are counted at, for a few seconds altogether.
std::size_t counts_every(const GrowthRate& growth, std::size_t points) {
  return std::size_t(std::max(1., std::ceil(double(points) * growth.count_cost(0.5, 0.5) / 2)));
}

}  // namespace

std::vector<Crossing> boundary_points(GrowthRate& growth, Samples& samples, std::vector<std::string>& notes) {
  const int pieces = 32;
  std::vector<double> x, f;
  for (int k = 0; k <= pieces; ++k) {
    x.push_back(double(k) / pieces);
    f.push_back(growth(x.back()));
  }
  samples = {pieces + 1, f};
  // an end without steady sliding (a threshold law at v = 0): as near to it as can be
  for (const auto& [end, inside] : {std::pair<std::size_t, double>{0, 1e-9}, {x.size() - 1, 1 - 1e-9}})
    if (std::isnan(f[end])) {
      x[end] = inside;
      f[end] = growth(inside);
    }
  // A zero that G only touches, or two close together: look at the least |G| between samples of one sign.
  for (std::size_t k = 1; k + 1 < x.size(); ++k) {
    if (!(f[k] * f[k - 1] > 0 && f[k] * f[k + 1] > 0)) continue;
    if (std::abs(f[k]) > std::abs(f[k - 1]) || std::abs(f[k]) > std::abs(f[k + 1])) continue;
    if (std::abs(f[k]) > 2 * std::max(std::abs(f[k - 1] - f[k]), std::abs(f[k + 1] - f[k]))) continue;
    double low = x[k - 1], high = x[k + 1];
    const double sign = f[k] > 0 ? 1 : -1, golden = 0.3819660112501051;
    double inner1 = low + golden * (high - low), inner2 = high - golden * (high - low);
    double f1 = sign * growth(inner1), f2 = sign * growth(inner2);
    for (int step = 0; step < 60 && f1 > 0 && f2 > 0 && high - low > 1e-9; ++step) {
      if (f1 < f2) {
        high = inner2;
        inner2 = inner1;
        f2 = f1;
        f1 = sign * growth(inner1 = low + golden * (high - low));
      } else {
        low = inner1;
        inner1 = inner2;
        f1 = f2;
        f2 = sign * growth(inner2 = high - golden * (high - low));
      }
    }
    const double least = std::min(f1, f2), where = f1 < f2 ? inner1 : inner2;
    if (least <= 1e-12) {
      x.insert(x.begin() + std::ptrdiff_t(k) + (where > x[k] ? 1 : 0), where);
      f.insert(f.begin() + std::ptrdiff_t(k) + (where > x[k + 1] ? 1 : 0),
               least <= 0 && least > -1e-12 ? 0 : sign * least);
      ++k;
    }
  }
  std::size_t changes = 0, number = 0;
  for (std::size_t k = 0; k + 1 < x.size(); ++k) changes += f[k] * f[k + 1] < 0 ? 1 : 0;
  const std::size_t every = counts_every(growth, changes);
  std::vector<Crossing> roots;
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (f[k] == 0) roots.push_back(growth.crossing(x[k]));
    if (k + 1 < x.size() && f[k] * f[k + 1] < 0) {
      const Crossing c = zero_between(growth, x[k], f[k], x[k + 1], f[k + 1], number++ % every == 0);
      if (growth.vanishes(c)) {
        roots.push_back(c);
      } else {
        notes.push_back("the growth rate jumps through zero at " + growth.axes()[0].name + " = " +
                        number_text(c.value) + ", where a mode enters or leaves what the grid resolves: no boundary");
      }
    }
  }
  return roots;
}

// ---- two options --------------------------------------------------------------------------------------------------

namespace {

struct Point {
  double x, y;
};
double distance(Point a, Point b) { return std::hypot(a.x - b.x, a.y - b.y); }
Point clamped(Point p) { return {std::clamp(p.x, 0., 1.), std::clamp(p.y, 0., 1.)}; }
bool inside(Point p) { return p.x >= 0 && p.x <= 1 && p.y >= 0 && p.y <= 1; }

double distance_to_segment(Point p, Point a, Point b) {
  const double dx = b.x - a.x, dy = b.y - a.y, l = dx * dx + dy * dy;
  const double t = l > 0 ? std::clamp(((p.x - a.x) * dx + (p.y - a.y) * dy) / l, 0., 1.) : 0;
  return distance(p, {a.x + t * dx, a.y + t * dy});
}

struct Piece {
  std::vector<Point> points;
  bool closed = false;
};

// The zero of f near 0: secant steps, the first one with `slope` (then set to the last one's; NaN or null: unknown), or
// a bracket grown about 0 where they do not settle. NaN where there is none within 0.1.
double zero_near(const std::function<double(double)>& f, double* slope) {
  double s0 = 0, f0 = f(0);
  if (f0 == 0) return 0;
  const double at_zero = f0;
  double s1 = slope && std::isfinite(*slope) ? -f0 / *slope : 1e-5;
  for (int k = 0; k < 8 && std::abs(s1) < 0.02; ++k) {
    const double f1 = f(s1), m = (f1 - f0) / (s1 - s0), step = f1 == 0 ? 0 : -f1 / m;
    if (!std::isfinite(step)) break;
    if (slope && f1 != f0) *slope = m;
    if (std::abs(step) <= 1e-7) return s1 + step;  // what is left is smaller by the change of the slope since s0
    s0 = s1;
    f0 = f1;
    s1 += step;
  }
  for (double reach = 1e-4; reach < 0.1; reach *= 4)
    for (const double s : {reach, -reach})
      if (const double there = f(s); there * at_zero <= 0) return bracketed_root(f, 0, at_zero, s, there, 1e-13);
  return std::nan("");
}

// Follows the zero line of G. The growth rate is taken at the nearest point of the box, so that a curve that leaves
// the box ends on its border. The corrector moves on a circle about the last point, by which folds and corners (where
// the leading mode changes) need no care of their own.
class Tracer {
 public:
  Tracer(GrowthRate& growth, double step) : growth_(growth), step_(step) {}

  double at(Point p) {
    p = clamped(p);
    return growth_(p.x, p.y);
  }

  // From `start` with the heading given and the unstable side on the left (side 1) or right (-1), until the border,
  // the start again, or a place where no way on is found.
  enum class End { border, closed, stuck };
  End follow(Point start, double heading, double side, std::vector<Point>& points, int most = 20000) {
    points = {start};
    const double first = heading;  // of two sides of a thin region that pass near each other only one runs this way
    double radius = step_;
    bool corrected = false;
    for (int count = 0; count < most;) {
      const Point p = points.back();
      double angle = heading;
      if (!turn(p, radius, side, angle)) {
        if (!corrected && points.size() > 1) {  // a mode found since then leads there: the curve passes by
          corrected = true;
          const Point normal{-std::sin(heading), std::cos(heading)};
          const double off = zero_near([&](double d) { return at({p.x + d * normal.x, p.y + d * normal.y}); }, nullptr);
          const Point q{p.x + off * normal.x, p.y + off * normal.y};
          if (std::isfinite(off) && std::abs(off) < 2 * step_ && inside(q)) points.back() = q;
          continue;
        }
        radius /= 4;
        if (radius < 1e-5) return End::stuck;
        continue;
      }
      const double bend = std::abs(std::remainder(angle - heading, 2 * M_PI));
      if (bend > 0.5 && radius > step_ / 32) {  // a corner, which a long step would cut
        radius /= 2;
        continue;
      }
      const Point next{p.x + radius * std::cos(angle), p.y + radius * std::sin(angle)};
      ++count;
      corrected = false;
      if (!inside(next)) {
        points.push_back(clamped(next));
        return End::border;
      }
      points.push_back(next);
      if (count > 3 && std::cos(angle - first) > 0 && distance_to_segment(start, p, next) < 0.5 * radius) {
        points.back() = start;
        return End::closed;
      }
      // fewer steps where the curve runs straight, more where it turns
      radius = std::clamp(bend > 0.4 ? radius / 2 : bend < 0.1 ? radius * 2 : radius, step_ / 64, step_);
      heading = angle + (bend < 0.4 ? std::remainder(angle - heading, 2 * M_PI) : 0);
    }
    return End::stuck;
  }

  // The heading of the curve at a zero, unstable side as above, found on a small circle.
  std::optional<double> heading(Point p, double side, double guess) {
    const double radius = step_ / 8;
    double angle = guess;
    for (int k = 0; k < 2; ++k, angle += M_PI)
      if (turn(p, radius, side, angle)) return angle;
    return std::nullopt;
  }

 private:
  // The angle nearest to the given one at which the curve leaves the circle with its unstable side on `side`.
  bool turn(Point p, double radius, double side, double& angle) {
    const auto g = [&](double a) { return side * at({p.x + radius * std::cos(a), p.y + radius * std::sin(a)}); };
    double a = angle, ga = g(a);
    if (!std::isfinite(ga)) return false;
    if (ga == 0) return true;
    // unstable (g > 0) lies to the left: turn right until it is stable, or left until it is unstable
    const double sense = ga > 0 ? -1 : 1;
    double b = a, gb = ga, increment = 0.1;
    while (std::abs(b - angle) < 2.7) {
      a = b;
      ga = gb;
      b += sense * increment;
      gb = g(b);
      if (!std::isfinite(gb)) return false;
      if (ga * gb <= 0) {
        angle = bracketed_root(g, a, ga, b, gb, 1e-4);
        return std::isfinite(angle);
      }
      increment = std::min(0.35, 2 * increment);
    }
    return false;
  }

  GrowthRate& growth_;
  double step_;
};

// The pieces of the curve, as the tracer steps.
std::vector<Piece> trace(GrowthRate& growth, PetscInt points, Samples& samples, std::vector<std::string>& notes) {
  const Sliding sample = [&] {
    for (const double x : {0.5, 0.3, 0.7, 0.1, 0.9})
      try {
        return Sliding(Scene::from(growth.options_at(x, x), true));
      } catch (const Failure&) {
      }
    throw Failure("no steady sliding anywhere in the box");
  }();
  // signs on a lattice: every edge with a change of sign is a place to start from
  const int cells = sample.exact_waves().empty() ? 12 : 24;
  const double width = 1. / cells;
  Tracer tracer(growth, std::min(0.5 * width, 1. / std::clamp<double>(double(points), 40., 60.)));
  std::vector<double> g(std::size_t((cells + 1) * (cells + 1)));
  const auto value = [&](int i, int j) -> double& { return g[std::size_t(j * (cells + 1) + i)]; };
  // In blocks of places the modes found at the first are followed through the others; it is counted there.
  const double cost = growth.count_cost(0.5, 0.5);
  const int block = std::clamp(int(std::ceil((cells + 1) * std::sqrt(cost / 2.5))), 1, 4);
  growth.count_every(2);
  growth.only_sign(true);
  for (int block_j = 0; block_j <= cells; block_j += block)
    for (int block_i = 0; block_i <= cells; block_i += block) {
      growth.count_next();
      for (int j = block_j; j <= std::min(cells, block_j + block - 1); ++j)
        for (int k = 0; k <= std::min(cells - block_i, block - 1); ++k) {
          const int i = (j - block_j) % 2 == 0 ? block_i + k : std::min(cells, block_i + block - 1) - k;
          value(i, j) = growth(i * width, j * width);
        }
    }
  growth.only_sign(false);
  growth.count_every(std::clamp(1.5 * cost, 0.01, 0.15));
  samples = {cells + 1, g};
  struct Edge {
    Point a, b;
    double ga, gb;
    bool border;
    bool small = false;  // of a closed curve that no edge of the lattice crosses
  };
  std::vector<Edge> edges;
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i)
      for (const auto& [di, dj] : {std::pair<int, int>{1, 0}, {0, 1}}) {
        if (i + di > cells || j + dj > cells) continue;
        const double ga = value(i, j), gb = value(i + di, j + dj);
        if (!(ga * gb < 0) && !(ga == 0 && gb != 0)) continue;
        const bool border = di ? (j == 0 || j == cells) : (i == 0 || i == cells);
        edges.push_back({{i * width, j * width}, {(i + di) * width, (j + dj) * width}, ga, gb, border});
      }
  std::stable_partition(edges.begin(), edges.end(), [](const Edge& e) { return e.border; });
  // Closed curves between the places of the lattice: |G| is made smaller from where it is least among its neighbours.
  std::vector<std::pair<double, Point>> least;
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i) {
      bool minimum = value(i, j) != 0 && std::isfinite(value(i, j)), flat = true;
      for (int dj = -1; dj <= 1 && minimum; ++dj)
        for (int di = -1; di <= 1 && minimum; ++di) {
          if (i + di < 0 || i + di > cells || j + dj < 0 || j + dj > cells || (di == 0 && dj == 0)) continue;
          const double ratio = value(i + di, j + dj) / value(i, j);
          minimum = ratio >= 1;  // neither smaller, nor of the other sign, nor without steady sliding
          flat = flat && ratio < 1 + 1e-9;
        }
      if (minimum && !flat) least.push_back({value(i, j), {i * width, j * width}});
    }
  std::sort(least.begin(), least.end(),
            [](const auto& a, const auto& b) { return std::abs(a.first) < std::abs(b.first); });
  if (least.size() > 8) least.resize(8);
  for (const auto& [start_value, start] : least) {
    Point p = start;
    double now = start_value, reach = width / 2;
    for (int tries = 0; tries < 100 && reach > 1e-4 * width && now * start_value > 0;) {
      Point better = p;
      double best = now;
      for (const auto& [dx, dy] : {std::pair<double, double>{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
        const Point q = clamped({p.x + reach * dx, p.y + reach * dy});
        const double there = growth(q.x, q.y);
        ++tries;
        if (!(there / start_value < best / start_value)) continue;
        best = there;
        better = q;
      }
      if (best == now) reach /= 2;
      p = better;
      now = best;
    }
    if (now * start_value < 0) edges.push_back({p, start, now, start_value, false, true});
  }

  std::vector<Piece> pieces;
  const auto known = [&](Point start, double reach) {
    return std::any_of(pieces.begin(), pieces.end(), [&](const Piece& p) {
      for (std::size_t k = 0; k + 1 < p.points.size(); ++k)
        if (distance_to_segment(start, p.points[k], p.points[k + 1]) < reach) return true;
      return false;
    });
  };
  for (Edge e : edges) {
    // a straight line's guess of the zero
    const double share = e.ga / (e.ga - e.gb);
    const Point about{e.a.x + share * (e.b.x - e.a.x), e.a.y + share * (e.b.y - e.a.y)};
    if (known(about, (e.small ? 0.01 : 0.05) * width)) continue;
    if (block > 1 && !e.small) {  // not every place was counted at
      growth.only_sign(true);
      growth.count_next();
      e.ga = growth(e.a.x, e.a.y);
      growth.count_next();
      e.gb = growth(e.b.x, e.b.y);
      growth.only_sign(false);
      if (!(e.ga * e.gb <= 0)) continue;
    }
    const auto along = [&](double t) { return growth(e.a.x + t * (e.b.x - e.a.x), e.a.y + t * (e.b.y - e.a.y)); };
    double t = bracketed_root(along, 0, e.ga, 1, e.gb, 1e-9);
    for (int again = 0; again < 3 && cost > 0; ++again) {  // with the modes that a count at the zero finds
      growth.count_next();
      const double before = t;
      if (!std::isfinite(t) || std::abs(along(t)) < 1e-9) break;
      t = bracketed_root(along, 0, e.ga, 1, e.gb, 1e-9);
      if (std::abs(t - before) < 1e-8) break;
    }
    if (!std::isfinite(t)) continue;
    const Point start{e.a.x + t * (e.b.x - e.a.x), e.a.y + t * (e.b.y - e.a.y)};
    if (known(start, (e.small ? 0.02 : 0.1) * width)) continue;
    if (e.small) {
      const double angle = std::atan2(e.b.y - e.a.y, e.b.x - e.a.x) + (e.gb > e.ga ? -M_PI / 2 : M_PI / 2);
      Piece piece;
      for (double step = width / 4; step > 1e-4 * width && !piece.closed; step /= 4) {
        Tracer fine(growth, step);
        const auto heading = fine.heading(start, 1, angle);
        if (heading) piece.closed = fine.follow(start, *heading, 1, piece.points, 400) == Tracer::End::closed;
      }
      if (piece.closed) pieces.push_back(std::move(piece));
      else
        notes.push_back("a piece of the curve near " + growth.axes()[0].name + " = " +
                        number_text(growth.axes()[0].value(start.x)) + ", " + growth.axes()[1].name + " = " +
                        number_text(growth.axes()[1].value(start.y)) +
                         " is too small or too near the border to follow");
      continue;
    }
    // the unstable side is known along the edge; the curve crosses it
    const double edge_angle = std::atan2(e.b.y - e.a.y, e.b.x - e.a.x);
    Piece piece;
    std::array<std::vector<Point>, 2> ways;
    std::array<Tracer::End, 2> ends{Tracer::End::border, Tracer::End::border};
    for (int way = 0; way < 2; ++way) {
      // unstable on the left of the way forward, on the right of the way back
      const double side = way == 0 ? 1 : -1;
      const double guess = edge_angle + (e.gb > e.ga ? -M_PI / 2 : M_PI / 2) + (way == 0 ? 0 : M_PI);
      const Point ahead{start.x + 1e-3 * std::cos(guess), start.y + 1e-3 * std::sin(guess)};
      ways[std::size_t(way)] = {start};
      if (e.border && !inside(ahead)) continue;
      const auto heading = tracer.heading(start, side, guess);
      if (!heading) {
        ends[std::size_t(way)] = Tracer::End::stuck;
        continue;
      }
      ends[std::size_t(way)] = tracer.follow(start, *heading, side, ways[std::size_t(way)]);
      if (ends[std::size_t(way)] == Tracer::End::closed) {
        piece.closed = true;
        break;
      }
    }
    if (piece.closed) {
      piece.points = ways[0].size() > 1 && ends[0] == Tracer::End::closed ? ways[0] : ways[1];
    } else {
      piece.points.assign(ways[1].rbegin(), ways[1].rend());
      piece.points.insert(piece.points.end(), ways[0].begin() + 1, ways[0].end());
      for (int way = 0; way < 2; ++way)
        if (ends[std::size_t(way)] == Tracer::End::stuck) {
          const Point p = ways[std::size_t(way)].back();
          notes.push_back("the curve stops inside the box at " + growth.axes()[0].name + " = " +
                          number_text(growth.axes()[0].value(p.x)) + ", " + growth.axes()[1].name + " = " +
                          number_text(growth.axes()[1].value(p.y)) +
                          ": no way on there (a point where modes of several kinds meet, or no steady sliding beyond)");
        }
    }
    if (piece.points.size() > 1) pieces.push_back(std::move(piece));
  }

  return pieces;
}

}  // namespace

namespace {

// The place between two neighbouring points of the curve where the mode of the second takes over from that of the
// first, by halving; the point there has the mode of one of them.
Crossing meeting(GrowthRate& growth, Crossing a, Crossing b) {
  Tracer tracer(growth, 1. / 60);
  for (int k = 0; k < 24; ++k) {
    const Point middle{(a.x + b.x) / 2, (a.y + b.y) / 2};
    const double length = std::max(distance({a.x, a.y}, {b.x, b.y}), 1e-300);
    const Point normal{-(b.y - a.y) / length, (b.x - a.x) / length};
    const auto off = [&](double s) { return Point{middle.x + s * normal.x, middle.y + s * normal.y}; };
    const double s = zero_near([&](double d) { return tracer.at(off(d)); }, nullptr);
    if (!std::isfinite(s) || std::abs(s) > length) break;
    const Point q = clamped(off(s));
    const Crossing c = growth.crossing(q.x, q.y);
    const bool like_a = a.kind == b.kind ? std::abs(c.frequency - a.frequency) < std::abs(c.frequency - b.frequency)
                                         : c.kind == a.kind;
    (like_a ? a : b) = c;
  }
  return b;
}

}  // namespace

std::vector<Crossing> boundary_curve(GrowthRate& growth, PetscInt points, Samples& samples,
                                     std::vector<std::string>& notes, std::vector<Crossing>* meetings) {
  std::optional<GrowthRate> reduced = growth.reduced();
  const std::vector<Piece> pieces = trace(reduced ? *reduced : growth, points, samples, notes);
  Tracer tracer(growth, 1. / 60);
  growth.count_every(0);

  // even points along each piece, put back onto the curve along its normal
  const auto length_of = [](const Piece& p) {
    double sum = 0;
    for (std::size_t k = 0; k + 1 < p.points.size(); ++k) sum += distance(p.points[k], p.points[k + 1]);
    return sum;
  };
  double total = 0;
  for (const Piece& p : pieces) total += length_of(p);
  std::vector<Crossing> result;
  const std::size_t every = counts_every(growth, std::size_t(points));
  int jumps = 0, symmetric = 0;
  for (std::size_t number = 0; number < pieces.size(); ++number) {
    const Piece& p = pieces[number];
    const double length = length_of(p);
    const int count = std::max(p.closed ? 8 : 2, int(std::lround(double(points) * length / total)));
    struct Seed {
      Point at, normal;
      bool border;
    };
    std::vector<Seed> seeds;
    std::size_t k = 0;
    double before = 0;
    for (int i = 0; i < count; ++i) {
      const double target = length * i / (p.closed ? count : count - 1);
      while (k + 2 < p.points.size() && before + distance(p.points[k], p.points[k + 1]) < target)
        before += distance(p.points[k], p.points[k + 1]), ++k;
      const Point a = p.points[k], b = p.points[k + 1];
      const double l = std::max(distance(a, b), 1e-300), t = std::clamp((target - before) / l, 0., 1.);
      const Point q{a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
      // along the normal, or along the border
      Point normal{-(b.y - a.y) / l, (b.x - a.x) / l};
      const bool on_x = q.x <= 0 || q.x >= 1, on_y = q.y <= 0 || q.y >= 1;
      if (on_x) normal = {0, 1};
      if (on_y) normal = {1, 0};
      seeds.push_back({q, normal, on_x || on_y});
    }
    double slope = std::nan("");
    std::optional<Point> hinted;
    const auto place = [&](std::size_t i) {
      const Seed& seed = seeds[i];
      if (reduced && (!hinted || distance(*hinted, seed.at) > 0.04)) {
        hinted = seed.at;
        growth.take_hints(*reduced, seed.at.x, seed.at.y);
      }
      const auto off = [&](double s) { return Point{seed.at.x + s * seed.normal.x, seed.at.y + s * seed.normal.y}; };
      double m = seed.border ? std::nan("") : slope;
      const double s = zero_near([&](double d) { return tracer.at(off(d)); }, &m);
      if (!seed.border) slope = m;
      const Point q = clamped(std::isfinite(s) ? off(s) : seed.at);
      Crossing c = growth.crossing(q.x, q.y);
      if (std::isfinite(s) && std::abs(c.growth) > 1e-13 && std::abs(c.growth / m) < 1e-8) {  // a last Newton step
        const Point better = clamped(off(s - c.growth / m));
        const Crossing next = growth.crossing(better.x, better.y);
        if (std::abs(next.growth) < std::abs(c.growth)) c = next;
      }
      return c;
    };
    std::vector<Crossing> placed;
    for (std::size_t i = 0; i < seeds.size(); ++i) {
      bool missed = false;
      placed.push_back(place(i));
      const bool lost = growth.doubtful();
      // again where the count finds a mode that was not followed
      for (int attempt = 0; i % every == 0 || lost; ++attempt) {
        growth.count_growing(placed[i]);
        if (!placed[i].complete || *placed[i].complete || attempt == 3) break;
        growth.seek(placed[i].x, placed[i].y);
        placed[i] = place(i);
        missed = true;
      }
      if (i > 0) {  // a mode taken up since the last point
        const double now = placed[i].frequency, last = placed[i - 1].frequency;
        missed = missed || std::abs(now - last) > 0.3 * std::max(now, last);
      }
      // the mode may have led at the points before, too, back to one that was counted
      for (std::size_t j = i; missed && j-- > 0 && !placed[j].complete;) {
        const Crossing old = placed[j];
        placed[j] = place(j);
        if (distance({old.x, old.y}, {placed[j].x, placed[j].y}) < 1e-9) break;
      }
    }
    for (Crossing& c : placed) {
      c.piece = int(number);
      if (!growth.vanishes(c)) {
        ++(Sliding(Scene::from(growth.options_at(c.x, c.y), true)).neutral() ? symmetric : jumps);
        continue;
      }
      if (!result.empty() && result.back().piece == c.piece) {
        const Crossing& last = result.back();
        const double scale = std::max(std::abs(c.frequency), std::abs(last.frequency));
        c.switched = c.kind != last.kind || std::abs(c.frequency - last.frequency) > 0.3 * scale;
        if (c.switched && meetings && meetings->size() < 16) meetings->push_back(meeting(growth, last, c));
      }
      result.push_back(c);
    }
  }
  if (symmetric > 0)
    notes.push_back("the curve ends where model_k0 = 0: the mode that crosses becomes the symmetry of sliding at any "
                    "velocity (lambda = 0)");
  if (jumps > 0)
    notes.push_back(std::to_string(jumps) + " points of the curve are left out: the growth rate jumps through zero "
                    "there, where a mode enters or leaves what the grid resolves");
  return result;
}

}  // namespace stickslip
