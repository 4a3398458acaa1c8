// Lines of special points of cycles (cycles/cycle.hpp) in the unit square of two parameters.
//
// Each point is found on a straight line across: a family of scenes of one parameter, whose cycles start from
// those of points near by. The line of points is followed as any is (numerics/plane_line.hpp). Nothing
// communicates.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/cycles/cycle.hpp"
#include "stickslip/numerics/plane_line.hpp"

namespace stickslip {

using PlaneScene = std::function<Scene(double x, double y)>;

struct EndPlace {
  PlanePoint at, to_life;  // to_life: unit vector across the line, to where the cycle attracts
  std::string kind;
  // its candidate is the cycle there; the parameter is the distance from `at`
  std::shared_ptr<const CycleFamily> path;
  double period = 0, amplitude = 0, residual = 0;
  double slope = 0;   // of special_test along the branch; NaN: not known
  double strong = 0;  // amplitude where the branch began on which the line's first place was found
};

// The scenes on the line through q along n, by the distance from q.
std::function<Scene(double)> scenes_across(const PlaneScene& scene, PlanePoint q, PlanePoint n);

// The special point at which the path stands, its tangent known: its candidate, at `at`.
EndPlace end_place(std::shared_ptr<CycleFamily> path, const std::string& kind, PlanePoint at,
                   PlanePoint to_life);

// All points of the line through `first`, at most `step` apart, in order; they end on the border of the
// square, at the first again, where the cycle shrinks to nothing (at a Bautin point of sliding), or where
// none is found further on, which a piece of a curve calls `stuck`.
struct EndLine {
  std::vector<EndPlace> places;
  CurvePiece piece;
};
EndLine follow_ends(const PlaneScene& scene, const EndPlace& first, double step);

// About `count` places evenly over all lines, each with the number of its line.
struct NumberedEnd {
  std::size_t line;
  EndPlace place;
};
std::vector<NumberedEnd> even_ends(const PlaneScene& scene, const std::vector<EndLine>& lines,
                                   PetscInt count);

}  // namespace stickslip
