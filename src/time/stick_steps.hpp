// Steps of friction that sticks (stick.hpp): cut where a node starts or stops, and one step from rest to
// release.
#pragma once

#include <functional>

#include "stickslip/time/stick.hpp"
#include "time/advance.hpp"
#include "time/fused_ts.hpp"

namespace stickslip {

class StickSteps {
 public:
  // `fused`: what takes the steps, nullptr where PETSc does.
  StickSteps(const Model& model, TS ts, FusedTs* fused, Advance& advance);

  void engage() const { stick_.engage(); }
  // At the start of a run, at u. `fixed_dt`: of a method of fixed steps, else 0.
  void start(Vec u, double fixed_dt);
  // After an accepted step from `before`, in place of telling the observer: cuts the step at the first change
  // between rest and sliding, and passes over times when everything rests. Collective.
  void after(Integrator::Step step, Vec before);

 private:
  void decide(Vec u, double t);
  void decide_with_plate(Vec u, double t);
  void take_back(const Integrator::Step& step, Vec before, double dt);
  void go_on_from(double t, double dt);
  void pass_rest(Vec u);

  const Model& model_;
  bool halts_;  // the plate does (Plate)
  TS ts_;
  FusedTs* fused_;
  Advance& advance_;
  Stick stick_;
  VecHandle landed_;  // u where the step is cut
  double fixed_dt_ = 0;
};

}  // namespace stickslip
