// A step of a one-step method with all its stages taken tile by tile (tiles.hpp): explicit, or additive with
// what is pointwise implicit.
//
// PETSc's types make every stage a sweep over the whole grid: copy u, add the slopes of the earlier stages,
// take the right-hand side. Here a tile of nodes goes through all stages while it stays in the cache. The
// values of a node do not depend on the tile in which it lies, nor on the ranks, to the last bit.
//
// The explicit part f of an additive method is D2 psi: K1 D2 psi in eta, and with viscosity between
// neighbours what that does to psi and eta; everything pointwise, g, is implicit and solved node by node
// (model/implicit_kernel.hpp), to well below the error that a step is allowed. Where the step's error is
// estimated, one whose equations have several solutions, of which the motion need not lead to the one found,
// counts as not solved.
#pragma once

#include <vector>

#include "model/loops.hpp"
#include "numerics/stage_program.hpp"
#include "stickslip/model/model.hpp"
#include "time/tiles.hpp"

namespace stickslip {

// What is pointwise, taken implicitly on a piece of a tile (model/implicit_kernel.hpp): the stage of an
// implicit-explicit step, and the middle of a leapfrog step.
class PointwiseSolve {
 public:
  PointwiseSolve(const Tiles& tiles, bool sticking);

  // Columns of the tile: what is known of the new values, z; their slope; that of the stage before, -1
  // without one. The solution y = z + h g(y) ends in columns 1, where a guess of psi and the state stands;
  // columns 0 hold the start.
  struct Where {
    int known, slope, slope_before;
  };
  struct Asked {
    const kernel::Coefficients& c;
    double h;
    double target;         // of the residual, against the scale of psi and |psi|
    const Scales& scales;
    bool strict;           // only by the root that the step leads to
  };
  // On [begin, end); psi of held nodes stands. Returns how many nodes are left unsolved.
  long operator()(const Tile& t, const Where& where, const Asked& asked, PetscInt begin, PetscInt end) const;

 private:
  long solve(const Tile& t, const Where& where, const Asked& asked, PetscInt begin, PetscInt end,
             bool held) const;

  const Tiles& tiles_;
  StageLoop solve_stage_;
};

class TiledStep : public StepTaker {
 public:
  // `sticking`: with friction that sticks, of which set_direction tells who rests.
  TiledStep(const Model& model, const StageProgram& method, bool sticking = false);
  // Slopes in the order f_0, f_1, ..., of an additive method g_0, f_0, g_1, f_1, ...
  Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
               const std::vector<VecHandle>& slopes, Vec last_slope = nullptr, double t = 0) const override;
  void set_direction(const std::vector<double>& direction) override { tiles_.set_direction(direction); }
  bool last_is_solution() const override { return last_is_new_ && !additive_; }
  int stages() const override { return int(stages_.size()); }

 private:
  static constexpr int slopes_from = 2;  // columns of Tiles: the slopes of the stages, one behind the other

  struct Step {
    double dt;
    const ErrorNorm& norm;
    bool estimate, all;  // all: every slope is asked for, not those alone of which the new u is made
    double t;
  };
  struct Range {
    PetscInt begin, end;
  };
  // The wanted nodes of a tile and what so many stencils reach beside them.
  Range around(const Tile& t, int stencils) const;
  // Stages that take f, and g; each f reaches a stencil further.
  int explicit_slopes(bool all) const;
  int implicit_slopes() const;
  // Node i of the column for unknown d.
  double* at(const Tile& t, int index, int d, PetscInt i) const {
    return tiles_.column(index, d) + (i - t.from);
  }

  struct Stage {
    // Columns of its slopes; -1: there is none, and no sum has it.
    int f = -1, g = -1;
    bool used = false;    // f, in the new u
    double diagonal = 0;  // of At
    double time = 0;      // in parts of the step
    SlopeSum sum[2];      // before it: of g alone, for unknowns without an explicit part, and of both
  };
  static std::vector<Stage> stages_of(const StageProgram& method);
  SlopeSum row_of(const double* of_f, const double* of_g, int count) const;
  // All stages on a tile; the new values end in columns 1. Returns how many equations are left unsolved.
  long through(const Tile& t, const Step& step) const;
  long values_of(const Tile& t, int i, const Step& step, Range wide, Range own) const;
  // On [begin, end) of the values in columns `index`: K1 D2 psi (D2 psi where neighbours have viscosity) into
  // the eta of columns `slope`, where psi holds half_width more nodes at either side; and the sum over
  // all terms, with what stands in that eta.
  void stretch(const Tile& t, int index, int slope, PetscInt begin, PetscInt end) const;
  void add_pointwise(const Tile& t, int index, int slope, const kernel::Coefficients& c, PetscInt begin,
                     PetscInt end) const;
  void finish_explicit(const Tile& t, int slope, PetscInt begin, PetscInt end) const;
  // What the errors in columns 0 are by SlaveErrors.
  void follow_force(const Tile& t, double dt) const;
  // The coefficients at a stage, with the plate's velocity then.
  kernel::Coefficients at_stage(const Step& step, const Stage& stage) const;
  // psi of a held node stands, and in the continuum eta, which is output, does too.
  void hold(const Tile& t, int slope, PetscInt node) const;
  bool viscous() const { return N_ > 0; }
  bool is_continuum() const { return tiles_.model().scene().form == Form::continuum; }
  // Whether unknown d (0 psi, 1 eta, 2 the state) has an explicit part.
  bool has_explicit(int d) const { return !additive_ || d == 1 || (d == 0 && viscous()); }
  static bool takes(const Stage& stage, bool all) { return stage.f >= 0 && (all || stage.used); }

  std::vector<Stage> stages_;
  int known_;    // columns of what an implicit equation is given
  int driving_;  // a column: eta + N D2 psi
  Tiles tiles_;
  kernel::Coefficients coefficients_;
  bool additive_;
  // The last stage is the new u: of an additive method but for what is explicit.
  bool last_is_new_ = false;
  double target_;    // of the implicit equations; 0: as the error norm has it
  SlopeSum solution_[2];  // as Stage::sum; where last_is_new_, what its values lack
  SlopeSum error_;   // empty: no estimate of the error
  double K1_, N_;    // where neighbours have viscosity
  PointwiseSolve solve_;
  StencilLoop stencil_;
  PointwiseLoop pointwise_;
  SlaveErrors slaves_;
};

}  // namespace stickslip
