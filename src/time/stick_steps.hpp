// Steps of friction that sticks (stick.hpp): cut where a node starts or stops, and one step from rest to
// release.
#pragma once

#include <functional>

#include "stickslip/time/stick.hpp"
#include "time/drive.hpp"
#include "time/stepper.hpp"

namespace stickslip {

class StickSteps {
 public:
  // `stepper`: what takes the steps; `fused`: the same where it is none of PETSc's, else nullptr.
  StickSteps(const Model& model, const Stepper& stepper, FusedStepper* fused, Drive& drive);

  void engage() const { stick_.engage(); }
  // At the start of a run, at u. `fixed_dt`: of a method of fixed steps, else 0.
  void start(Vec u, double fixed_dt);
  // After an accepted step, in place of telling the observer: cuts the step at the first change
  // between rest and sliding, and passes over times when everything rests. Collective.
  void after(Integrator::Step step);

 private:
  void decide(Vec u, double t);
  void decide_with_plate(Vec u, double t);
  void take_back(const Integrator::Step& step, double dt);
  void pass_rest(Vec u);

  const Model& model_;
  bool halts_;  // the plate does (Plate)
  const Stepper& stepper_;
  FusedStepper* fused_;
  Drive& drive_;
  Stick stick_;
  VecHandle landed_;  // u where the step is cut
  double fixed_dt_ = 0;
};

}  // namespace stickslip
