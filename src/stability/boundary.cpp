#include "stickslip/stability/boundary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

std::optional<double> closed_form_velocity(const Scene& s) {
  if (!s.nodes_alike() || s.friction.has_state() || s.friction.regularised || s.any_held())
    return std::nullopt;
  if (s.forced() || s.massless()) return std::nullopt;  // sliding ends where it has no force of its own
  // damping A (B + F_psi) + s delta = 0
  const double v = Friction::of(s.friction)->velocity_of_slope(-(s.B() + s.s_delta() / s.A()));
  return v >= 0 && std::isfinite(v) ? std::optional<double>(v) : std::nullopt;
}

std::string stability_word(double rate) {
  return std::isnan(rate) ? "not there"
         : rate > 0       ? "unstable"
         : rate < 0       ? "stable"
                          : "neither stable nor unstable";
}

std::string place_text(const std::vector<Axis>& axes, double x, double y) {
  std::string text = axes[0].name + " = " + number_text(axes[0].value(x));
  if (axes.size() > 1) text += ", " + axes[1].name + " = " + number_text(axes[1].value(y));
  return text;
}

void note_stuck(const std::string& line, const std::string& why, const std::vector<Axis>& axes,
                const std::vector<CurvePiece>& pieces, std::vector<std::string>& notes) {
  for (const CurvePiece& piece : pieces)
    for (const PlanePoint& p : piece.stuck)
      notes.push_back(
          fmt::format("{} stops inside the box at {}: no way on {}", line, place_text(axes, p.x, p.y), why));
}

std::vector<Bracket> zeros_shown(const std::function<double(double)>& f, const Axis& axis,
                                 std::vector<Sample>& samples, BoundaryFindings& findings) {
  for (const Bracket& run : zero_stretches(f, samples)) {
    findings.notes.push_back(fmt::format("the growth rate is 0 from {} {} to {}: sliding is {} there",
                                         axis.name, number_text(axis.value(run.a)),
                                         number_text(axis.value(run.b)), stability_word(0)));
    findings.turns.insert(findings.turns.end(), {run.a, run.b});
  }
  return brackets_of(with_touching_zeros(f, samples));
}

std::vector<Crossing> zeros_in_box(const PlaneFunction& f, const std::vector<Axis>& axes,
                                   const LineInBox& asked, PetscInt count,
                                   const std::function<Crossing(double x, double y)>& at, Samples& samples,
                                   std::vector<std::string>& notes) {
  const Lattice lattice = sampled(f, asked.cells);
  samples = {asked.cells + 1, lattice.values};
  LevelCurveSettings settings;
  settings.step = asked.step;
  settings.start = asked.start;
  const LevelCurve line = level_curve(f, lattice, settings);
  std::vector<Crossing> found;
  place_evenly(f, line.pieces, count,
               [&](std::size_t piece, std::size_t, std::size_t, const CurvePlace&, const Placed& on) {
                 if (!on.found) return;
                 found.push_back(at(on.at.x, on.at.y));
                 found.back().piece = int(piece);
               });
  note_stuck(asked.line, asked.where, axes, line.pieces, notes);
  return found;
}

namespace {

// Tells of points where a mode crosses that the grid hardly carries.
void note_short_waves(const GrowthRate& growth, const std::vector<Crossing>& points,
                      std::vector<std::string>& notes) {
  std::size_t count = 0;
  const Crossing* first = nullptr;
  for (const Crossing& c : points)
    if (growth.near_shortest(c)) {
      ++count;
      if (!first) first = &c;
    }
  if (!first) return;
  notes.push_back(
      fmt::format("at {} of {} points (first: {} = {}, frequency {:.3g}) the mode that crosses is near the "
                  "shortest wavelength that the grid resolves: a finer grid (grid_n) moves the boundary, by "
                  "`error` or more",
                  count, points.size(), growth.axes()[0].name, number_text(first->value), first->frequency));
}

// Of `points` points, every so many are counted at, for a few seconds altogether.
std::size_t counts_every(const GrowthRate& growth, std::size_t points) {
  return std::max(1., std::ceil(double(points) * growth.count_cost() / 2));
}

// A growth rate along a way through the box: the modes of one place are followed to the next, and nothing is
// counted but at the first.
struct OnTheWay {
  GrowthRate& growth;
  KnownModes known = {};
  bool lost = false;  // a mode was, since somebody set it

  std::optional<LeadingMode> leading(double x, double y) {
    const auto at =
        known.modes.empty() ? growth.followed(x, y, known) : growth.leading_from(known, x, y, false);
    lost = lost || !known.sure;
    return at;
  }
  double operator()(double x, double y) { return growth_of(leading(x, y)); }
  Crossing crossing(double x, double y) { return growth.crossing(x, y, leading(x, y)); }
  Criticality criticality(const Crossing& c) {
    return growth.criticality(c, c.kind == "hopf" ? leading(c.x, c.y) : std::nullopt);
  }
  // Modes that another grid's has there, as guesses; whatever that has not, the first time.
  void take_hints(const GrowthRate& other, const KnownModes& there, double x, double y) {
    const bool first = known.modes.empty();
    growth.take_hints(known, other, there, x, y);
    if (first) (void)growth.leading_from(known, x, y, true);
  }
};

// ---- one parameter

// The zero in a bracket. `counted`: on the place found the growing modes are counted; those that were missed
// are sought, and the zero lies further on the stable side.
Crossing zero_between(OnTheWay& way, Bracket bracket, bool counted) {
  for (int attempt = 0;; ++attempt) {
    const double x = find_root([&](double at) { return way(at, 0); }, bracket, 1e-14);
    if (std::isnan(x)) throw Failure("no steady sliding near a zero of the growth rate");
    Crossing c = way.crossing(x, 0);
    if (counted) way.growth.count_growing(c);
    if (!c.complete || *c.complete || attempt == 5) return c;
    const double f = growth_of(way.growth.leading_from(way.known, c.x, c.y, true));
    if (!(f > 0)) return c;
    (bracket.fa > 0 ? bracket.a : bracket.b) = c.x;
    (bracket.fa > 0 ? bracket.fa : bracket.fb) = f;
  }
}

// What a grid of half the spacing changes of a root: its growth rate over the slope, which is taken on the
// side where it is less.
double grid_error(OnTheWay& way, GrowthRate& fine, const Crossing& c) {
  OnTheWay there{fine};
  there.take_hints(way.growth, way.known, c.x, 0);
  const double change = there(c.x, 0) - c.growth, step = 1e-6;
  double slope = std::numeric_limits<double>::infinity();
  for (const double x : {c.x - step, c.x + step})
    if (x >= 0 && x <= 1) slope = std::min(slope, std::abs(way(x, 0) - c.growth) / step);
  return std::abs(way.growth.axes()[0].slope(c.x) * change / slope);
}

}  // namespace

std::vector<Crossing> boundary_points(GrowthRate& growth, BoundaryFindings& findings) {
  const int pieces = 32;
  const auto along = [&](double x) { return growth.followed(x); };
  std::vector<Sample> samples = samples_of_unit(along, pieces);
  findings.samples.side = pieces + 1;
  for (const Sample& sample : samples) findings.samples.growth.push_back(sample.f);
  mend_ends(along, samples);  // a threshold law at v = 0

  const std::vector<Bracket> brackets = zeros_shown(along, growth.axes()[0], samples, findings);
  const auto changes =
      std::count_if(brackets.begin(), brackets.end(), [](const Bracket& zero) { return zero.a < zero.b; });
  const std::size_t every = counts_every(growth, std::size_t(changes));
  std::size_t number = 0;
  std::vector<Crossing> roots;
  std::optional<GrowthRate> fine;
  for (const Bracket& bracket : brackets) {
    OnTheWay way{growth};
    const bool touches = bracket.a == bracket.b;
    if (touches) (void)growth.leading_from(way.known, bracket.a, 0, true);
    Crossing c = touches ? way.crossing(bracket.a, 0) : zero_between(way, bracket, number++ % every == 0);
    // what the last digit of the place leaves of it, where it is very large on one side
    const double left = 1e-12 * std::max(std::abs(bracket.fa), std::abs(bracket.fb));
    if (touches || growth.vanishes(c) || std::abs(c.growth) <= left) {
      c.criticality = way.criticality(c);
      if (roots.empty()) fine = growth.finer();
      if (fine) c.error = grid_error(way, *fine, c);
      roots.push_back(c);
    } else {
      findings.notes.push_back(
          fmt::format("the growth rate jumps through zero at {} = {}, where the slope of friction jumps (at "
                      "the end of a table) or a mode enters or leaves what the grid resolves: no boundary",
                      growth.axes()[0].name, number_text(c.value)));
    }
  }
  note_short_waves(growth, roots, findings.notes);
  return roots;
}

// ---- two parameters

namespace {

// The growth rate on a lattice over the box. In blocks of places the modes found at the first are followed
// through the others; it is counted there, and where a mode is lost. `block`: their side.
Lattice sampled_lattice(GrowthRate& growth, int cells, int block) {
  Lattice lattice{cells, std::vector<double>((cells + 1) * (cells + 1))};
  KnownModes known, first;  // the second: of the row of blocks, from which the next one is begun
  const auto sign_at = [&](double x, double y, bool counted) {
    auto at = growth.leading_from(known, x, y, counted, true);
    if (at && !counted && !known.sure) at = growth.leading_from(known, x, y, true, true);
    return growth_of(at);
  };
  for (int block_j = 0; block_j <= cells; block_j += block) {
    known = first;
    for (int block_i = 0; block_i <= cells; block_i += block)
      for (int j = block_j; j <= std::min(cells, block_j + block - 1); ++j)
        for (int k = 0; k <= std::min(cells - block_i, block - 1); ++k) {
          const int i = (j - block_j) % 2 == 0 ? block_i + k : std::min(cells, block_i + block - 1) - k;
          lattice.values[j * (cells + 1) + i] =
              sign_at(double(i) / cells, double(j) / cells, j == block_j && k == 0);
          if (i == 0 && j == block_j) first = known;
        }
  }
  return lattice;
}

// The pieces of the curve, as the tracer steps.
std::vector<CurvePiece> trace(GrowthRate& growth, PetscInt points, BoundaryFindings& findings) {
  const double cost = growth.count_cost();
  const int cells = cost > 0 ? 12 : 24;
  const int block = std::clamp(int(std::ceil((cells + 1) * std::sqrt(cost / 2.5))), 1, 4);
  const Lattice lattice = sampled_lattice(growth, cells, block);
  findings.samples = {cells + 1, lattice.values};

  const PlaneFunction f = [&](double x, double y) { return growth.followed(x, y); };
  LevelCurveSettings settings;
  settings.step = 1. / std::clamp<double>(double(points), 40., 60.);
  if (cost > 0)
    settings.sure = [&](double x, double y) {
      growth.learn(x, y);
      return growth.followed(x, y);
    };
  LevelCurve curve = level_curve(f, lattice, settings);
  for (const PlanePoint& p : curve.lost)
    findings.notes.push_back("a piece of the curve near " + place_text(growth.axes(), p.x, p.y) +
                             " is too small or too near the border to follow");
  note_stuck("the curve", "there (a point where modes of several kinds meet, or no steady sliding beyond)",
             growth.axes(), curve.pieces, findings.notes);
  curve.pieces.erase(std::remove_if(curve.pieces.begin(), curve.pieces.end(),
                                    [](const CurvePiece& piece) { return piece.points.size() < 2; }),
                     curve.pieces.end());
  return std::move(curve.pieces);
}

// Puts points of a traced curve on the curve of the scene itself.
class Placing {
 public:
  Placing(GrowthRate& growth, std::optional<GrowthRate> reduced, std::size_t points)
      : growth_{growth}, reduced_(std::move(reduced)), fine_grid_(growth.finer()),
        every_(counts_every(growth, points)) {
    if (fine_grid_) fine_.emplace(OnTheWay{*fine_grid_});
  }
  OnTheWay& growth() { return growth_; }

  std::vector<Crossing> piece(const std::vector<CurvePlace>& places) {
    slope_ = std::numeric_limits<double>::quiet_NaN();
    std::vector<Crossing> placed;
    for (std::size_t i = 0; i < places.size(); ++i) {
      placed.push_back(place(places[i]));
      bool missed = count(places[i], placed[i], i % every_ == 0);
      if (i > 0) {  // a mode taken up since the last point
        const double now = placed[i].frequency, last = placed[i - 1].frequency;
        missed = missed || std::abs(now - last) > 0.3 * std::max(now, last);
      }
      // the mode may have led at the points before, too, back to one that was counted
      for (std::size_t j = i; missed && j-- > 0 && !placed[j].complete;) {
        const Crossing old = placed[j];
        placed[j] = place(places[j]);
        placed[j].criticality = growth_.criticality(placed[j]);
        if (std::hypot(old.x - placed[j].x, old.y - placed[j].y) < 1e-9) break;
      }
      placed[i].criticality = growth_.criticality(placed[i]);
    }
    return placed;
  }

 private:
  // Counts at a point where it is due or a mode was lost, and places it again where the count finds a mode
  // that was not followed. Whether it did.
  bool count(const CurvePlace& at, Crossing& c, bool due) {
    const bool lost = std::exchange(growth_.lost, false);
    bool missed = false;
    for (int attempt = 0; due || lost; ++attempt) {
      growth_.growth.count_growing(c);
      if (!c.complete || *c.complete || attempt == 3) break;
      (void)growth_.growth.leading_from(growth_.known, c.x, c.y, true);
      c = place(at);
      missed = true;
    }
    return missed;
  }

  Crossing place(const CurvePlace& at) {
    if (reduced_ && (!hinted_ || distance(*hinted_, at.at) > 0.04)) {
      hinted_ = at.at;
      KnownModes there;
      (void)reduced_->followed(at.at.x, at.at.y, there);
      growth_.take_hints(*reduced_, there, at.at.x, at.at.y);
    }
    const PlaneFunction f = [&](double x, double y) { return growth_(x, y); };
    double slope = at.border ? std::numeric_limits<double>::quiet_NaN() : slope_;
    const Placed on = put_on_curve(f, at.at, at.across, slope);
    if (!at.border) slope_ = slope;
    Crossing c = growth_.crossing(on.at.x, on.at.y);
    const double step = -c.growth / slope;
    if (on.found && std::abs(step) > 1e-13 && std::abs(step) < 1e-8) {  // a last one of Newton's method
      const Crossing next = growth_.crossing(std::clamp(c.x + step * at.across.x, 0., 1.),
                                             std::clamp(c.y + step * at.across.y, 0., 1.));
      if (std::abs(next.growth) < std::abs(c.growth)) c = next;
    }
    if (fine_) measure_error(c, at.across, slope);
    return c;
  }

  void measure_error(Crossing& c, PlanePoint across, double slope) {
    (void)growth_.leading(c.x, c.y);
    fine_->take_hints(growth_.growth, growth_.known, c.x, c.y);
    const double change = (*fine_)(c.x, c.y) - c.growth;
    if (!std::isfinite(slope)) {  // a zero at the first attempt: from the side that lies in the box
      const PlanePoint q{c.x + 1e-6 * across.x, c.y + 1e-6 * across.y};
      const double step = q.x <= 1 && q.y <= 1 && q.x >= 0 && q.y >= 0 ? 1e-6 : -1e-6;
      slope = (growth_(c.x + step * across.x, c.y + step * across.y) - c.growth) / step;
    }
    const double moved = change == 0 ? 0 : std::abs(change / slope);
    c.error = std::abs(growth_.growth.axes()[0].slope(c.x) * across.x) * moved;
    c.error2 = std::abs(growth_.growth.axes()[1].slope(c.y) * across.y) * moved;
  }

  OnTheWay growth_;
  std::optional<GrowthRate> reduced_, fine_grid_;
  std::optional<OnTheWay> fine_;
  std::size_t every_;                 // of the points are counted
  std::optional<PlanePoint> hinted_;  // where modes of the reduced scene were taken up last
  double slope_ = 0;                  // of the growth rate across the curve at the last point
};

// The point of the curve beside the chord from one point to a neighbour, so far along it (0 to 1); nothing
// where there is none near.
std::optional<Crossing> point_between(OnTheWay& growth, const Crossing& a, const Crossing& b, double part) {
  const PlaneFunction f = [&](double x, double y) { return growth(x, y); };
  const PlanePoint at{a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)};
  const double apart = std::max(std::hypot(a.x - b.x, a.y - b.y), 1e-300);
  const PlanePoint across{-(b.y - a.y) / apart, (b.x - a.x) / apart};
  double slope = std::numeric_limits<double>::quiet_NaN();
  const Placed on = put_on_curve(f, at, across, slope);
  if (!on.found || distance(on.at, at) > apart) return std::nullopt;
  return growth.crossing(on.at.x, on.at.y);
}

// The place between two neighbouring points of the curve where the first Lyapunov coefficient passes through
// zero; nothing where its sign changes otherwise: through infinity, or by a jump as another mode takes over.
std::optional<Crossing> bautin_point(OnTheWay& growth, const Crossing& a, const Crossing& b) {
  const double before = a.criticality.coefficient, after = b.criticality.coefficient;
  if (!(before * after < 0)) return std::nullopt;
  std::optional<Crossing> last;
  const auto coefficient = [&](double part) {
    last = point_between(growth, a, b, part);
    if (!last) return std::numeric_limits<double>::quiet_NaN();
    last->criticality = growth.criticality(*last);
    const bool zero = !last->criticality.known() && last->kind == "hopf";
    return zero ? 0 : last->criticality.coefficient;
  };
  const double part = find_root(coefficient, {0, before, 1, after}, 1e-11);
  if (std::isnan(part)) return std::nullopt;
  const double left = coefficient(part);
  if (!(std::abs(left) <= 1e-6 * std::max(std::abs(before), std::abs(after)))) return std::nullopt;
  return last;
}

// The place between two neighbouring points of the curve where another mode takes over, by halving; the point
// there has the mode of the second. Nothing where their frequencies are alike, or where that of one mode
// changes steadily from one to the other: then it comes to be the same at both ends of what is left, while a
// jump stays.
std::optional<Crossing> meeting(OnTheWay& growth, Crossing a, Crossing b) {
  const double scale = std::max(a.frequency, b.frequency), other = 0.3 * scale, same = 1e-3 * scale;
  const auto apart = [](const Crossing& p, const Crossing& q) { return std::abs(p.frequency - q.frequency); };
  if (!(apart(a, b) > other)) return std::nullopt;
  for (int k = 0; k < 24; ++k) {
    const std::optional<Crossing> between = point_between(growth, a, b, 0.5);
    if (!between) break;
    (apart(a, *between) < apart(*between, b) ? a : b) = *between;
    if (apart(a, b) < same) return std::nullopt;
  }
  return b;
}

}  // namespace

std::vector<Crossing> boundary_curve(GrowthRate& growth, PetscInt points, BoundaryFindings& findings) {
  std::optional<GrowthRate> reduced = growth.reduced();
  const std::vector<CurvePiece> pieces = trace(reduced ? *reduced : growth, points, findings);
  const std::vector<std::vector<CurvePlace>> places = even_places(pieces, points);
  Placing placing(growth, std::move(reduced), points);
  std::vector<Crossing> result;
  int jumps = 0, symmetric = 0;
  for (std::size_t number = 0; number < pieces.size(); ++number) {
    for (Crossing& c : placing.piece(places[number])) {
      c.piece = int(number);
      if (!growth.vanishes(c)) {
        ++(LinearisedOperator(growth.scene(c.x, c.y)).neutral() ? symmetric : jumps);
        continue;
      }
      if (!result.empty() && result.back().piece == c.piece) {
        const std::optional<Crossing> change = meeting(placing.growth(), result.back(), c);
        c.switched = change.has_value();
        if (change && findings.meetings.size() < 16) findings.meetings.push_back(*change);
        if (const auto bautin = bautin_point(placing.growth(), result.back(), c))
          findings.special.push_back({"bautin", *bautin});
      }
      result.push_back(c);
    }
  }
  note_short_waves(growth, result, findings.notes);
  if (symmetric > 0)
    findings.notes.push_back(
        "the curve ends where model_k0 = 0: the mode that crosses becomes the symmetry of sliding "
        "at any velocity (lambda = 0)");
  if (jumps > 0)
    findings.notes.push_back(std::to_string(jumps) +
                             " points of the curve are left out: the growth rate jumps through "
                             "zero there, where the slope of friction jumps (at the end of a table) or a "
                             "mode enters or leaves what the grid resolves");
  return result;
}

}  // namespace stickslip
