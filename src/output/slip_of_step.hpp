// How far the nodes slip in a part of a step, from its dense output.
#pragma once

#include "base/local_values.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class SlipOfStep {
 public:
  explicit SlipOfStep(const Model& model) : model_(model), work_(model.create_vector()) {}

  // Of an unknown (0: psi, 1: eta) over this rank's nodes, at a time of the step. Collective.
  double sum_at(const ObservedStep& step, double t, int unknown);
  // The integral of psi over this rank's nodes and from one time of the step to another. Collective.
  double between(const ObservedStep& step, double from, double to);

 private:
  const Model& model_;
  VecHandle work_;
};

}  // namespace stickslip
