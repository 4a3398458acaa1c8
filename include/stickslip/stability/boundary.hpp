// Where steady sliding loses stability: the zeros of its growth rate in one parameter, and the curve of zeros
// in two.
#pragma once

#include <petscsys.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/growth_rate.hpp"

namespace stickslip {

// The growth rate sampled evenly: `side` values on each axis, the first axis fastest; NaN without steady
// sliding.
struct Samples {
  int side = 0;
  std::vector<double> growth;
};

// A place on the curve where something changes. bautin: the first Lyapunov coefficient passes through zero,
// so that a supercritical Hopf point becomes a subcritical one; a fold of oscillations begins there.
struct SpecialPlace {
  std::string kind;
  Crossing at;
};

// What is found beside the points themselves.
struct BoundaryFindings {
  Samples samples;
  std::vector<std::string> notes;  // what is not as it should be
  // The places (codimension two) where one mode takes over from another of different kind or frequency;
  // curves only.
  std::vector<Crossing> meetings;
  std::vector<SpecialPlace> special;  // curves only
};

// What a growth rate says of sliding: "stable", "unstable", neither where it is 0, or that there is none
// (NaN).
std::string stability_word(double rate);
// The values of the axes at a place of the unit square, in words.
std::string place_text(const std::vector<Axis>& axes, double x, double y);
// A note for each end of a line where no way on was found.
void note_stuck(const std::string& line, const std::string& why, const std::vector<Axis>& axes,
                const std::vector<CurvePiece>& pieces, std::vector<std::string>& notes);

// The zeros of f that samples of it on an axis show: changes of sign, and zeros that f only touches, of which
// the bracket has no width. Notes tell of intervals along which f is 0; samples right beyond them are added.
std::vector<Bracket> zeros_shown(const std::function<double(double)>& f, const Axis& axis,
                                 std::vector<Sample>& samples, std::vector<std::string>& notes);

// A line of zeros in the box, and what is said of it where it stops inside.
struct LineInBox {
  std::string line, where;
  int cells;             // of the lattice on which f is sampled
  double step;           // the longest
  double start = 1e-9;   // to which the places to start from are found
};
// About `count` points of the line on which f is 0, even along it: those that `at` makes of places of it.
std::vector<Crossing> zeros_in_box(const PlaneFunction& f, const std::vector<Axis>& axes,
                                   const LineInBox& asked, PetscInt count,
                                   const std::function<Crossing(double x, double y)>& at, Samples& samples,
                                   std::vector<std::string>& notes);

// Every zero on the first axis, ascending in the coordinate, bracketed on 33 samples and by the least
// |growth| between samples of one sign. `error` of a point: growth rate on a grid of half the spacing over
// the slope. Collective.
std::vector<Crossing> boundary_points(GrowthRate& growth, BoundaryFindings& findings);

// The curve in the box of both axes (level_curve.hpp): about `points` points, even along it in the
// coordinates, ends on the borders of the box included; several pieces, closed ones too. `error` and `error2`
// of a point: how far the modes followed move it along the curve's normal when the spacing is halved.
// Collective.
std::vector<Crossing> boundary_curve(GrowthRate& growth, PetscInt points, BoundaryFindings& findings);

// The plate velocity at which uniform sliding loses stability, in closed form, for the laws of velocity alone
// without spread: sqrt(1 - s delta/gamma), sqrt(1 - zeta/f0), sqrt(f0/zeta) - 1. Nothing for other scenes, or
// where there is none.
std::optional<double> closed_form_velocity(const Scene& scene);

}  // namespace stickslip
