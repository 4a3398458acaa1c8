// Where the stick-slip that lives beside sliding ends: uniform motion of friction that sticks, in one parameter or two.
//
// Below the linear boundary stick-slip must begin; it need not end there. A slip begins at psi = 0 with the force at the
// threshold. Where it comes back to psi = 0 the block rests and slips again; the parameter at which it comes back just
// tangentially is the end: `graze`. With a state the cycle may also end before, by meeting an unstable one: `fold`. The
// function whose zeros are sought is distance_from_graze (cycles/stick_cycle.hpp); what lives on either side is asked of
// the motion itself.
//
// Nothing here is collective; every rank computes the same.
#pragma once

#include <petscsys.h>

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/stability/growth_rate.hpp"

namespace stickslip {

class StickSlipEnd {
 public:
  StickSlipEnd(SceneAt scene_at, std::vector<Axis> axes) : scene_at_(std::move(scene_at)), axes_(std::move(axes)) {}

  // Why the stick-slip of this scene is none of this kind; empty where it is.
  static std::string refusal(const Scene& scene);

  // Every end on the first axis, ascending in the coordinate; 33 samples show them. `kind` graze or fold, `frequency` that
  // of the cycle, `wavenumber` 0, `residual` what is left of the distance (of a fold:
  // |1 - multiplier| of the last cycle that it was placed by). `notes`: what is not as it should be.
  std::vector<Crossing> points(std::vector<std::string>& notes);
  // The curve of ends in the box of both axes, as boundary_curve has that of sliding.
  std::vector<Crossing> curve(PetscInt count, std::vector<std::string>& notes);

  // Negative where uniform motion sticks and slips from a release on; NaN where it never slips.
  double operator()(double x, double y = 0);
  // The same, sampled as Samples of boundary.hpp: side 33, or 25 squared.
  const std::vector<double>& samples() const { return samples_; }
  Scene scene(double x, double y = 0) const;  // of one node
  long evaluations() const { return evaluations_; }
  void watch(std::function<void()> each) { each_ = std::move(each); }  // is called before every evaluation

 private:
  Crossing crossing(double x, double y, double nx, double ny);
  PlanePoint last_digits(PlanePoint at, PlanePoint across);
  void place_fold(Crossing& c, double nx, double ny);
  void check(Crossing& c, double nx, double ny, std::vector<std::string>& notes);

  SceneAt scene_at_;
  std::vector<Axis> axes_;
  std::vector<double> samples_;
  long evaluations_ = 0;
  double period_ = 0;  // of the cycle at the last evaluation
  std::function<void()> each_;
};

}  // namespace stickslip
