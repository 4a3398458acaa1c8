// The slip events of a run (events.hpp) as an observer: rows of the group `events`; in the summary their
// number, the largest, b, and how soon they follow each other. With ruptures also rows of the group
// `events/rupture`, one for each node of an event, and where they begin.
#pragma once

#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "base/json.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/events.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

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

class Catalogue : public Observer {
 public:
  // Above `velocity` a node moves. The model is the whole scene. Collective.
  Catalogue(const Model& model, double velocity, bool ruptures, const Plate& plate)
      : model_(model), plate_(plate), velocity_(velocity), ruptures_(ruptures),
        recurrence_(NodeRange::of(model), model.scene()) {
    events_.emplace(model.scene(), velocity, NodeRange::of(model), ruptures);
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
  bool ruptures_, stiff_ = false;
  VecHandle middle_;  // of a step, where friction is stiff
  std::optional<Events> events_;
  long told_ = 0;  // events
  RunFile* file_ = nullptr;
  double begin_ = 0;  // wall clock
  Magnitudes magnitudes_;
  Recurrence recurrence_;
  double largest_moment_ = 0, largest_extent_ = 0;  // of the largest event, and of the longest
};

}  // namespace stickslip
