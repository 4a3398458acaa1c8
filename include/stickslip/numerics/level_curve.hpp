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
#pragma once

#include <petscsys.h>

#include <functional>
#include <vector>

#include "stickslip/numerics/plane_line.hpp"

namespace stickslip {

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
