#include "stickslip/numerics/plane_line.hpp"

#include <cmath>

namespace stickslip {

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
