// The course of psi of a node within an accepted step, for what is measured in passing at any number of
// nodes: the cubic through its values at both ends and their slopes, which the node's own equations give
// (error dt^4). It is the same for a motion and its mirror image. What is asked for at a few places or by
// name (measures.hpp, maxima.hpp) is read from the method's dense output instead, which costs a pass over all
// nodes.
#pragma once

#include <optional>
#include <vector>

#include "output/node_halo.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

// A node where a step begins or ends. normal: N(t), by which friction is multiplied there. beside: what its
// neighbours add, as NodeRates has it.
struct NodeMoment {
  double psi = 0, eta = 0, state = 0, normal = 1, beside = 0;
};

// psi_t of the nodes of a rank.
class NodeRates {
 public:
  // Collective.
  explicit NodeRates(const Model& model);

  // What neighbours add to the rate of a node is asked for where they do: N D2 psi where they have viscosity,
  // K1 D2 psi, as it stands in eta_t, where psi keeps to a balance. Collective; psi of this rank's nodes, dof
  // apart.
  bool ask_beside() const { return halo_.has_value(); }
  void look_beside(const double* u);
  double beside(PetscInt local_node) const;

  // psi_t where the node leaves rest, or comes to it, in the direction `aside` (psi = 0 says none); 0 of a
  // held node. Where a step of dt passes over what is stiff (time/integrator_impl.hpp), and without mass, psi
  // keeps to the balance of its forces: then it is (eta_t - F_s g)/(B + F_psi). Not a number where that is
  // not known: under a load, and beside neighbours of whom nothing is known.
  double of(PetscInt local_node, const NodeMoment& at, double aside, double dt) const;

 private:
  const Model& model_;
  std::optional<NodeHalo> halo_;
  std::vector<double> psi_, fetched_;
};

// Of a step of length dt, from its values and rates there; a straight line where a rate is not known.
class StepCourse : public HermiteCubic {
 public:
  StepCourse(double psi0, double psi1, double rate0, double rate1, double dt);

  // Where it comes from below the level to it, as a part of the step; of several places the last. The step
  // begins below the level and does not end there.
  double rise_to(double level) const;
  // The part of the step from `begin` on over which it lies in [-level, level].
  double part_within(double level, double begin) const;

 private:
  double part_below(double level, double begin) const;
};

}  // namespace stickslip
