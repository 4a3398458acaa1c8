// Where sliding under a load that repeats (cycles/smooth_cycle.hpp) loses stability, in one parameter or two:
// the zeros of its largest growth rate ln|multiplier| over one period, and with friction that sticks the
// places where it comes to a stop.
//
// Kinds: `fold` (a multiplier passes 1), `flip` (-1: the period doubles), `torus` (a pair passes the unit
// circle), `stop` (psi comes to 0; points of one parameter, where sliding is stable until then). Alike on
// every rank, nothing communicates.
#pragma once

#include <complex>
#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "numerics/sampled_zeros.hpp"
#include "stickslip/cycles/smooth_cycle.hpp"
#include "stickslip/stability/boundary.hpp"

namespace stickslip {

struct SlideStability {
  // largest, ln|multiplier| over the period, 1/time; 0 where that lies within its error of it
  double growth = 0;
  std::complex<double> multiplier = 0;  // that has it
  double wavenumber = 0;                // of the wave that has it; 0: all nodes alike, or nodes that are not
  double least = 0;                     // psi along v: positive where nothing stops
  double period = 0, residual = 0;
};

// Of uniform deviations and every wave that fits the scene, as far as its grid resolves them (of the first
// hundred all, further on every fiftieth part); of nodes that are not alike, of the whole scene.
// `slide`: that of the scene, of one node where all are alike.
SlideStability stability_of_slide(const Scene& scene, const SmoothCycle& slide);

class ForcedBoundary {
 public:
  ForcedBoundary(SceneAt scene_at, std::vector<Axis> axes)
      : scene_at_(std::move(scene_at)), axes_(std::move(axes)) {}

  // As boundary_points() and boundary_curve() of steady sliding.
  std::vector<Crossing> points(BoundaryFindings& findings);
  std::vector<Crossing> curve(PetscInt count, BoundaryFindings& findings);

  // The growth rate; NaN where nothing slides without a stop.
  double operator()(double x, double y = 0);
  // Why there is none, as was found last; empty where there is.
  const std::string& why_not() const { return why_not_; }
  const std::vector<Axis>& axes() const { return axes_; }
  long evaluations() const { return evaluations_; }
  void watch(std::function<void()> each) { each_ = std::move(each); }  // is called before every evaluation

 private:
  // psi along v where it is least; NaN where the slide is lost.
  double least(double x);
  bool look(double x, double y);  // fills seen_; whether there is a slide
  Scene scene_of(double x, double y) const;
  SmoothCycle slide_at(double x, double y);  // throws Failure where none is found
  SmoothCycle led_to(double x, double y) const;
  void note_lost(const std::vector<Sample>& samples, std::vector<std::string>& notes);
  Crossing crossing(double x, double y);
  void add_stops(const std::vector<Sample>& least_at, std::vector<Crossing>& found);

  SceneAt scene_at_;
  std::vector<Axis> axes_;
  SlideStability seen_;
  bool sticks_ = false;
  std::string why_not_;
  // Slides that were found, by their places on the first axis and the second: what others begin from.
  std::map<std::pair<double, double>, SmoothCycle> slides_;
  long evaluations_ = 0;
  std::function<void()> each_;
};

}  // namespace stickslip
