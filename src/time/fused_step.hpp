// A step with all its stages taken tile by tile (tiles.hpp): of an explicit Runge-Kutta method, and of an
// implicit- explicit one that takes friction implicitly (fused_imex.hpp).
//
// PETSc's types make every stage a sweep over the whole grid: copy u, add the slopes of the earlier stages,
// take the right-hand side. Here a tile of nodes goes through all stages while it stays in the cache. The
// values of a node do not depend on the tile in which it lies, nor on the ranks, to the last bit.
#pragma once

#include <vector>

#include "stickslip/model/model.hpp"
#include "time/tile_kernels.hpp"
#include "time/tiles.hpp"

namespace stickslip {

class TiledStep : public StepTaker {
 public:
  Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
               const std::vector<VecHandle>& slopes, Vec last_slope = nullptr, double t = 0) const override;
  void set_direction(const std::vector<double>& direction) override { tiles_.set_direction(direction); }
  bool last_is_solution() const override { return last_is_solution_; }
  int stages() const override { return stages_; }

 protected:
  static constexpr int slopes_from = 2;  // columns of Tiles: the slopes of the stages, one behind the other

  // `slopes`: of a stage; `others`: columns behind the slopes.
  TiledStep(const Model& model, int stages, int slopes, int others, bool sticking);
  struct Step {
    double dt;
    const ErrorNorm& norm;
    bool estimate;
    int taken;  // stages whose slope is needed: all, or all but the last
    double t;
  };
  // All stages on a tile; the new values end in columns 1. Returns how many equations are left unsolved.
  virtual long through(const Tile& t, const Step& step) const = 0;
  // On [begin, end) of the values in columns `index`: K1 D2 psi (D2 psi where neighbours have viscosity) into
  // the eta of columns `slope`, where psi holds half_width more nodes at either side; and the sum over all
  // terms, with what stands in that eta.
  void stretch(const Tile& t, int index, int slope, PetscInt begin, PetscInt end) const;
  void add_pointwise(const Tile& t, int index, int slope, const kernel::Coefficients& c, PetscInt begin,
                     PetscInt end) const;
  // The coefficients at stage i, with the plate's velocity then.
  kernel::Coefficients at_stage(const Step& step, int i) const;
  // psi of a held node stands, and in the continuum eta, which is output, does too.
  void hold(const Tile& t, int slope, PetscInt node) const;
  // Node i of the column for unknown d.
  double* at(const Tile& t, int index, int d, PetscInt i) const {
    return tiles_.column(index, d) + (i - t.from);
  }
  bool viscous() const { return N_ > 0; }
  bool is_continuum() const { return tiles_.model().scene().form == Form::continuum; }

  int stages_, slopes_;
  Tiles tiles_;
  Row error_;  // empty: no estimate of the error
  bool last_is_solution_ = false;
  std::vector<double> times_;  // of the stages, in parts of the step
  // how much of dt v'(t) at the start of the step the stages see besides; empty: nothing
  std::vector<double> rates_;
  kernel::Coefficients coefficients_;
  double K1_, N_;  // where neighbours have viscosity

 private:
  int driving_;  // then a column: eta + N D2 psi
  tile::Stencil stencil_;
  tile::Pointwise pointwise_;
};

// k_i = f(u + dt sum_{j < i} A_ij k_j),  u_new = u + dt sum_i b_i k_i,  error = dt sum_i (b_i - embedded_i)
// k_i
struct RungeKutta {
  int stages;
  std::vector<double> A;  // stages x stages, by rows
  std::vector<double> b;
  std::vector<double> embedded;  // empty: no estimate of the error
};

// dv/dt of the plate at t, in the piece of the load that Model::begin_load() has said; 0 without a load.
double plate_acceleration(const Model& model, double t);

class FusedStep : public TiledStep {
 public:
  // `sticking`: with friction that sticks, of which set_direction tells who rests.
  FusedStep(const Model& model, const RungeKutta& method, bool sticking = false)
      : FusedStep(model, method, sticking, 0) {}

 protected:
  FusedStep(const Model& model, const RungeKutta& method, bool sticking, int others);
  // Before the stages of a tile, of which columns 0 hold u; returns how many equations are left unsolved.
  virtual long prepare(const Tile&, const Step&) const { return 0; }
  // What becomes of the slope of stage i on [begin, end).
  virtual void finish_stage(const Tile&, int, const Step&, PetscInt, PetscInt) const {}

 private:
  long through(const Tile& t, const Step& step) const override;

  std::vector<Row> rows_;  // of A
  Row solution_;
};

}  // namespace stickslip
