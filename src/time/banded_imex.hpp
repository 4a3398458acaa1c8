// A step of an implicit-explicit Runge-Kutta method with the wave, or everything, implicit.
//
// eta and the state are put into psi's equation, which leaves one banded system in psi alone
// (band.hpp). With the wave implicit, part Part::wave of the model, it is linear with one diagonal,
// whose factors stand while step and tableau do; friction is explicit. With everything implicit it has a new
// diagonal in each round of Newton's method (model/loops.hpp). A stage is solved to well below the
// error that a step is allowed. Where the error is estimated, a matrix that is not positive definite on the
// way counts as not solved: while it is, the solution found is the one that grows out of the start of the
// step.
//
// The tiles of a stage go through memory twice, before and behind the separators; behind them a tile goes on
// at once to the right-hand side of the next stage where both stages share their factors.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <vector>

#include "model/loops.hpp"
#include "time/band.hpp"
#include "time/tiles.hpp"

namespace stickslip {

class BandedImex : public StepTaker {
 public:
  // `implicit`: wave or both.
  BandedImex(const Model& model, StageProgram method, Implicit implicit, bool sticking);
  // Memory of a node with `dof` unknowns, in bytes: all stages, in doubles of what is solved for.
  static double bytes_a_node(double dof, double stages, Implicit implicit) {
    const bool wave = implicit == Implicit::wave;
    return 8 * (3 * dof + (wave ? 1 : 2) + stages * (wave ? 1 + dof : dof));
  }

  Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
               const std::vector<VecHandle>& slopes, Vec last_slope = nullptr, double t = 0) const override;
  void set_direction(const std::vector<double>& direction) override;
  int stages() const override { return method_.stages; }
  // Of the stages of a tableau that this class takes only the first may be explicit.
  static bool takes(const StageProgram& method);

 private:
  struct Step {
    double dt, begin;
    const ErrorNorm& norm;
    bool estimate;
  };
  double diagonal(int i) const { return method_.At[i * method_.stages + i]; }
  // Of the nodes of a tile; nullptr where there are none of any.
  static const double* of_tile(const std::vector<double>& all, const BandTile& t) {
    return all.empty() ? nullptr : &all[t.at];
  }
  template <class T>
  std::vector<T> by_tiles(const std::vector<T>& of_nodes) const;
  kernel::Coefficients at_stage(const Step& step, int i) const;
  kernel::BandStage stage_of(const Step& step, int i) const;
  const double* from(const BandTile& t) const;
  kernel::Round round_of(const BandTile& t, const Step& step, int i) const;
  void load(Vec u, const Step& step) const;
  void second_difference(const BandTile& t, const double* own, double* d2) const;
  void take_first(const BandTile& t, const Step& step) const;
  void take_explicit(const BandTile& t, int i) const;
  void hold(const BandTile& t, int i, const Step& step) const;
  bool linear_stage(int i, bool begun, const Step& step) const;
  void forward(std::size_t tile, int i, const Step& step) const;
  bool newton_stage(int i, const Step& step) const;
  enum class Newton { solved, failed, lost_digits };
  Newton newton(int i, const Step& step) const;
  void linearise(const BandTile& t, const kernel::Round& round) const;
  void guess(const BandTile& t, int i, const Step& step) const;
  void finish(const BandTile& t, const Step& step, double* u_new, StepErrors::Sums& sums) const;
  void measure(const BandTile& t, int unknown, const Step& step, StepErrors::Sums& sums) const;
  void store_slopes(const std::vector<VecHandle>& slopes) const;
  // Calls body(place in the tile, row of D2 as places of the tile) for the held nodes of a tile.
  template <class Body>
  void for_held(const BandTile& t, const Body& body) const;

  const Model& model_;
  StageProgram method_;
  Implicit implicit_;
  BandLayout layout_;
  ImexColumns columns_;
  std::unique_ptr<BandSystem> system_;
  kernel::Coefficients coefficients_;
  double d2_row_;  // the sum of |D2| over a row
  // in the order of columns; empty: all are 1; friction never sticks
  std::vector<double> amplitude_, direction_;
  std::vector<std::vector<Combination>> end_rows_;         // of D2, at nodes of outer tiles on a line
  mutable std::vector<double> d_, b_, x_, spare_, zeros_;  // of one tile
  mutable std::array<std::vector<double>, 3> new_, of_new_;  // its new values, and their errors
  mutable bool from_start_ = true;  // psi's change is counted from the start of the step, not from 0
  StepErrors errors_;
  SlaveErrors slaves_;
  StencilLoop stencil_;
  PointwiseLoop pointwise_;
  NewtonLoop newton_;
  std::function<void(const kernel::Coefficients&, const kernel::Round&)> wave_;
  std::function<void(const kernel::Round&, double*)> right_sides_;
};

}  // namespace stickslip
