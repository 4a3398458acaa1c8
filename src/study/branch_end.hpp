// The end of stick-slip where the branch of its cycle ceases to attract: smooth friction, and cells of
// several nodes.
//
// Uniform motion: whether a strong slip goes on for ever is asked at samples; between two that differ the
// cycle's branch is followed from where it lives until it ceases to attract, or shrinks to nothing at a Hopf
// point of sliding. A cell: from samples where its own motion from the start settles on a cycle, the branch
// is followed both ways. In two parameters the points found are followed as lines (end_line.hpp).
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "study/end_line.hpp"
#include "stickslip/study/stick_slip_end.hpp"

namespace stickslip {

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

}  // namespace stickslip
