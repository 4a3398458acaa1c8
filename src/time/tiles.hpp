// A grid that is passed through tile by tile: the nodes of a tile lie in columns that stay in the cache, with
// as many nodes beside them as the stages of a step reach.
//
// A stage looks half a stencil further than it is wanted, so that the first stage is taken on half_width
// nodes more at either side for each stage that follows: these nodes are computed twice, which is cheaper
// than to go through memory. What moves is u in and the new u out, once a step, and between ranks one message
// a step. A small grid, and one with so few nodes a rank that the overlap would be most of the work, is one
// tile that every rank takes as a whole.
#pragma once

#include <petscdmda.h>

#include <array>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "model/kernel.hpp"
#include "model/loops.hpp"
#include "numerics/tableau.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

// How errors are weighed: |error_i|/(absolute + relative |u_i|), root mean square or the largest.
struct ErrorNorm {
  Tolerances tolerances;
  NormType type;
};

class StepTaker {
 public:
  virtual ~StepTaker() = default;

  struct Outcome {
    bool finite;
    double error;  // as ErrorNorm weighs it; -1 without an estimate
    bool solved;   // every implicit equation, by the root that the step leads to
  };
  // `u_new` = u after a step dt; u and u_new differ. `slopes`: empty, or a Vec for every slope of the method,
  // to keep them for values between steps. `last_slope`: nullptr, or takes the last of them. `t`: where the
  // step begins, which a load alone asks for. Collective; no allocation.
  virtual Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
                       const std::vector<VecHandle>& slopes, Vec last_slope = nullptr,
                       double t = 0) const = 0;
  // With friction that sticks (stick.hpp): 1, -1 or 0 for every node of this rank, from now on. Collective.
  virtual void set_direction(const std::vector<double>& direction) = 0;
  // The last stage is taken at the new u: its slope is the right-hand side there.
  virtual bool last_is_solution() const { return false; }
  virtual int stages() const = 0;
  // Where slopes are those of other unknowns than u's: to these, and back.
  virtual void begin_sum(Vec) const {}
  virtual void end_sum(Vec) const {}
};

// What a step errs by: its new values weighed as ErrorNorm says.
class StepErrors {
 public:
  struct Sums {
    double squares = 0, largest = 0, not_finite = 0;
    double unsolved = 0;  // equations without a solution
  };
  StepErrors();
  // Adds `count` new values u of an unknown (psi 0, eta 1, the state 2) with their errors; without an
  // estimate only whether they are finite.
  void add(int unknown, const double* u, const double* errors, PetscInt count, const ErrorNorm& norm,
           bool estimate, Sums& sums) const;
  // Over all ranks, of so many unknowns. Collective.
  static StepTaker::Outcome over_ranks(MPI_Comm comm, const Sums& sums, const ErrorNorm& norm, bool estimate,
                                       double unknowns);

 private:
  std::function<double(const kernel::Weighted&)> square_;
};

// What psi and the state err by in a step where friction goes by ln psi (laws that are `steep`), so that they
// are slaves of the force.
//
// What a slave has been off by at the start of a step is gone after it, however short it is; an estimate e
// that counts it asks for ever shorter steps in vain. So (L. F. Shampine and L. S. Baca, SIAM J. Numer. Anal.
// 21 (1984) 736) the estimate goes through the equations of a stage, with h the step times their diagonal,
//     x + h A [(B + F_psi) x + F_state y] = e_psi + h A e_eta,   y - h (g_psi x + g_state y) = e_state
// which leaves e where friction is not stiff, and else says by how much psi has to differ for the force to be
// that of eta.
class SlaveErrors {
 public:
  SlaveErrors() = default;  // none
  // Of nodes by their numbers.
  SlaveErrors(const Scene& scene, const FrictionPlaces& places);

  bool any() const { return law_.steep; }
  struct Columns {
    const double *psi, *state;  // the new values
    const double* amplitude;    // as in kernel::Columns
    double* of_psi;             // errors, in and out
    const double* of_eta;
    double* of_state;
    double h;
    PetscInt count, number;  // number: of the first node
  };
  // `coefficients`: of the i-th of them.
  void operator()(const Columns& c, const std::function<NodeCoefficients(PetscInt i)>& coefficients) const;

 private:
  kernel::LawColumns law_;
  mutable std::array<std::vector<double>, 6> columns_;
};

constexpr PetscInt closed_nodes = 512;  // a whole grid of so many nodes or fewer is one tile on every rank

struct Tile {
  PetscInt begin, end;          // the nodes whose new values are wanted, counted from this rank's first;
  PetscInt own_begin, own_end;  // those of them that are this rank's,
  PetscInt from, to;            // the nodes that are loaded
};

// A sum of slopes, as the tableau of a method has it for a stage, the new values, their error or a place
// between steps: columns, which are the user's, and weights.
struct SlopeSum {
  std::vector<int> columns;
  std::vector<double> weights;
  // `factor`: by which the slope that is meant differs from the column.
  void add(int column, double weight, double factor = 1) {
    if (is_no_weight(weight)) return;
    columns.push_back(column);
    weights.push_back(weight * factor);
  }
};

// into = base + dt * the sum on `count` values; at(column): where the column's lie.
class SlopeSums {
 public:
  template <class At>
  void operator()(const double* base, const SlopeSum& sum, double dt, PetscInt count, double* into,
                  const At& at) const {
    constexpr int most_terms = 64;
    const double* terms[most_terms];
    double weights[most_terms];
    const std::size_t size = sum.columns.size();
    for (std::size_t j = 0; j < size; ++j) {
      terms[j] = at(sum.columns[j]);
      weights[j] = dt * sum.weights[j];
    }
    add_({base, terms, weights, int(size), into, count});
  }

 private:
  std::function<void(const kernel::Terms&)> add_ =
      kernel::compiled<std::function<void(const kernel::Terms&)>>(kernel::AddTerms{});
};

class Tiles {
 public:
  // `stages`: how many times a tile's overlap reaches half a stencil; `columns` besides u and y (see column).
  Tiles(const Model& model, int stages, int columns, bool sticking);
  Tiles(const Tiles&) = delete;
  Tiles& operator=(const Tiles&) = delete;

  const Model& model() const { return model_; }
  int dof() const { return dof_; }
  int half_width() const { return half_width_; }
  // the ends of the grid seen from this rank; far away on a ring in tiles
  PetscInt low() const { return low_; }
  PetscInt high() const { return high_; }
  PetscInt right_halo() const { return right_halo_; }

  // 1, -1 or 0 for every node of this rank, from now on. Collective.
  void set_direction(const std::vector<double>& own);

  // Passes through all tiles, each with `reach` nodes loaded at either side: u is in columns 0, and `through`
  // leaves the new values in columns 1, which go to u_new. Then `after` looks at the tile. Collective.
  template <class Through, class After>
  void pass(Vec u, Vec u_new, PetscInt reach, const Through& through, const After& after) const {
    const Reading a(u);
    if (fetch_) fetch_->take(a);
    const double* const halo = fetch_ ? fetch_->values() : nullptr;
    const Writing b(u_new);
    for (PetscInt j = 0; j < count(); ++j) {
      const Tile t = tile(j, reach);
      load(t, a, halo);
      through(t);
      store(t, 1, b);
      after(t);
    }
  }

  // ---- within a tile ---- Column 0: u, 1: y (a stage, or the new u), from 2 on: slopes. Node i of the tile
  // for unknown d (0 psi, 1 eta, 2 the state) is column(...)[i - from].
  double* column(int index, int d) const { return &work_[(index * dof_ + d) * stride_ + pad_]; }
  const double* zeros() const { return zeros_.data(); }
  // into = base + dt * the row's sum, of unknown d on [begin, end); base, into: as column() gives them.
  void sum(const Tile& t, int d, const double* base, const SlopeSum& row, double dt, PetscInt begin,
           PetscInt end, double* into) const;
  // psi beyond an end of the grid, where [begin - half_width, end + half_width) passes it. psi: of node 0.
  void close_ends(double* psi, PetscInt begin, PetscInt end) const;
  // Copies the tile's own part of columns `index` to the array of a Vec.
  void store(const Tile& t, int index, double* u) const;
  const double* amplitude(PetscInt node) const { return at(amplitude_, node); }  // nullptr: all are 1
  // Where friction varies along x: the number of a node among those of this rank with its halo, and x of all
  // of these.
  PetscInt number(PetscInt node) const { return node + left_halo_; }
  FrictionPlaces places() const;
  // The links of all of these, links[k] before the node of number k; none where they do not differ.
  std::vector<double> links() const;
  // nullptr: friction does not stick
  const double* direction(PetscInt node) const { return at(direction_, node); }
  // Calls body(i) for the held nodes of this rank in [begin, end).
  template <class Body>
  void for_held(PetscInt begin, PetscInt end, const Body& body) const {
    for (const PetscInt node : {PetscInt(0), n_ - 1}) {
      const PetscInt i = node - first_;
      if (model_.held(node) && i >= begin && i < end) body(i);
      if (n_ == 1) break;
    }
  }

  // ---- over a step: what the new values err by ----
  // The new u stands in columns 1; columns 0 are used up. `estimate` false: only whether it is finite.
  // `refine`: what is made of the errors in columns 0.
  void measure(const Tile& t, const SlopeSum& error, double dt, const ErrorNorm& norm, bool estimate,
               StepErrors::Sums& sums, const std::function<void()>& refine) const;

 private:
  const double* at(const std::vector<double>& list, PetscInt node) const {
    return list.empty() ? nullptr : &list[node + left_halo_];
  }
  std::vector<std::pair<PetscInt, double>> beyond(PetscInt node) const;
  PetscInt wrapped(PetscInt node) const { return ((node % n_) + n_) % n_; }
  PetscInt count() const;
  Tile tile(PetscInt number, PetscInt reach) const;  // of them
  void set_amplitude();
  void set_up_fetch();
  std::array<double*, 3> columns(const Tile& t, int index, PetscInt i) const;
  void load(const Tile& t, const double* u, const double* halo) const;

  const Model& model_;
  int dof_, half_width_;
  PetscInt first_, local_, n_;
  bool closed_;  // one tile holds the whole grid, also of several ranks
  PetscInt low_, high_, left_halo_, right_halo_;
  std::vector<double> amplitude_, direction_;  // of the nodes -left_halo .. local + right_halo - 1
  // psi beyond an end, by local nodes
  std::vector<std::vector<std::pair<PetscInt, double>>> left_end_, right_end_;
  SlopeSums add_;
  StepErrors errors_;
  kernel::Copy to_columns_, from_columns_;
  std::optional<NodeFetch> fetch_;     // of the halo; none where there is none
  std::vector<double> going_;          // the direction in place of psi, to be fetched
  static constexpr PetscInt pad_ = 8;  // room for the nodes beyond an end
  PetscInt stride_ = 0;
  mutable std::vector<double> work_;
  std::vector<double> zeros_;
};

// A step of a one-step method with all its stages taken tile by tile: explicit, or additive with
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
  void hold(const Tile& t, int slope, PetscInt begin, PetscInt end) const;  // the rates of held nodes
  void finish_explicit(const Tile& t, int slope, PetscInt begin, PetscInt end) const;
  // What the errors in columns 0 are by SlaveErrors.
  void follow_force(const Tile& t, double dt) const;
  // The coefficients at a stage, with the plate's velocity then.
  kernel::Coefficients at_stage(const Step& step, const Stage& stage) const;
  bool viscous() const { return N_ > 0; }
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
