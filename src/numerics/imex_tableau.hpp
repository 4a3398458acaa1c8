// The tableaus of PETSc's arkimex. The library hands none out, so that each is read off a step of the method
// itself: one of length 1 from 0 in which the explicit slope of stage j is the unit vector j, and the
// implicit one another.
#pragma once

#include <string>
#include <vector>

#include "stickslip/base/handle.hpp"
#include "numerics/stage_program.hpp"

namespace stickslip {

class ImexMethod {
 public:
  explicit ImexMethod(const std::string& subtype);
  ImexMethod(ImexMethod&&) = delete;
  const StageProgram& tableau() const { return tableau_; }
  // Weights of g_0, f_0, g_1, f_1, ... in u at the part s of the step, of a method that interpolates.
  std::vector<double> weights_at(double s) const;

 private:
  static PetscErrorCode RHSFunction(TS, PetscReal, Vec, Vec f, void* context);
  static PetscErrorCode IFunction(TS, PetscReal, Vec, Vec udot, Vec f, void* context);
  static PetscErrorCode IJacobian(TS, PetscReal, Vec, Vec, PetscReal shift, Mat, Mat J, void*);
  static PetscErrorCode PreStage(TS, PetscReal);
  static PetscErrorCode PostStage(TS, PetscReal, PetscInt, Vec* stages);
  void read(Vec from, std::vector<double>& of_explicit, std::vector<double>& of_implicit) const;

  TsHandle ts_;
  VecHandle u_;
  MatHandle J_;
  int stage_ = -1;
  std::vector<std::vector<double>> explicit_rows_, implicit_rows_;
  StageProgram tableau_;
};

}  // namespace stickslip
