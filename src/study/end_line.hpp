// Lines of special points of cycles (cycles/cycle.hpp) in the unit square of two parameters.
//
// Each point is found on a straight line across: a family of scenes of one parameter, whose cycles start from
// those of points near by. The line of points is followed as any is (numerics/level_curve.hpp). Nothing
// communicates.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/cycles/cycle.hpp"
#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/study/stick_slip_end.hpp"

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

// The end of stick-slip where the branch of its cycle ceases to attract: smooth friction, and cells of
// several nodes.
//
// Uniform motion: whether a strong slip goes on for ever is asked at samples; between two that differ the
// cycle's branch is followed from where it lives until it ceases to attract, or shrinks to nothing at a Hopf
// point of sliding. A cell: from samples where its own motion from the start settles on a cycle, the branch
// is followed both ways. In two parameters the points found are followed as lines.
class BranchEnd : public StickSlipEnd {
 public:
  BranchEnd(SceneAt scene_at, std::vector<Axis> axes, CellMotion cell)
      : StickSlipEnd(std::move(scene_at), std::move(axes)), cell_(std::move(cell)) {}

  std::vector<Crossing> points(std::vector<std::string>& notes) override;
  std::vector<Crossing> curve(PetscInt count, std::vector<std::string>& notes) override;
  double operator()(double x, double y = 0) override;
  Scene scene(double x, double y = 0) const override;
  std::string fate(double x, double y = 0) const override;
  std::vector<double> on_cycle(double x, double y = 0) const override;

 private:
  struct Branch {                 // a piece of it
    bool lives = false;           // there is a cycle that attracts at its beginning
    bool arrives = false;         // it attracts up to the end of the line
    double until = 0;             // distance up to which it attracts
    std::optional<EndPlace> end;  // what ends it; a Hopf point is none
    bool halves = false;          // its period halves further on
    bool at_hopf = false;         // it shrinks to nothing
    std::string why;              // what hinders it, where nothing ends it
  };
  bool uniform() const { return !cell_.cell; }
  PlaneScene plane() const;
  bool ends_at_hopf(PlanePoint alive, PlanePoint dead);
  Branch follow(PlanePoint from, PlanePoint to);
  // Ends on the line from a to b, in order; as many as are found.
  void ends_of_uniform(PlanePoint a, PlanePoint b, std::vector<EndPlace>& found,
                       std::vector<std::string>& notes);
  void ends_of_cell(PlanePoint a, PlanePoint b, std::vector<EndPlace>& found,
                    std::vector<std::string>& notes);
  std::optional<EndPlace> end_between(PlanePoint alive, PlanePoint dead, bool& lives,
                                      std::vector<std::string>& notes);
  Crossing crossing(const EndPlace& place, int piece) const;
  // Of a search as much as its budget allows; where that ends it, a note says so.
  void within_budget(std::vector<std::string>& notes, const std::function<void()>& search);
  void sample_square();
  void lines_of_uniform(double step, std::vector<EndLine>& lines, std::vector<std::string>& notes);
  void lines_of_cell(double step, std::vector<EndLine>& lines, std::vector<std::string>& notes);

  CellMotion cell_;
};

// The end of the stick-slip of uniform motion with friction that sticks exactly: zeros of distance_from_graze
// (cycles/cycle.hpp). Where a state lets the cycle end before, by a fold, its multiplier says where.
class GrazeEnd : public StickSlipEnd {
 public:
  GrazeEnd(SceneAt scene_at, std::vector<Axis> axes) : StickSlipEnd(std::move(scene_at), std::move(axes)) {}

  std::vector<Crossing> points(std::vector<std::string>& notes) override;
  std::vector<Crossing> curve(PetscInt count, std::vector<std::string>& notes) override;
  double operator()(double x, double y = 0) override { return distance(x, y, exact_step); }
  Scene scene(double x, double y = 0) const override;
  std::string fate(double x, double y = 0) const override;
  std::vector<double> on_cycle(double x, double y = 0) const override;

 private:
  double distance(double x, double y, double tolerance);
  Crossing crossing(double x, double y, double nx, double ny);
  PlanePoint last_digits(PlanePoint at, PlanePoint across);
  void place_fold(Crossing& c, double nx, double ny);
  bool lives(double x, double y);
  std::optional<bool> ends_at(const Crossing& c, double nx, double ny);
  void remark(const std::string& what, const Crossing& at);
  void tell_remarks(std::vector<std::string>& notes);
  void ask_motion(const std::vector<Crossing>& found, std::vector<std::string>& notes);

  struct Remark {  // what is said of places, each kind of it once
    std::string what;
    std::vector<Crossing> at;
  };
  std::vector<Remark> remarks_;
  double period_ = 0;    // of the cycle at the last evaluation
  bool passes_ = false;  // there: what it is zero of
};

}  // namespace stickslip
