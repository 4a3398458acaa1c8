// What rests beyond all clusters (clusters.hpp), in closed form: eta grows by K0 times the plate's
// displacement, and the state evolves by itself. Two heaps, one for each direction, say which node starts
// to slip next: by the displacement of the plate until then, which under a load v(t) all nodes share; by
// the time with a state, where it is found for each node, and may not exist. All times are by the plate's
// clock where that halts (Plate), as it stands for all of them alike. No neighbour of such a node
// moves, so viscosity between neighbours adds nothing.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <queue>
#include <vector>

#include "stickslip/model/model.hpp"

namespace stickslip {

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
    // of each node: the time of its release, or under a load without a state the plate's displacement then,
    // times the direction
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
  std::vector<double> K0_;  // of the nodes; one where all have the same
  double longest_;          // as far as a load is looked at ahead
  std::vector<double> eta_, since_, state_;
  std::vector<bool> rests_;
  PetscInt count_ = 0;      // of the nodes that rest
  Sum offsets_, growths_;   // over them: eta less K0 times the plate's way; K0
  std::int64_t added_ = 0;  // since the sums were formed
  std::vector<Side> sides_;
};

}  // namespace stickslip
