// A step of an implicit-explicit Runge-Kutta method with friction implicit, all stages taken tile by tile.
//
// The explicit part is K1 D2 psi, in eta; everything pointwise is implicit and solved node by node
// (model/implicit_kernel.hpp).
#pragma once

#include "time/fused_step.hpp"
#include "time/imex_tableau.hpp"

namespace stickslip {

class FusedImex : public TiledStep {
 public:
  FusedImex(const Model& model, const ImexTableau& method, bool sticking);
  ~FusedImex() override;

  // The implicit equations are solved to well below what `norm` allows. With `estimate`, a step whose equations have
  // several solutions, of which the motion need not lead to the one found, counts as not solved.
  // `slopes`: of stage i the implicit one at 2 i, the explicit one at 2 i + 1.
  Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new, const std::vector<VecHandle>& slopes,
               Vec last_slope = nullptr) const override;
  void set_direction(const std::vector<double>& direction) override;
  bool last_is_solution() const override { return false; }
  int stages() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
