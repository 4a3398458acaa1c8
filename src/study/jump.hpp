// Data of the continuum that do not fit a held end: psi jumps there at t = 0, and the exact solution carries
// the jump inwards at the speed c, along x = c t (from the right end, x = L - c t), and never smears it (nu =
// 0).
//
// With J = psi behind less psi ahead, on the characteristic  dJ/dt = -(A a [F(psi + J) - F(psi)] + s delta
// J)/2,  psi, a and the state ahead of it: the waves that cross it are continuous, and so is the state, whose
// rate is bounded. What is ahead no signal from the end has reached: it is the same scene with a free end
// there.
//
// Finite differences of order p converge behind it, in psi, like h^(p/(p+1)) where friction damps the short
// waves that they shed there, like h^(1/2) where it does not; eta, which carries a mass along it, not at all.
#pragma once

#include <algorithm>
#include <optional>

#include "stickslip/options/options.hpp"
#include "stickslip/study/start.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

class Jump {
 public:
  // Where one end has such data, and one alone.
  static std::optional<Jump> of(const Scene& scene, const Start& start);

  // Where it is; it goes to and fro between the ends.
  double x(double t) const;
  // The part of the scene about it in which differences on a grid follow nothing: ahead of it six times h (c
  // t/h)^(1/(p+1)), beyond which less than 1e-6 of it is left; behind it a twentieth of the scene, or a
  // quarter of the way that it has gone where that is less.
  struct Extent {
    double from, to;
    bool covers(double place) const { return place > from && place < to; }
  };
  Extent extent(const Scene& grid, double t) const;
  // The fewest cells on which it reaches no farther ahead than behind.
  double least_cells(int order, double t) const;
  // By how much psi behind exceeds psi ahead at ts_max_time; empty once it has met the other end, or where
  // friction differs along x by more than its amplitude. Costs a run on the setting's grid. Collective.
  std::optional<double> height(const Options& options, const Setting& setting) const;

 private:
  Jump(const Scene& scene, bool from_left, double height)
      : scene_(scene), from_left_(from_left), start_(height) {}
  double ahead(const Scene& grid, double t) const;
  double behind(double t) const { return std::min(scene_.length / 20, scene_.c * t / 4); }

  Scene scene_;
  bool from_left_;
  double start_;
};

}  // namespace stickslip
