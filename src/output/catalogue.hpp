// The regions of slip events under way: unbroken stretches of the line or ring that begin, grow and become
// one. Every rank keeps all of them and does the same with them; nothing here communicates.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/json.hpp"
#include "model/moved_nodes.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/output/checkpoint.hpp"
#include "stickslip/output/events.hpp"
#include "stickslip/output/observer.hpp"

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

// The catalogue of slip events (events.hpp) of a run in which only what slides is advanced: fed with the
// steps of clusters and with the nodes that start and stop, so that an event costs what its own nodes cost.
//
// The numbers are those of `Events` but for how they are had. eta before an event is eta behind it less (K1
// D2 - K0) d and less K0 times the plate's displacement, so no field is remembered; the work of friction is
// that of eta less what goes into motion and damping. The largest kinetic energy adds up that of clusters
// at their own ends of steps.
class ClusterEvents {
 public:
  explicit ClusterEvents(const Scene& scene, bool ruptures = false);

  void step(const MovedNodes& nodes);
  // Nodes that begin to slide and that stop at t; eta(i): at t, of a node that rests then.
  void change(double t, const std::vector<PetscInt>& starts, const std::vector<PetscInt>& stops,
              const std::function<double(PetscInt)>& eta);
  std::vector<SlipEvent> ended();  // since the last call, in order of the ends
  void archive(Archive& a);        // what is under way; asked for when no events wait for that call

 private:
  PetscInt beside(PetscInt node, int side) const;  // -1: none
  const NodeCoefficients& own(PetscInt i) const {
    return coefficients_[coefficients_.size() == 1 ? 0 : std::size_t(i)];
  }
  void claim(const SlipRegion& stretch, double t);
  void finish(int id, double t, const std::function<double(PetscInt)>& eta);

  Scene scene_;
  std::vector<NodeCoefficients> coefficients_;  // of the nodes; one where all have the same
  Regions regions_;
  std::vector<int> owner_;              // event under way in whose region a node is; -1: none
  std::vector<double> slip_, squares_;  // of a node in a region: in this event; psi^2 at its last end of step
  std::vector<double> rupture_;         // where asked for: when a node in a region first slid in this event
  std::vector<SlipEvent> ended_;
};

// The slip events of a run (events.hpp) as an observer: rows of the group `events`; in the summary their
// number, the largest, b, and how soon they follow each other. With ruptures also rows of the group
// `events/rupture`, one for each node of an event, and where they begin.

// Counts and sums of magnitudes in bins of a quarter, and the slope b of their density exp(-b magnitude) over
// three units from two above the most frequent magnitude, which is that of a block alone: by maximum
// likelihood for a truncated exponential (K. Aki, Bull. Earthq. Res. Inst. 43 (1965) 237, for one that is not
// truncated), its standard error from the curvature. As `postprocess/events.py` has it.
class Magnitudes {
 public:
  void add(double magnitude);
  struct Slope {
    double b, error;
  };
  std::optional<Slope> slope() const;  // of 20 events there or more
  void archive(Archive& a);            // nothing where a checkpoint has none

 private:
  struct Bin {
    double count = 0, sum = 0;
  };
  std::map<int, Bin> bins_;  // by the magnitude's quarters
};

// Times from one event to the next, by their ends: of all events, and of each node those in which it slips.
class Recurrence {
 public:
  Recurrence(const NodeRange& nodes, const Scene& scene)
      : nodes_(nodes), all_(scene.n), last_of_(std::size_t(nodes.count), NAN) {}
  void add(const SlipEvent& event);  // in order of their ends, on every rank
  Json found() const;                // collective
  // Nothing where a checkpoint has none: then the times are those from there on.
  void archive(Archive& a);

 private:
  // Their number, mean, and sum of squares about it: of equal times 0 to round-off, however they are divided.
  struct Sums {
    double count = 0, mean = 0, squares = 0;
    void add(const Sums& more) {
      if (more.count == 0) return;
      const double off = more.mean - mean, part = more.count / (count + more.count);
      squares += more.squares + off * off * count * part;
      mean += off * part;
      count += more.count;
    }
  };
  static Json of(const Sums& sums);
  Sums of_all_ranks() const;  // of nodes; collective

  NodeRange nodes_;
  PetscInt all_;
  double last_ = NAN;            // end of the last event
  std::vector<double> last_of_;  // of the last one of each node of this rank; NAN: none yet
  Sums system_, node_;           // of all events; of this rank's nodes
};

// Events of a model as the steps of its run show them.
class EventsOfSteps {
 public:
  // Above `velocity` a node moves. The model outlives it. Collective.
  EventsOfSteps(const Model& model, double velocity, bool ruptures)
      : model_(model), events_(model.scene(), velocity, NodeRange::of(model), ruptures) {}
  void plan(ObservationPlan& plan);
  // Those that have ended in this step, in order of their ends. Collective.
  std::vector<SlipEvent> step(const ObservedStep& step);
  long count() const { return events_.count(); }
  void archive(Archive& a) { events_.archive(a); }

 private:
  const Model& model_;
  Events events_;
  bool stiff_ = false;
  VecHandle middle_;  // of a step, where friction is stiff
};

// When the events of a run began and ended, the earliest first, of those that have ended.
class EventTimes final : public Measure {
 public:
  EventTimes(const Model& model, double velocity) : events_(model, velocity, false) {}
  void plan(ObservationPlan& plan) override { events_.plan(plan); }
  void step(const ObservedStep& step) override {
    for (const SlipEvent& event : events_.step(step)) times_.emplace_back(event.begin, event.end);
  }
  std::vector<double> values() const override;

 private:
  EventsOfSteps events_;
  std::vector<std::pair<double, double>> times_;
};

class Catalogue : public Observer {
 public:
  // Above `velocity` a node moves. The model is the whole scene. Collective.
  Catalogue(const Model& model, double velocity, bool ruptures, const Plate& plate)
      : model_(model), plate_(plate), velocity_(velocity), ruptures_(ruptures),
        recurrence_(NodeRange::of(model), model.scene()) {
    events_.emplace(model, velocity, ruptures);
  }

  // Of `events`; `halt`: of a plate that does (Plate), whose clock then is that of their times.
  static std::vector<Field> columns(bool halt, bool ruptures);
  static std::vector<Field> rupture_columns();  // of `events/rupture`

  // From now on events come by record(), in order of their ends, and steps show none. `plate_time`: what the
  // plate's clock shows at the event's end.
  void take_events() { events_.reset(); }
  void record(const SlipEvent& event, double plate_time);

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override;
  void step(const ObservedStep& step) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;  // also of a run that failed

 private:
  void enter(const SlipEvent& event, double plate_time);

  const Model& model_;
  const Plate& plate_;
  double velocity_;
  bool ruptures_;
  std::optional<EventsOfSteps> events_;
  long told_ = 0;  // events
  RunFile* file_ = nullptr;
  double begin_ = 0;  // wall clock
  Magnitudes magnitudes_;
  Recurrence recurrence_;
  double largest_moment_ = 0, largest_extent_ = 0;  // of the largest event, and of the longest
};

}  // namespace stickslip
