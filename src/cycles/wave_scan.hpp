// The growth rate of waves on a cycle as a function of their wavenumber: every place where it is largest.
//
// Samples are added until the multipliers of neighbours lie next to each other, those that matter: whose
// growth could be the largest or positive. ln(multiplier)/T changes by c or so for each unit of the
// wavenumber, the speed at which anything travels; this bounds what lies between two samples, and where the
// bound passes the largest known of finite waves, the top between them is looked for. Where all nodes are
// alike the equations of a wave are real: two multipliers that turn towards each other on a circle meet on
// the real axis and part along it, which opens a band of growth beside a resonance. Between two samples that
// both show a pair beside the real axis it is looked for by the distance of the pair, squared, which passes
// through their meeting smoothly. Local to the process.
#pragma once

#include <functional>
#include <vector>

#include "stickslip/cycles/bloch.hpp"

namespace stickslip {

class WaveScan {
 public:
  struct Setting {
    double period;
    double turning;  // |d ln(multiplier)/dk| of waves, or so
    bool real;       // the multipliers come in conjugate pairs
  };
  // `first`: the wavenumber 0 and evenly spaced ones. `diffusion`: of the phase mode, which is followed from
  // 0 on until it grows at -diffusion k^2.
  WaveScan(std::function<BlochPoint(double)> at, std::vector<BlochPoint> first, double diffusion,
           const Setting& setting);

  // wavenumbers rise; every top is among them
  const std::vector<BlochPoint>& points() const { return points_; }
  // Of waves that are not on the way down from the phase mode's 0 at k = 0: what that does its diffusion
  // says.
  double largest_of_finite() const;

 private:
  bool matched(const BlochPoint& a, const BlochPoint& b) const;
  // bound on the growth between point k and the next, over the larger of theirs
  double rise_within(std::size_t k) const;
  std::size_t first_rise() const;
  void follow_phase_mode(double diffusion);
  void fill_in();
  void find_resonances();
  void find_tops();

  std::function<BlochPoint(double)> at_;
  Setting setting_;
  std::vector<BlochPoint> points_;
  double shortest_;  // wavenumbers nearer than this are not told apart
};

}  // namespace stickslip
