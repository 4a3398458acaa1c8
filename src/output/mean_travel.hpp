// How far the blocks of a chain have gone on the mean since the start of a run, and eta then: what the
// displacement of a chain needs that its forces do not tell the place of (displacement.hpp). From the dense
// output of every step, by Gauss's rule of five points.
//
// Comes before the observers that ask for the displacement, which may be of any time of the step at hand.
#pragma once

#include <vector>

#include "output/slip_of_step.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class MeanTravel : public Observer {
 public:
  // Both must outlive it.
  MeanTravel(const Model& model, Displacement& displacement);

  void plan(ObservationPlan& plan) override;
  void archive(Archive& a) override;
  void step(const ObservedStep& step) override;

 private:
  double at(double t);
  void tell();

  const Model& model_;
  Displacement& displacement_;
  SlipOfStep slip_;
  const ObservedStep* step_ = nullptr;  // at hand
  double before_ = 0, travelled_ = 0;   // at its beginning and end
  std::vector<double> eta_;             // at the start, of this rank's nodes
};

}  // namespace stickslip
