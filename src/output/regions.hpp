// The regions of slip events under way: unbroken stretches of the line or ring that begin, grow and become
// one. Every rank keeps all of them and does the same with them; nothing here communicates.
#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <vector>

#include "stickslip/model/scene.hpp"
#include "stickslip/output/events.hpp"

namespace stickslip {

// Nodes first .. last, which do not pass the end of the line or the seam of the ring.
struct SlipRegion {
  PetscInt first, last;
};

// This rank's nodes when an event begins: eta, and how far each had slipped in events until then; of the
// nodes beside them that stencils reach, the latter.
struct Before {
  std::vector<double> eta, slipped, slipped_beside;
};

struct LiveEvent {
  // Its left and count are the region; its sums and its slip are those of this rank's nodes until it ends.
  SlipEvent event;
  double kinetic_now = 0;
  bool moves = false;
  long sliding = 0;  // nodes of it that slide now, where they are counted
  std::shared_ptr<const Before> before;
};

// What the nodes of an event add up to when it ends.
struct EventSums {
  double moment = 0, drop = 0, strain = 0;
  double right = -std::numeric_limits<double>::infinity(), left = right;  // the largest slip either way

  // A node of that weight, with eta before and behind.
  void add(double weight, double slip, double before, double behind) {
    right = std::max(right, slip);
    left = std::max(left, -slip);
    moment += weight * slip;
    drop += before - behind;
    strain += weight * slip * (before + behind) / 2;
  }
};
// Puts them into the event, which ends at t.
void conclude(SlipEvent& event, double t, const EventSums& sums);

class Regions {
 public:
  Regions(PetscInt nodes, bool ring) : n_(nodes), ring_(ring) {}

  // All nodes of it begin to move at t, and none of them lies in a region: they join the region beside them,
  // which becomes one with another on their other side, or else are one from now on. Returns the number of
  // the event that they are part of; events are numbered as they begin, and of two that become one the later
  // number stays. `before` is asked where an event begins, on every rank.
  using Remember = std::function<std::shared_ptr<const Before>()>;
  int claim(const SlipRegion& stretch, double t, const Remember& before);
  bool holds(int id, PetscInt node) const;
  // Calls body(i) for the nodes first + i of the region in order of i, 0 <= i < count.
  template <class Body>
  void for_nodes(int id, PetscInt first, PetscInt count, const Body& body) const;

  std::map<int, LiveEvent>& live() { return live_; }  // by their numbers
  const std::map<int, LiveEvent>& live() const { return live_; }
  void put(int id, const LiveEvent& event);  // from a checkpoint
  void end(int id);
  int next_id() const { return next_id_; }
  void number_from(int id) { next_id_ = id; }
  void renumber();  // those under way, from 0 on in the same order

 private:
  int beside(const std::map<PetscInt, int>& ends, PetscInt node) const;
  PetscInt right(const SlipEvent& event) const { return (event.left + event.count - 1) % n_; }
  int begin(PetscInt node, double t, const Remember& before);
  void join(int kept, int taken);

  PetscInt n_;
  bool ring_;
  std::map<int, LiveEvent> live_;
  std::map<PetscInt, int> by_left_, by_right_;  // regions by their ends
  int next_id_ = 0;
};

template <class Body>
void Regions::for_nodes(int id, PetscInt first, PetscInt count, const Body& body) const {
  const SlipEvent& e = live_.at(id).event;
  // behind the seam of a ring first: its nodes have the smaller numbers
  for (const PetscInt left : {e.left - n_, e.left})
    for (PetscInt i = std::max(left - first, PetscInt(0)); i < std::min(left + e.count - first, count); ++i)
      body(i);
}

// Fronts of a slip event, from the times at which its nodes first slip.

// NaN where there is none.
struct Front {
  double speed, error;
};

// The front that runs from the first node of the event to one side (1: towards larger x; -1): the slope of
// place against rupture time, by least squares over the nodes beyond the first three on that side, with its
// standard error. None with fewer than six nodes there, or where all of them begin at once. Where the region
// is a whole ring, the sides meet at the node that begins last, which belongs to the right one.
Front front_of(const SlipEvent& event, const Scene& scene, int side);

}  // namespace stickslip
