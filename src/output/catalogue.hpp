// The slip events of a run (events.hpp) as an observer: rows of the group `events`, and their number in the
// summary.
#pragma once

#include "stickslip/model/model.hpp"
#include "stickslip/output/events.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class Catalogue : public Observer {
 public:
  // Above `velocity` a node moves. The model is the whole scene. Collective.
  Catalogue(const Model& model, double velocity)
      : model_(model), events_(model.scene(), velocity, NodeRange::of(model)) {}

  void plan(ObservationPlan& plan) override;
  void start(RunFile* file) override;
  void step(const ObservedStep& step) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;  // also of a run that failed

 private:
  const Model& model_;
  Events events_;
  RunFile* file_ = nullptr;
  double begin_ = 0;  // wall clock
};

}  // namespace stickslip
