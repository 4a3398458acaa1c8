// Where sliding under a load that repeats (cycles/cycle.hpp) loses stability, in one parameter or two:
// the zeros of its largest growth rate ln|multiplier| over one period, and with friction that sticks the
// places where it comes to a stop.
//
// Kinds: `fold` (a multiplier passes 1), `flip` (-1: the period doubles), `torus` (a pair passes the unit
// circle), `stop` (psi comes to 0; points of one parameter, where sliding is stable until then). Alike on
// every rank, nothing communicates.
#pragma once

#include <complex>
#include <string>
#include <vector>

#include "stickslip/cycles/cycle.hpp"
#include "stickslip/numerics/roots.hpp"
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

class ForcedBoundary : public OnAxes {
 public:
  using OnAxes::OnAxes;

  // As boundary_points() and boundary_curve() of steady sliding.
  std::vector<Crossing> points(BoundaryFindings& findings);
  std::vector<Crossing> curve(PetscInt count, BoundaryFindings& findings);

  // The growth rate; NaN where nothing slides without a stop.
  double operator()(double x, double y = 0);
  // Why there is none, as was found last; empty where there is.
  const std::string& why_not() const { return why_not_; }

 private:
  // psi along v where it is least; NaN where the slide is lost.
  double least(double x);
  bool look(double x, double y);  // fills seen_; whether there is a slide
  struct Found {
    double x, y;
    SmoothCycle slide;
    bool led;  // to there, as making the load grow there did not reach it
  };
  const Found* nearest(double x, double y) const;
  SmoothCycle slide_at(double x, double y);  // throws Failure where none is found
  SmoothCycle led_to(double x, double y, const Found& from) const;
  SmoothCycle settled_from(double x, double y, const Found& from) const;
  void note_lost(const std::vector<Sample>& samples, BoundaryFindings& findings);
  Crossing crossing(double x, double y);
  void add_stops(const std::vector<Sample>& least_at, std::vector<Crossing>& found);

  SlideStability seen_;
  bool sticks_ = false;
  std::string why_not_;
  std::vector<Found> slides_;  // what others begin from
};

}  // namespace stickslip
