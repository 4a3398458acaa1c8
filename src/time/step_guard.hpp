// What PETSc's own steppers let pass: stages and steps that are not finite, and rejected steps undone by
// subtraction.
#pragma once

#include "stickslip/time/time.hpp"

namespace stickslip {

// Its calls come from the callbacks of one TS, in the order in which that makes them.
class StepGuard {
 public:
  explicit StepGuard(const Model& model);

  // The method stands; `adaptive`: its steps can be rejected.
  void set_up(TS ts, const std::string& type, bool adaptive);
  bool undoes() const { return undoes_; }  // needs u at the beginning of every step

  void start() { started_ = false; }  // of a run
  void begin_step(TS ts);
  // Before a stage. True where this is a repetition of a rejected step, before which u is put back from
  // `before`.
  bool repeats(TS ts, Vec before);
  void after_stage(PetscInt index) { stage_ = index; }
  bool accepts(Vec u);  // a stage
  // Is every entry finite, and so far from overflow that friction and error estimates of it are? Collective.
  bool all_finite(Vec u) const;
  // Whether the new u has been looked at already, as the last stage; asked once a step.
  bool knows_solution();

 private:
  Vec work_of(Vec u);

  const Model& model_;
  double overflows_[3];  // times psi, eta, the state: what is cubed
  VecHandle work_;
  bool undoes_ = false, first_same_as_last_ = false, adaptive_ = false;
  bool started_ = false;  // a step has been accepted
  bool checked_last_ = false;
  PetscInt stage_ = 0;        // the one that was computed last
  PetscInt last_stage_ = -1;  // of rk
  PetscInt rejections_ = 0;   // seen so far
};

}  // namespace stickslip
