// Where the stick-slip that coexists with sliding ends, in one parameter or two.
//
// Below the linear boundary stick-slip must begin; it need not end there. With friction that sticks exactly,
// uniform motion ends where a slip comes back to rest just tangentially (`graze`), or with a state where its
// cycle meets an unstable one (`fold`); there is a function of the scene whose zeros these are. With smooth
// friction, and for a cell of several nodes, it ends where the branch of the cycle ceases to attract: `fold`,
// or `flip`, `torus`, `branch`, and where a slip of a cell grazes rest `graze` (cycles/cycle.hpp). Where the
// cycle shrinks to nothing at the Hopf point of sliding there is no second point. What lives on either side
// is asked of the motion itself.
//
// Nothing here is collective; every rank computes the same.
#pragma once

#include <petscsys.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/numerics/level_curve.hpp"
#include "stickslip/stability/boundary.hpp"

namespace stickslip {

// A cell whose own motion from `start` is what ends: the cell's scene, and its unknowns at the start node by
// node, as functions of the values of the axes. Both empty: uniform motion.
struct CellMotion {
  SceneAt cell;
  std::function<std::vector<double>(double value, double value2)> start;
};

class StickSlipEnd : public OnAxes {
 public:
  // Of the scene's uniform motion, or of the cell's.
  static std::unique_ptr<StickSlipEnd> of(SceneAt scene_at, std::vector<Axis> axes,
                                          const CellMotion& cell = {});
  virtual ~StickSlipEnd() = default;

  // Why the uniform stick-slip of this scene is none; empty where it is.
  static std::string refusal(const Scene& scene);

  // Every end on the first axis, ascending in the coordinate. `frequency` is that of the cycle, `wavenumber`
  // 0, `residual` what is left of the function that is zero there: of a graze the least psi of the slip, of a
  // fold the parameter's share of the branch's direction (exact stick: |1 - multiplier| of the last cycle
  // that it was placed by), else the distance of the multiplier from where it passes. `notes`: what is not as
  // it should be.
  virtual std::vector<Crossing> points(std::vector<std::string>& notes) = 0;
  // The curve of ends in the box of both axes, as boundary_curve has that of sliding.
  virtual std::vector<Crossing> curve(PetscInt count, std::vector<std::string>& notes) = 0;

  // Negative if the motion, started strongly, keeps sticking and slipping; NaN if it never slips. Of
  // uniform motion.
  virtual double operator()(double x, double y = 0) = 0;
  // What becomes of the motion there, in words: "slides steadily", "grows without bound", ...
  virtual std::string fate(double x, double y = 0) const = 0;
  // A place of the cycle that lives there, psi, eta and the state of one node; empty where none is found.
  virtual std::vector<double> on_cycle(double x, double y = 0) const = 0;
  // Whether it was sampled and stick-slip found nowhere.
  bool lives_nowhere() const;
  // The work of a search for points or a curve, in evaluations of the equations of a node: where it is done
  // the search ends with what it has found, and a note says so. Of smooth friction, and of cells.
  void allow(double evaluations) { most_work_ = evaluations; }
  // Why the search ended before its end; empty where it did not.
  const std::string& unfinished() const { return unfinished_; }
  // The function, sampled as Samples of boundary.hpp: side 33, or 25 squared; empty where it is not known
  // everywhere.
  const std::vector<double>& samples() const { return samples_; }
  virtual Scene scene(double x, double y = 0) const = 0;  // of one node, or of the cell

 protected:
  using OnAxes::OnAxes;
  Scene scene_of_axes(double x, double y) const { return OnAxes::scene(x, y); }
  Crossing crossing_at(double x, double y) const;  // the place and its values, of stick-slip
  std::string place_text(double x, double y) const;
  void note_stuck_ends(const std::vector<CurvePiece>& pieces, std::vector<std::string>& notes) const;

  std::vector<double> samples_;
  std::string unfinished_;
  double most_work_ = 3e8;  // some ten seconds
};

}  // namespace stickslip
