// The range that psi runs through at every node in the third and in the last quarter of a run, from all accepted
// steps: the samples of a Measurement, at equal times, miss the top of a slip that is shorter than their distance.
// One pass over the rank's own nodes a step; nothing is communicated before `into`.
#pragma once

#include <vector>

#include "stickslip/file.hpp"
#include "stickslip/measure.hpp"
#include "stickslip/model.hpp"

namespace stickslip {

class Ranges {
 public:
  Ranges(const Model& model, double t_end) : model_(model), t_end_(t_end) {}
  // u at t, after an accepted step.
  void after(double t, Vec u);
  // Hands what was seen to the measurement on rank 0; may be called again later. `work`: of the model, overwritten.
  // Collective.
  void into(Measurement& measurement, Gather& gather, Vec work) const;

 private:
  const Model& model_;
  double t_end_;
  std::vector<double> low_[2], high_[2];
};

}  // namespace stickslip
