// Where sliding under a load that repeats (cycles/forced_slide.hpp) loses stability, in one parameter or two:
// the zeros of its largest growth rate ln|multiplier| over one period, and with friction that sticks the
// places where it comes to a stop.
//
// Kinds: `fold` (a multiplier passes 1), `flip` (-1: the period doubles), `torus` (a pair passes the unit
// circle), `stop` (psi comes to 0; points of one parameter, where sliding is stable until then). Alike on
// every rank, nothing communicates.
#pragma once

#include <complex>
#include <functional>
#include <string>
#include <vector>

#include "numerics/sampled_zeros.hpp"
#include "stickslip/stability/boundary.hpp"

namespace stickslip {

struct SlideStability {
  double growth = 0;                    // largest, ln|multiplier| over the period, 1/time
  std::complex<double> multiplier = 0;  // that has it
  double wavenumber = 0;                // of the wave that has it; 0: all nodes alike, or nodes that are not
  double least = 0;                     // psi along v: positive where nothing stops
  double period = 0, residual = 0;
};

// Of uniform deviations and every wave that fits the scene, as far as its grid resolves them (of the first
// hundred all, further on every fiftieth part); of nodes that are not alike, of the whole scene. Throws
// Failure where it has no slide.
SlideStability stability_of_slide(const Scene& scene);

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
  Crossing crossing(double x, double y);
  void add_stops(const std::vector<Sample>& least_at, std::vector<Crossing>& found);

  SceneAt scene_at_;
  std::vector<Axis> axes_;
  SlideStability seen_;
  bool sticks_ = false;
  std::string why_not_;
  long evaluations_ = 0;
  std::function<void()> each_;
};

}  // namespace stickslip
