// Friction that sticks, of a medium that mostly rests: only what slides is advanced (docs/events.md).
//
// A cluster is some sliding nodes and the resting ones beside them, whose eta is integrated with it. Clusters
// do not feel each other while at least two resting nodes lie between their sliding ones (the stencil reaches
// one node); with fewer they are one cluster. What rests elsewhere is known in closed form: eta grows by K0
// times the plate's way, and the node that comes to its threshold first is the first of a heap.
//
// Each cluster takes steps of its own, with its own tolerance, by the pair rk:5dp. It lies ahead of the
// others by its last step, which counts only when it comes first in time: then its integrals are handed on,
// and the starts and stops at its end are carried out (stick_rule.hpp). So all starts and stops come in the
// order of time. Where one makes two clusters one, that which is ahead is cut back to it, by the method's
// polynomial between steps.
//
// For one rank, and for scenes without a state, viscosity between neighbours, load and held ends, of order 2.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "model/moved_nodes.hpp"
#include "stickslip/model/plate.hpp"
#include "time/fused_methods.hpp"
#include "time/stick_rule.hpp"
#include "time/tile_kernels.hpp"

namespace stickslip {

class Clusters {
 public:
  // Why clusters cannot be taken for this scene; "" where they can.
  static std::string refusal(const Scene& scene);

  // Sees what happens, in the order of time.
  class Watcher {
   public:
    virtual ~Watcher() = default;
    virtual void step(const MovedNodes& nodes) = 0;
    // Nodes that begin to slide and that stop at t.
    virtual void change(double t, const std::vector<PetscInt>& starts,
                        const std::vector<PetscInt>& stops) = 0;
  };

  // From u at t on. The model and the plate, whose clock it keeps, must outlive it, u need not.
  Clusters(const Model& model, Vec u, double t, double atol, double rtol, Watcher* watcher, Plate& plate);
  ~Clusters();

  // Until all that happens up to t is done, or so many steps in all have been taken, or `go_on`, asked after
  // every step with its number and time, says no. Returns the time reached.
  double advance(double t, std::int64_t most_steps, const std::function<bool(std::int64_t, double)>& go_on);
  // u at the time reached, or at a later one before anything else happens.
  void solution(double t, Vec u) const;
  double eta_at_rest(PetscInt node, double t) const;  // of a node that rests since before t

  bool plate_is_over() const { return plate_is_over_; }  // its clock has come to Plate::end
  std::int64_t steps() const { return steps_; }
  std::int64_t rejections() const { return rejections_; }
  std::int64_t node_steps() const { return node_steps_; }  // steps, each times the nodes of its cluster
  std::int64_t evaluations() const { return evaluations_; }
  std::size_t most_at_once() const { return most_at_once_; }

 private:
  struct Cluster;
  struct Due {  // a cluster's end of step; number: of the step, which another may have replaced
    double t;
    std::size_t cluster;
    std::int64_t number;
    bool operator<(const Due& other) const { return t > other.t; }
  };
  struct Release {
    double t;
    PetscInt node;
    bool operator<(const Release& other) const { return t > other.t; }
  };

  PetscInt node(PetscInt k) const { return k >= n_ ? k - n_ : k; }
  double plate_time(double t) const { return halts_ ? plate_.at(t) : t; }
  double beside(PetscInt i, int side) const;
  double elastic_rate(PetscInt i) const;
  double release_time(PetscInt i) const;
  double next_release() const;
  bool end_with_plate(double t);
  void await_release(PetscInt i);

  void close_ends(const Cluster& c, double* psi) const;
  void take_slope(Cluster& c, double* u, double* f);
  void sum(const Cluster& c, const double* base, const double* weights, int count, double factor,
           double* into) const;
  double attempt(Cluster& c, double dt);
  void take(Cluster& c);
  stick_rule::Found find_change(Cluster& c, double dt, double& part);
  void interpolate(const Cluster& c, double part, double* into) const;
  void snap(Cluster& c, const stick_rule::Candidates& candidates);
  void queue(std::size_t id);

  void show(Cluster& c, const double* u_end, const double* slope_end, double t);
  void commit(std::size_t id);
  void dissolve(std::size_t id, const double* u, double t);
  void cut_back(std::size_t id, double t);
  void release_due();
  void regroup(double t);
  void decide(PetscInt i);
  void form(double t);
  void gather(PetscInt first, PetscInt count, double t);

  const Model& model_;
  const Scene& scene_;
  PetscInt n_;
  bool ring_, halts_, both_sides_;
  double atol_, rtol_, plate_rate_;  // K0 v
  double driving_;                   // the same, but 0 while the plate stands
  std::unique_ptr<FusedMethod> method_;
  StageProgram tableau_;
  std::vector<double> error_weights_;  // of its slopes, times the length of a step
  kernel::Coefficients coefficients_;
  tile::Stencil stencil_;
  tile::Pointwise pointwise_;
  std::function<void(const kernel::Terms&)> add_;
  Watcher* watcher_;
  Plate& plate_;

  // Of a node that rests beyond all clusters: eta at `since_`; and when it will begin to slide by itself, both
  // times by the plate's clock. Of
  // the nodes of a cluster only where they belong, and their direction, is up to date.
  std::vector<double> eta_, since_, release_, limit_;
  std::vector<double> psi_;
  std::vector<signed char> direction_;
  std::vector<int> owner_;  // cluster, -1: none

  std::vector<std::unique_ptr<Cluster>> clusters_;
  std::vector<std::size_t> unused_;  // places in clusters_
  std::priority_queue<Due> due_;
  std::priority_queue<Release> releases_;

  std::vector<PetscInt> freed_, sliding_, starts_, stops_;  // while clusters are formed anew
  double next_dt_ = 0;
  double t_, last_change_ = -std::numeric_limits<double>::infinity();
  std::int64_t steps_ = 0, rejections_ = 0, node_steps_ = 0, evaluations_ = 0, without_time_ = 0,
               step_number_ = 0;
  std::size_t alive_ = 0, most_at_once_ = 0;
  bool plate_is_over_ = false;
  double first_dt_;
};

}  // namespace stickslip
