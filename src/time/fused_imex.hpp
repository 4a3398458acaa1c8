// A step of an implicit-explicit Runge-Kutta method with friction implicit, all stages taken tile by tile.
//
// The explicit part is D2 psi: K1 D2 psi in eta, and with viscosity between neighbours what that does to psi
// and eta; everything pointwise is implicit and solved node by node (model/implicit_kernel.hpp), to well
// below the error that a step is allowed. Where the step's error is estimated, one whose equations have
// several solutions, of which the motion need not lead to the one found, counts as not solved. Of stage i the
// implicit slope stands at 2 i, the explicit one at 2 i + 1.
#pragma once

#include <vector>

#include "time/fused_step.hpp"
#include "time/imex_tableau.hpp"
#include "time/pointwise_solve.hpp"

namespace stickslip {

class FusedImex : public TiledStep {
 public:
  FusedImex(const Model& model, const ImexTableau& method, bool sticking);

 private:
  long through(const Tile& t, const Step& step) const override;
  long stage(const Tile& t, int i, const Step& step, PetscInt begin, PetscInt end) const;
  void take_explicit(const Tile& t, int i, PetscInt begin, PetscInt end) const;
  // Whether unknown d (0 psi, 1 eta, 2 the state) has an explicit part.
  bool has_explicit(int d) const { return d == 1 || (d == 0 && viscous()); }
  int implicit_slope(int i) const { return slopes_from + 2 * i; }

  int known_;                     // columns of what an implicit equation is given
  std::vector<double> diagonal_;  // of At
  // of the stages, for unknowns without and with an explicit part
  std::vector<Row> implicit_rows_, all_rows_;
  // The new u: a stiffly accurate method has it in its last stage but for what is explicit.
  bool stiffly_accurate_;
  Row solution_, all_solution_;  // likewise
  PointwiseSolve solve_;
};

}  // namespace stickslip
