// A step with all its stages taken tile by tile (tiles.hpp): of an explicit Runge-Kutta method, and of an implicit-
// explicit one that takes friction implicitly (fused_imex.hpp).
//
// PETSc's types make every stage a sweep over the whole grid: copy u, add the slopes of the earlier stages, take the
// right-hand side. Here a tile of nodes goes through all stages while it stays in the cache. The values of a node do not
// depend on the tile in which it lies, nor on the ranks, to the last bit.
#pragma once

#include <memory>
#include <vector>

#include "stickslip/model/model.hpp"
#include "time/tiles.hpp"

namespace stickslip {

class TiledStep {
 public:
  virtual ~TiledStep() = default;

  struct Outcome {
    bool finite;
    double error;        // as ErrorNorm weighs it; -1 without an estimate
    bool solved = true;  // every implicit equation, by the root that the step leads to
  };
  // `u_new` = u after a step dt; u and u_new differ. `slopes`: empty, or a Vec for every stage, to keep the slopes of u
  // for values between steps. `last_slope`: nullptr, or takes the last of them. Collective; no allocation.
  virtual Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                       const std::vector<VecHandle>& slopes, Vec last_slope = nullptr) const = 0;
  // With friction that sticks (stick.hpp): 1, -1 or 0 for every node of this rank, from now on. Collective.
  virtual void set_direction(const std::vector<double>& direction) = 0;
  // The last stage is taken at the new u: its slope is the right-hand side there.
  virtual bool last_is_solution() const = 0;
  virtual int stages() const = 0;
};

// k_i = f(u + dt sum_{j < i} A_ij k_j),  u_new = u + dt sum_i b_i k_i,  error = dt sum_i (b_i - embedded_i) k_i
struct RungeKutta {
  int stages;
  std::vector<double> A;         // stages x stages, by rows
  std::vector<double> b;
  std::vector<double> embedded;  // empty: no estimate of the error
};

class FusedStep : public TiledStep {
 public:
  // `sticking`: with friction that sticks, of which set_direction tells who rests.
  FusedStep(const Model& model, const RungeKutta& method, bool sticking = false);
  ~FusedStep() override;

  Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new, const std::vector<VecHandle>& slopes,
               Vec last_slope = nullptr) const override;
  void set_direction(const std::vector<double>& direction) override;
  bool last_is_solution() const override;
  int stages() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// The arrays of Vecs that hold slopes while a step is taken; each may be absent.
class SlopeArrays {
 public:
  SlopeArrays(const std::vector<VecHandle>& slopes, Vec last);
  ~SlopeArrays();
  SlopeArrays(const SlopeArrays&) = delete;
  SlopeArrays& operator=(const SlopeArrays&) = delete;
  // From the columns first, first + 1, ... of the tile.
  void store(const Tiles& tiles, const Tile& tile, int first, int stages) const;

 private:
  const std::vector<VecHandle>& slopes_;
  Vec last_;
  std::vector<double*> arrays_;
  double* last_array_ = nullptr;
};

}  // namespace stickslip
