// Lines in the unit square that are followed from one point to the next: zero sets of functions
// (level_curve.hpp), special points of cycles and of trains in two parameters. What solves for a point beside
// the one where the line stands, and remembers what was solved for, is a PlaneLine; the steps along it, their
// lengths, and where it ends are the same for all. Nothing communicates but what a PlaneLine does.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <vector>

namespace stickslip {

struct PlanePoint {
  double x, y;
};
double distance(PlanePoint a, PlanePoint b);
inline bool inside(PlanePoint p) { return p.x >= 0 && p.x <= 1 && p.y >= 0 && p.y <= 1; }
inline PlanePoint clamped(PlanePoint p) { return {std::clamp(p.x, 0., 1.), std::clamp(p.y, 0., 1.)}; }
inline PlanePoint between(PlanePoint a, PlanePoint b, double part) {
  return {a.x + part * (b.x - a.x), a.y + part * (b.y - a.y)};
}
PlanePoint towards(PlanePoint p, double angle, double radius);
double distance_to_segment(PlanePoint p, PlanePoint a, PlanePoint b);

class PlaneLine {
 public:
  virtual ~PlaneLine() = default;
  // Where a way along the line goes at first: that is not known, out of the square, or inside it.
  struct Way {
    enum { unknown, outwards, inwards } leads = unknown;
    double heading = 0;  // radians, in the coordinates in which the line's steps are measured
  };
  struct NextPoint {
    PlanePoint at;
    double heading;       // from where the line stands
    bool border = false;  // it leaves the square there
  };
  // It stands at its first point again, to go forwards or backwards.
  virtual Way begin(bool forwards) = 0;
  // The point of the line about `radius` from where it stands, nearest to the direction `heading`; empty
  // where none is found.
  virtual std::optional<NextPoint> ahead(double radius, double heading) = 0;
  virtual void accept() = 0;  // it stands at the candidate
  // Where it stands put back on the line, if what it is zero of may have changed since; else empty.
  virtual std::optional<PlanePoint> corrected(double /*heading*/) { return std::nullopt; }
  // Whether the line ends where it stands, since nothing is found ahead.
  virtual bool vanishes() const { return false; }
};

struct CurvePiece {
  std::vector<PlanePoint> points;  // in order along the line; a closed piece ends with its first point
  bool closed = false;
  // Places inside the square where no way on was found, at most one an end.
  std::vector<PlanePoint> stuck;
};

enum class LineEnd { border, closed, vanishes, stuck, steps };
struct StepSettings {
  double longest;  // in units in which the whole line is of length 1 or so
  double first;
  int most = 20000;
};

// One way along the line from its first point, to the border, to the start again, to where the line vanishes
// or no way on is found, or for as many steps as there may be. Steps shorten where it turns and lengthen
// where it runs straight. Without a way inside: `points` is the start alone.
LineEnd follow(PlaneLine& line, PlanePoint start, PlaneLine::Way way, const StepSettings& settings,
               std::vector<PlanePoint>& points);

// Both ways, `ways` in order backwards and forwards: one line.
template <class Point>
std::vector<Point> joined(const std::vector<Point>& back, const std::vector<Point>& forth) {
  std::vector<Point> all(back.rbegin(), back.rend());
  all.insert(all.end(), forth.begin() + (back.empty() ? 0 : 1), forth.end());
  return all;
}
CurvePiece follow_both_ways(PlaneLine& line, PlanePoint start, const StepSettings& settings);

double length(const CurvePiece& piece);

// A place of a piece, with the direction in which to look for the line: its normal, or the border's own where
// the place stands on the border.
struct CurvePlace {
  PlanePoint at, across;
  bool border;
  double along;         // length of the piece up to it
  std::size_t segment;  // it lies between this point of the piece and the next
  double part;          // of the way from one to the other
};
// About `points` places in all, evenly over the pieces of a line, ends included (a closed piece: the first
// point once); of every piece 2 at least, of a closed one 8, of one that has no two points none.
std::vector<std::vector<CurvePlace>> even_places(const std::vector<CurvePiece>& pieces, PetscInt points);

// The zero line of a function f(x, y) on the unit square, as pieces of points. Axes of another length or kind
// are the caller's: f takes coordinates in [0, 1], and evenness is meant in them.
//
// Places to start from are the edges of a lattice on which f changes its sign, those on the border first, and
// places to which |f| falls from the lowest minima of the lattice (a closed curve smaller than a cell). From
// there the line is followed by steps on circles about the last point: the next point is the nearest place of
// the circle where f changes its sign with the positive side on the same hand as before. A circle needs no
// derivative, so that folds, and corners where another branch of f takes over, need no care of their own;
// steps shorten where the line turns.
//
// f may be NaN where it has no value: the line ends there. f may remember where it was asked last:
// neighbouring calls are for neighbouring places. Nothing communicates but what f does.

using PlaneFunction = std::function<double(double x, double y)>;

// f at (i, j)/cells, i fastest.
struct Lattice {
  int cells = 0;
  std::vector<double> values;  // (cells + 1)^2
  double at(int i, int j) const { return values[j * (cells + 1) + i]; }
};
Lattice sampled(const PlaneFunction& f, int cells);

struct LevelCurve {
  std::vector<CurvePiece> pieces;
  std::vector<PlanePoint> lost;  // where a small closed piece is too small, or too near the border, to follow
};

struct LevelCurveSettings {
  double step = 1. / 60;  // longest step
  // To which the places to start from are found.
  double start = 1e-9;
  // f with all the care that the function knows of, asked at places to start from; empty: f itself.
  PlaneFunction sure = {};
};

// Every piece that the lattice shows, each once. A closed piece with a point of the lattice inside is certain
// to be found, a smaller one where |f| falls towards it from the nearest places.
LevelCurve level_curve(const PlaneFunction& f, const Lattice& lattice, const LevelCurveSettings& settings);

// The zero of f beside a place of the curve. `slope`: that of f along `across` if known, else NaN; set to the
// last one seen. Empty where f has no zero within 0.1. f is asked at the nearest place of the square. A jump
// through zero is found to `jump`.
struct Placed {
  PlanePoint at;  // in the square
  bool found;
};
Placed put_on_curve(const PlaneFunction& f, PlanePoint at, PlanePoint across, double& slope, double jump = 0);

// `points` places in all, evenly over the pieces of a line, each put on its curve: take(number of the piece,
// k, places of the piece, place, where it was put). The slope of f goes from one place to the next, but not
// to the border, nor from it.
using TakePlace = std::function<void(std::size_t piece, std::size_t k, std::size_t places, const CurvePlace&,
                                     const Placed&)>;
void place_evenly(const PlaneFunction& f, const std::vector<CurvePiece>& pieces, PetscInt points,
                  const TakePlace& take, double jump = 0);

}  // namespace stickslip
