// A step of a Rosenbrock-W method with friction implicit, tile by tile: no Newton's method, one linear system
// at a node.
//
//     k_i = f(u + dt sum_{j < i} A_ij k_j) + dt J sum_{j <= i} Gamma_ij k_j,   u_new = u + dt sum_i b_i k_i
//
// f is the whole right-hand side; J the derivative at u of what is pointwise, a block of a node, all stages'
// own. Its order a W-method has whatever stands in J, the explicit stencil (and viscosity) left out of it. In
// w = Gamma k no product with J is left:
//     (1 - theta J) w_i = gamma (f(u + dt sum_{j < i} A'_ij w_j) - sum_{j < i} C_ij w_j),   theta = gamma dt,
//     A' = A Gamma^-1,  C = Gamma^-1,  u_new = u + dt sum_i b'_i w_i,  b' = b Gamma^-1
// which is an explicit step whose slopes are solved for. The block is eliminated by hand: eta and the state
// put into psi leave (as in model/implicit_kernel.hpp, with h = theta)
//     [a + q (F_psi + F_s theta g_psi/(1 - theta g_s))] w_psi = r_psi + q (r_eta - F_s r_s/(1 - theta g_s))
// A load v(t) (stickslip/model/load.hpp) makes the equations depend on time. With time as an unknown more
// they do not; its column of J is then f_t, and its k is 1 in every stage, so that stage i has
//     f(t + a_i dt, u + ...) + gamma_i dt f_t(t),   a_i = sum_j A_ij,  gamma_i = sum_j Gamma_ij
// which is v(t + a_i dt) + gamma_i dt v'(t) in the place of v. Without it all but W-methods fall to order 1.
//
// Where the factor is not positive the step is longer than a growing motion allows: with an estimate of the
// error it counts as not solved.
#pragma once

#include <vector>

#include "time/fused_step.hpp"

namespace stickslip {

struct RosenbrockW {
  const char* name;  // -ts_rosw_type
  int stages, order;
  std::vector<double> A, Gamma;  // stages x stages, by rows; Gamma: with one value, gamma, on its diagonal
  std::vector<double> b, embedded;
};

// That of TSROSW with this name; throws std::logic_error for those that lose their order with such a J
// (methods.hpp).
const RosenbrockW& rosenbrock_w(const std::string& name);

// gamma_i of PETSc's tableau `subtype`, which hands none out: that of a step of the method itself.
std::vector<double> rosenbrock_rates(const std::string& subtype);

class RosenbrockStep : public TiledStep {
 public:
  RosenbrockStep(const Model& model, const RosenbrockW& method, bool sticking);

 private:
  long prepare(const Tile& t, const Step& step) const override;
  void finish_stage(const Tile& t, int i, const Step& step, PetscInt begin, PetscInt end) const override;

  double gamma_;
  // columns others_: 1/factor, q, q F_s/(1 - theta g_s); behind them 1/(1 - theta g_s), theta g_psi of it
  std::vector<Row> before_;  // of -C, without its diagonal
  tile::NodeTangents tangents_;
};

}  // namespace stickslip
