// Friction that sticks, of a medium that mostly rests: only what slides is advanced (docs/events.md).
//
// A cluster is some sliding nodes and the resting ones that the stencil reaches from them, whose eta (and
// state) is integrated with it. Clusters do not feel each other while between their sliding nodes at least
// twice as many nodes rest as the stencil reaches; with fewer they are one cluster. What rests elsewhere is
// known in closed form (RestingNodes). A held end moves all the time: it and the nodes whose stencils look at
// it always belong to a cluster.
//
// Each cluster takes steps of its own, with its own tolerance (ClusterSteps). It lies ahead of the
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

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <queue>
#include <string>
#include <utility>
#include <vector>

#include "base/process.hpp"
#include "model/loops.hpp"
#include "model/moved_nodes.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/model/model.hpp"
#include "time/methods.hpp"

namespace stickslip {

// What rests beyond all clusters (clusters.hpp), in closed form: eta grows by K0 times the plate's
// displacement, and the state evolves by itself. Two heaps, one for each direction, say which node starts
// to slip next: by the displacement of the plate until then, which under a load v(t) all nodes share; by
// the time with a state, where it is found for each node, and may not exist. All times are by the plate's
// clock where that halts (Plate), as it stands for all of them alike. No neighbour of such a node
// moves, so viscosity between neighbours adds nothing.
class StickEvents;

class RestingNodes {
 public:
  // No node rests yet. `events` says the force that holds each, and outlives this.
  RestingNodes(const Model& model, const StickEvents& events);

  double eta(PetscInt i, double t) const;
  double state(PetscInt i, double t) const;
  double rate(PetscInt i, double t) const;  // of eta; at a corner of a load of the piece that begins there
  double last_eta(PetscInt i) const { return eta_[i]; }  // as it was set
  double last_state(PetscInt i) const { return dof_ == 3 ? state_[i] : 0; }
  // Node i is like this at t; what it does from then on is said by one of the two below it.
  void set(PetscInt i, double t, double eta, double state);
  void rests(PetscInt i);
  void leaves(PetscInt i);  // for a cluster
  // Of a plate that halts, where nodes have a state, which goes by the clock of the run: from t on it goes,
  // or stands. The other only says so, of nodes that a checkpoint holds.
  void set_plate(double t, bool goes);
  void find_plate(bool goes) { v_ = goes ? scene_.v : 0; }

  // Of the nodes that rest: how many, and the sum of their eta, formed anew so often, and with what is lost
  // in each addition added too, that round-off does not gather.
  PetscInt count() const { return count_; }
  double eta_sum(double t) const;

  // When the next one comes to its threshold, or when that is to be asked again, from t on, to which all is
  // done.
  double next(double t);
  // Nodes that come to their thresholds then, which do not rest from there on. May be none.
  std::vector<PetscInt> take_due(double t);

  // What a checkpoint holds, but for which nodes rest: that is told behind it.
  template <class Archive>
  void archive(Archive& a) {
    std::vector<std::vector<double>*> lists = {&eta_, &since_};
    if (dof_ == 3) lists.push_back(&state_);
    for (Side& side : sides_) lists.push_back(&side.key);
    a.nodes("clusters.rest", lists);
    a("clusters.rest_sum", offsets_.rounded, offsets_.lost, growths_.rounded, growths_.lost, added_);
    a.list("clusters.releases", [&](auto& x) {
      for (Side& side : sides_) x(side.time, side.of, side.asked_until);
    });
  }
  void goes_on_resting(PetscInt i);

 private:
  struct Release {
    double key;
    PetscInt node;
    bool operator<(const Release& other) const {  // for a heap, which has the largest first
      return key != other.key ? key > other.key : node > other.node;
    }
  };
  // Entries that no longer hold are dropped where they come to the top, and all of them where `most` stand
  // there, which takes room for no more.
  struct Heap : std::priority_queue<Release> {
    std::size_t most = 0;
    void set_most(std::size_t count) {
      most = count;
      c.reserve(most);
    }
    template <class Holds>
    void drop(const Holds& holds) {
      c.erase(std::remove_if(c.begin(), c.end(), [&](const Release& r) { return !holds(r); }), c.end());
      std::make_heap(c.begin(), c.end(), comp);
    }
  };
  struct Side {
    double direction;
    // of each node: the time of its release, under a load at the latest that when it is looked at again; or
    // under a load without a state the plate's displacement then, times the direction
    std::vector<double> key;
    Heap heap = {};
    // Under a load: the time of the release that has the key `of`, or infinity where there is none before
    // `asked_until`.
    double time = std::numeric_limits<double>::infinity(), of = std::numeric_limits<double>::quiet_NaN(),
           asked_until = -std::numeric_limits<double>::infinity();
  };
  struct Sum {
    double rounded = 0, lost = 0;
    void add(double term);
    double value() const { return rounded + lost; }
  };
  bool by_way() const { return loaded_ && dof_ == 2; }
  void add(PetscInt i, int times);
  void form_sums();
  double way(double t) const;
  double K0(PetscInt i) const { return K0_[K0_.size() == 1 ? 0 : std::size_t(i)]; }
  double key(PetscInt i, double direction) const;
  bool holds(const Side& side, const Release& r) const { return rests_[r.node] && side.key[r.node] == r.key; }
  void drop_old(Side& side) const;
  double passage(double direction, double level, double from, double until) const;

  const Model& model_;
  const Scene& scene_;
  const StickEvents& events_;
  int dof_;
  bool loaded_;
  double v_;  // of the plate, where no load makes it vary
  std::vector<double> K0_;  // of the nodes; one where all have the same
  double longest_;          // as far as a load is looked at ahead
  std::vector<double> eta_, since_, state_;
  std::vector<bool> rests_;
  PetscInt count_ = 0;      // of the nodes that rest
  Sum offsets_, growths_;   // over them: eta less K0 times the plate's way; K0
  std::int64_t added_ = 0;  // since the sums were formed
  std::vector<Side> sides_;
};

// The steps of one cluster of nodes (clusters.hpp), by the pair rk:5dp, each of which ends where a node of it
// starts or stops.

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
  void sum(const Cluster& c, const double* base, const SlopeSum& slopes, double factor, double* into,
           Part nodes) const;
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
  FusedMethod method_;
  const StageProgram& tableau_;
  std::vector<SlopeSum> stage_sums_;   // of its slopes; the last one gives the new values
  SlopeSum error_;
  std::vector<double> stage_times_;    // in parts of a step
  kernel::Coefficients coefficients_;
  std::array<std::vector<Combination>, 2> ends_;  // of a line: the nodes beyond each
  std::vector<double> links_;                     // where they differ (links_along)
  StencilLoop stencil_;
  PointwiseLoop pointwise_;
  SlopeSums add_;
  stick_rule::Candidates candidates_;
  std::array<std::vector<double>, 4> forces_;  // with viscosity: eta + N D2 psi
  std::vector<double> d2_;                     // and what drives nodes
};

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

  // Which resting nodes go by.
  bool by_plate() const { return halts_ && dof_ == 2; }
  double clock(double t) const { return by_plate() ? plate_.at(t) : t; }
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
  double same_time() const { return 1e-13 * first_dt_; }  // base/process.hpp
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
  bool releases_ = false, plate_is_over_ = false;  // the former: while nodes begin to slip as it goes
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
