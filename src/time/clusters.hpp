// Friction that sticks, of a medium that mostly rests: only what slides is advanced (docs/events.md).
//
// A cluster is some sliding nodes and the resting ones that the stencil reaches from them, whose eta (and
// state) is integrated with it. Clusters do not feel each other while between their sliding nodes at least
// twice as many nodes rest as the stencil reaches; with fewer they are one cluster. What rests elsewhere is
// known in closed form (resting.hpp). A held end moves all the time: it and the nodes whose stencils look at
// it always belong to a cluster.
//
// Each cluster takes steps of its own, with its own tolerance (cluster_steps.hpp). It lies ahead of the
// others by its last step, which counts only when it comes first in time: then its integrals are handed on,
// and the starts and stops at its end are carried out (stick_rule.hpp). So all starts and stops come in the
// order of time. Where one makes two clusters one, that which is ahead is cut back to it, by the method's
// polynomial between steps.
//
// A plate that halts (Plate) stands while there is a cluster, and nothing else is loaded then: what rests
// goes by its clock.
//
// For one rank.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "base/idling.hpp"
#include "model/moved_nodes.hpp"
#include "stickslip/model/model.hpp"
#include "time/cluster_steps.hpp"
#include "time/resting.hpp"

namespace stickslip {

class Clusters : public MediumNow {
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

  // The model and the plate, whose clock it keeps where that halts, must outlive it. Then one of: start() at
  // u; archive() of a checkpoint, with the plate as it was then.
  Clusters(const Model& model, Plate& plate, const Tolerances& tolerances);
  ~Clusters() override;
  void start(Vec u, double t);
  // What goes on from a checkpoint goes on to the last bit: each cluster stands at its own time, and its step
  // under way, which has one result, is taken anew.
  template <class Archive>
  void archive(Archive& a);
  void watch(Watcher* watcher) { watcher_ = watcher; }
  void limit_steps(double longest) { steps_.longest_step = longest; }

  // Until all that happens up to t is done, or so many steps in all have been taken, or `go_on`, asked after
  // every step with its number and time, says no. Returns the time reached.
  double advance(double t, std::int64_t most_steps, const std::function<bool(std::int64_t, double)>& go_on);
  // u at the time reached, or at a later one before anything else happens.
  void solution(double t, Vec u) const;
  bool plate_is_over() const { return plate_is_over_; }  // its clock has come to Plate::end
  Totals totals(double t) const override;
  void node(PetscInt i, double t, double* u) const override;
  bool is_advanced(PetscInt i) const override { return owner_[i] >= 0; }
  PetscInt advanced() const override { return n_ - resting_.count(); }
  // Shows the watcher what clusters have done up to t, the time reached, of steps that go on beyond it, and
  // which do not count. Nothing is advanced behind it.
  void show_until(double t);

  double reached() const { return t_; }
  std::int64_t steps() const override { return counts_.steps; }
  std::int64_t rejections() const override { return steps_.rejections; }
  std::int64_t node_steps() const {
    return counts_.node_steps;
  }  // steps, each times the nodes of its cluster
  std::int64_t evaluations() const { return steps_.evaluations; }
  std::int64_t most_at_once() const { return counts_.most_at_once; }

 private:
  // Calls body(cluster, its unknowns at t) for every cluster.
  template <class Body>
  void each_at(double t, const Body& body) const;
  struct Due {  // a cluster's end of step; number: of the step, which another may have replaced
    double t;
    std::size_t cluster;
    std::int64_t number;
    bool operator<(const Due& other) const { return t != other.t ? t > other.t : number > other.number; }
  };

  PetscInt wrapped(PetscInt k) const { return k >= n_ ? k - n_ : k < 0 ? k + n_ : k; }
  template <class Body>
  void for_reach(PetscInt i, const Body& body) const;
  bool seen_beyond(End end, PetscInt from_end) const;
  bool anchored(PetscInt i) const;
  double second_difference(PetscInt i, const std::vector<double>& of) const;
  double elastic_rate(PetscInt i) const;
  double force(PetscInt i) const;
  double force_rate(PetscInt i) const;

  double clock(double t) const { return halts_ ? plate_.at(t) : t; }  // which resting nodes go by
  double next_release();                                              // by the clock of the run
  bool end_with_plate(double t, double release);
  void await_release(PetscInt i);

  void queue(std::size_t id);
  void count(const Cluster& c);
  void show(Cluster& c, double* u_end, double* slope_end, double t);
  void show_part(Cluster& c, double t, std::vector<double>& u);
  void commit(std::size_t id);
  void dissolve(std::size_t id, const double* u, double t);
  void cut_back(std::size_t id, double t);
  void release_due(double t);
  void regroup(double t);
  double same_time() const { return 1e-13 * first_dt_; }  // base/idling.hpp
  void decide(PetscInt i);
  void form(double t);
  void gather(PetscInt first, PetscInt count, double t);
  std::size_t add(std::unique_ptr<Cluster> cluster);

  struct Kept {  // of a cluster, in a checkpoint
    std::size_t place = 0;
    PetscInt first = 0, count = 0;
    double t0 = 0, tried = 0;
    std::int64_t number = 0;
    std::vector<double> u, direction;
  };
  std::vector<Kept> kept() const;
  void resume(const std::vector<Kept>& clusters);

  const Model& model_;
  const Scene& scene_;
  Plate& plate_;
  PetscInt n_, reach_;
  int dof_;
  bool ring_, halts_;
  ClusterSteps steps_;
  RestingNodes resting_;
  Watcher* watcher_ = nullptr;

  std::vector<double>
      psi_;  // of nodes that are free, on the way from a cluster to another or to rest; else 0
  std::vector<signed char> direction_;
  std::vector<int> owner_;             // cluster, -1: none
  kernel::Coefficients coefficients_;  // of D2
  std::vector<double> links_;          // where they differ (links_along)
  mutable std::vector<double> psi_rate_;
  std::array<std::vector<double>, 4> viscous_;

  std::vector<std::unique_ptr<Cluster>> clusters_;
  std::vector<std::size_t> unused_;  // places in clusters_
  std::priority_queue<Due> due_;

  std::vector<PetscInt> freed_, sliding_, starts_, stops_;  // while clusters are formed anew
  double first_dt_, next_dt_ = 0;
  double t_ = 0;
  Idling idling_;
  struct Counts {
    std::int64_t steps = 0, node_steps = 0, most_at_once = 0, number = 0;
  } counts_;
  std::int64_t alive_ = 0;
  bool releases_ = false, plate_is_over_ = false;  // the former: while nodes begin to slip under it
};

template <class Archive>
void Clusters::archive(Archive& a) {
  std::vector<Kept> clusters = kept();
  std::int64_t rejections = steps_.rejections, evaluations = steps_.evaluations;
  a("clusters.reached", t_, counts_.steps, counts_.node_steps, counts_.most_at_once, counts_.number,
    rejections, evaluations);
  resting_.archive(a);
  a.list("clusters.under_way", [&](auto& x) {
    x.rest(clusters, [&](Kept& c) {
      std::size_t size = c.u.size();
      x(c.place, c.first, c.count, c.t0, c.tried, c.number, size);
      c.u.resize(size);
      c.direction.resize(std::size_t(c.count));
      x(c.u, c.direction);
    });
  });
  // sums are taken in the order of the places
  std::size_t places = clusters_.size();
  a.list("clusters.places", [&](auto& x) {
    x(places);
    x.rest(unused_, [&](std::size_t& place) { x(place); });
  });
  if (!a.restores()) return;
  clusters_.resize(std::min(places, std::size_t(n_)));
  resume(clusters);
  steps_.rejections = rejections;
  steps_.evaluations = evaluations;
}

}  // namespace stickslip
