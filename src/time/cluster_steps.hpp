// The steps of one cluster of nodes (clusters.hpp), by the pair rk:5dp, each of which ends where a node of it
// starts or stops.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "stickslip/model/model.hpp"
#include "time/fused_methods.hpp"
#include "model/stick_rule.hpp"
#include "model/loops.hpp"

namespace stickslip {

// Nodes first, first + 1, ..., round the ring. Unknowns and slopes stand in blocks, of each psi of all nodes,
// then eta and the state, every one with places beyond both ends, as many as the stencil reaches.
struct Cluster {
  enum Block { now, next, stage, slopes };  // slopes: one each, and behind them that where a step was cut
  PetscInt first, count, reach;
  std::size_t stride, size;  // of a column, of a block
  std::vector<double> blocks, direction, amplitude;
  std::vector<std::size_t> begins;  // of each block
  // of the step under way: as it was tried first, and as it was taken, but for where it is cut
  double t0 = 0, tried = 0, dt = 0;
  // where it ends, and the next one's length
  double t1 = std::numeric_limits<double>::infinity(), next_dt = 0;
  bool begun = false, cut = false;  // the first slope is known; something starts or stops at t1
  std::int64_t number = 0;          // of the step, among all

  Cluster(PetscInt first_node, PetscInt nodes, int dof, PetscInt stencil_reach, int stages)
      : first(first_node), count(nodes), reach(stencil_reach), stride(std::size_t(nodes + 2 * stencil_reach)),
        size(stride * std::size_t(dof)), blocks(size * std::size_t(slopes + stages + 1)), direction(nodes) {
    for (std::size_t begin = 0; begin < blocks.size(); begin += size) begins.push_back(begin);
  }
  double* block(int b) { return &blocks[begins[std::size_t(b)]]; }
  const double* block(int b) const { return &blocks[begins[std::size_t(b)]]; }
  void swap(int one, int other) { std::swap(begins[std::size_t(one)], begins[std::size_t(other)]); }
  std::size_t place(int unknown) const { return std::size_t(unknown) * stride + std::size_t(reach); }
  // Of a block: psi (0), eta (1), the state (2) of its nodes.
  double* column(int b, int unknown) { return block(b) + place(unknown); }
  const double* column(int b, int unknown) const { return block(b) + place(unknown); }
};

class ClusterSteps {
 public:
  ClusterSteps(const Model& model, const Tolerances& tolerances);

  std::unique_ptr<Cluster> make(PetscInt first, PetscInt count) const;
  // From t0 on, of the length dt or less, to where the cluster's nodes go on as they do or one starts or
  // stops.
  void take(Cluster& c);
  // The cluster goes on from where its step ends; not where it is cut.
  void accept(Cluster& c) const;
  // All unknowns at a part of its step, from the method's polynomial.
  void interpolate(const Cluster& c, double part, double* into) const;
  // At a time of its step; at its end as it was taken.
  void at(const Cluster& c, double t, double* into) const;
  // The right-hand side f of u, blocks of the cluster both, at a time of its step.
  void take_slope(Cluster& c, double t, double* u, double* f);
  double* first_slope(Cluster& c) const { return c.block(Cluster::slopes); }
  double* last_slope(Cluster& c) const {
    return c.block(Cluster::slopes + tableau_.stages - (c.cut ? 0 : 1));
  }
  // The unknowns of one of its nodes, then.
  void node_at(const Cluster& c, PetscInt k, double t, double* u) const;
  double* cut_slope(Cluster& c) const { return c.block(Cluster::slopes + tableau_.stages); }
  // N D2 psi of its nodes, where neighbours have viscosity, of a block u; of a slope N D2 psi_t.
  void viscous_force(const Cluster& c, double* u, std::vector<double>& into) const;

  PetscInt node(const Cluster& c, PetscInt k) const {
    return c.first + k < scene_.n ? c.first + k : c.first + k - scene_.n;
  }
  const StickEvents& events() const { return events_; }

  std::int64_t rejections = 0, evaluations = 0;
  double longest_step = std::numeric_limits<double>::infinity();

 private:
  void close_ends(const Cluster& c, double* psi) const;
  static double beyond(const Cluster& c, const double* psi, const Combination& nodes);
  struct Part {  // of its nodes, or of a block
    PetscInt begin, end;
  };
  template <class Body>
  void for_parts(const Cluster& c, PetscInt begin, PetscInt end, const Body& body) const;
  void sum(const Cluster& c, const double* base, const double* weights, int count, double factor,
           double* into, Part nodes) const;
  void slope_of(const Cluster& c, double t, double* u, double* f, Part nodes);
  double attempt(Cluster& c, double dt);
  double attempt(Cluster& c, double dt, Part nodes);
  const double* forces(Cluster& c, int block, std::size_t number);
  // Its nodes where a block has them, for their starts and stops; forces_[number] is used for the force.
  stick_rule::StridedNodes nodes(Cluster& c, int block, std::size_t number);
  stick_rule::Furthest furthest(Cluster& c, const stick_rule::StepOfNodes& step, double part);
  stick_rule::Found find_change(Cluster& c, double dt, double& part);

  const Model& model_;
  const Scene& scene_;
  StickEvents events_;
  int dof_;
  PetscInt reach_;
  bool loaded_;
  Tolerances tolerances_;
  double unseen_, N_, K1_;
  std::unique_ptr<FusedMethod> method_;
  StageProgram tableau_;
  std::vector<double> error_weights_;  // of its slopes, times the length of a step
  std::vector<double> stage_times_;    // in parts of a step
  kernel::Coefficients coefficients_;
  std::array<std::vector<Combination>, 2> ends_;  // of a line: the nodes beyond each
  std::vector<double> links_;                     // where they differ (links_along)
  StencilLoop stencil_;
  PointwiseLoop pointwise_;
  std::function<void(const kernel::Terms&)> add_;
  stick_rule::Candidates candidates_;
  std::array<std::vector<double>, 4> forces_;  // with viscosity: eta + N D2 psi
  std::vector<double> d2_;
};

}  // namespace stickslip
