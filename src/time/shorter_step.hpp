// Values between the steps of a method that takes what is stiff implicitly: those of a step that ends there.
//
// Polynomials through slopes mean nothing where what is taken implicitly acts many times within a step. The
// end of a step misses the balance that a stiff unknown keeps by the error e of the step, harmless there
// since the next step leads back to it; but its slope as the right-hand side has it is then off by the rate
// times e, for a light block by A e = f0/m e, and a cubic through slopes by up to 4/27 dt rate e. From where
// that is more than e itself (is_stiff) values are taken instead from a step of the same method from the same
// start: as stable as the step, and no less accurate.
#pragma once

#include <memory>

#include "stickslip/time/time.hpp"
#include "time/fused_ts.hpp"

namespace stickslip {

class ShorterStep {
 public:
  explicit ShorterStep(const Model& model) : model_(model) {}

  // What takes the steps: `fused`, or where there is none the library's steps of `method` with `implicit`.
  void set_up(FusedTs* fused, const Method& method, Implicit implicit, bool adaptive);
  // Whether u is needed at the beginning of each step that is asked for values within.
  bool may_be_asked() const { return asks_; }

  void forget() { looked_ = false; }  // a new step
  bool is_stiff(Vec before, Vec after, double dt);
  // u at the part s of the step from `before` at the time t to `after`; `tolerances`: of the steps.
  // Collective.
  void take(Vec before, Vec after, double t, double dt, double s, const Tolerances& tolerances,
            Vec into);

 private:
  double rate(Vec u) const;
  bool take_by_library(Vec before, double t, double length, const Tolerances& tolerances, Vec u);

  const Model& model_;
  FusedTs* fused_ = nullptr;
  MethodSpec spec_;
  Implicit implicit_ = Implicit::none;
  bool asks_ = false, adaptive_ = false;
  bool looked_ = false, stiff_ = false;
  std::unique_ptr<Integrator> own_;  // the library's, of such steps
};

}  // namespace stickslip
