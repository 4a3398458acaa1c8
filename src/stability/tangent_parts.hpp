// Parts of a step of tangent vectors, y_t = J(u(t)) y (stickslip/stability/tangents.hpp). J is never
// assembled: a block for each node, and the coupling of neighbours.
//
// Two one-step methods take a part (numerics/stage_program.hpp): the explicit pair of Dormand and Prince, of
// order 5, for parts that are short against 1/|J|; and the additive method of Kennedy and Carpenter (Appl.
// Numer. Math. 44 (2003) 139), of order 4, L-stable, with the nodes' blocks implicit and the coupling
// explicit: its parts are as long as J varies and neighbours allow, however stiff friction is.
//
// Collective over the model's ranks.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/LU>

#include "numerics/tableau.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/model.hpp"

namespace stickslip {

class TangentParts {
 public:
  explicit TangentParts(const Model& model) : model_(model), dof_(model.dof()) {}

  // u at the part [0, 1] of a step.
  using Inside = std::function<void(double part, Vec into)>;
  // From `begin`, as long as `length`, both in units of the step dt.
  struct StepPart {
    double begin, length, dt;
  };

  // The start of the next part.
  void begin(Vec u) { linearise(u, start_); }
  // The fastest rate of a node's block at the start of the next part, and with that at u.
  double rate_until(Vec u);
  // Each y becomes its value at the end of the part; those left out: nullptr. Returns the integral over it of
  // the trace of J, this rank's.
  double explicit_part(const StepPart& part, const Inside& inside, const std::vector<Vec>& y);
  // The same into `next`, and the largest error of a vector by its estimate: of psi, eta and the state each
  // relative to its own norm over all nodes. Nothing has moved until keep().
  struct Tried {
    double error, trace;
  };
  Tried implicit_part(const StepPart& part, const Inside& inside, const std::vector<Vec>& y,
                      const std::vector<Vec>& next);
  void keep() { std::swap(start_, inside_); }

  // psi and eta of held nodes are no unknowns.
  void clear_held(double* y) const;
  // Two vectors whose values nobody needs between parts.
  Vec scratch(std::size_t i);

 private:
  struct Linearisation {
    std::vector<NodeBlock> blocks;  // of this rank's nodes
    double trace = 0, rate = 0;     // of this rank
  };
  struct Slopes {
    std::vector<VecHandle> f, g;  // stage by stage; g: of an additive method alone
  };
  double own_viscous_slope(PetscInt local_node) const;
  void linearise(Vec u, Linearisation& at) const;
  void factor(const Linearisation& at, double theta);
  void make_room(const StageProgram& method, std::size_t vectors);
  double take_stages(const StageProgram& method, const StepPart& part, const Inside& inside,
                     const std::vector<Vec>& y);
  void take_stage(const StageProgram& method, int i, double h, const Linearisation& at, Vec y, Slopes& k);
  void add_slopes(Vec to, const Slopes& slopes, int count, double h, const double* f, const double* g) const;
  void add_blocks(const Linearisation& at, Vec y, Vec into) const;
  void solve(Vec y) const;

  const Model& model_;
  int dof_;
  VecHandle u_, stage_;
  std::vector<Slopes> slopes_;  // of each vector
  Linearisation start_, inside_;
  std::vector<Eigen::PartialPivLU<Eigen::Matrix3d>> factors_;  // of 1 - theta B at this rank's nodes
};

}  // namespace stickslip
