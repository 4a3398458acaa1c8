// The slip events of a run (events.hpp) as an observer: rows of the group `events`; in the summary their
// number, the largest, and b. With ruptures also rows of the group `events/rupture`, one for each node of an
// event, and where they begin.
#pragma once

#include <map>
#include <optional>

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

class Catalogue : public Observer {
 public:
  // Above `velocity` a node moves. The model is the whole scene. Collective.
  Catalogue(const Model& model, double velocity, bool ruptures)
      : model_(model), ruptures_(ruptures), events_(model.scene(), velocity, NodeRange::of(model), ruptures) {
  }

  static std::vector<Field> columns(bool ruptures);  // of `events`
  static std::vector<Field> rupture_columns();       // of `events/rupture`

  // From now on events come by record(), in order of their ends, and steps show none.
  void take_events() { is_told_ = true; }
  void record(const SlipEvent& event);

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override;
  void step(const ObservedStep& step) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;  // also of a run that failed

 private:
  void enter(const SlipEvent& event);

  const Model& model_;
  bool ruptures_;
  Events events_;
  bool is_told_ = false;
  long told_ = 0;  // events
  RunFile* file_ = nullptr;
  double begin_ = 0;  // wall clock
  Magnitudes magnitudes_;
  double largest_moment_ = 0, largest_extent_ = 0;  // of the largest event, and of the longest
};

}  // namespace stickslip
