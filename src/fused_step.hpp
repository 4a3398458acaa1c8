// A step of an explicit Runge-Kutta method with all its stages taken tile by tile.
//
// PETSc's rk makes every stage a sweep over the whole grid: copy u, add the slopes of the earlier stages, take the
// right-hand side. Here a tile of nodes goes through all stages while it stays in the cache. A stage looks half a
// stencil further than it is wanted, so that the first stage is taken on half_width nodes more at either side for each
// stage that follows: these nodes are computed twice, which is cheaper than to go through memory. What moves is u in
// and the new u out, once a step, and between ranks one message a step.
//
// The values of a node do not depend on the tile in which it lies, nor on the ranks, to the last bit. A small grid, and
// one with so few nodes a rank that the overlap would be most of the work, is one tile that every rank takes as a whole.
#pragma once

#include <memory>
#include <vector>

#include "stickslip/model.hpp"

namespace stickslip {

// k_i = f(u + dt sum_{j < i} A_ij k_j),  u_new = u + dt sum_i b_i k_i,  error = dt sum_i (b_i - embedded_i) k_i
struct RungeKutta {
  int stages;
  std::vector<double> A;         // stages x stages, by rows
  std::vector<double> b;
  std::vector<double> embedded;  // empty: no estimate of the error
};

class FusedStep {
 public:
  static constexpr int most_stages = 32;

  // `sticking`: with friction that sticks (stick.hpp), of which set_direction tells who rests.
  FusedStep(const Model& model, const RungeKutta& method, bool sticking = false);
  ~FusedStep();
  FusedStep(FusedStep&&) noexcept;

  // 1, -1 or 0 for every node of this rank, from now on. Collective.
  void set_direction(const std::vector<double>& direction);
  // The last stage is taken at the new u: its slope is the right-hand side there.
  bool last_is_solution() const;

  struct Outcome {
    bool finite;
    double error;  // root mean square (or largest, NORM_INFINITY) of error/(atol + rtol |u|); -1 without an estimate
  };
  // `u_new` = u after a step dt; u and u_new differ. `slopes`: empty, or a Vec for every stage, to keep k_i for output
  // between steps. `last_slope`: nullptr, or takes the last k_i. Collective; no allocation.
  Outcome take(Vec u, double dt, double atol, double rtol, NormType norm, bool estimate, Vec u_new,
               const std::vector<VecHandle>& slopes, Vec last_slope = nullptr) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
