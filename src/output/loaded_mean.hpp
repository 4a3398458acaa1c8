// The mean velocity under a load that repeats (load_sine_...), over all nodes and the last whole period of
// the load. It follows from the forces at the period's two ends: summed over the nodes, between free ends or
// on a ring, eta_t = K0 (v - psi) - s delta (psi_t/A + B psi), with delta or B being 0, so that
//     int psi dt = int v dt - [eta + s delta psi/A]/K0   (means; free ends of a continuum count half)
// exactly. None with a held end, or K0 = 0, or before a period has passed.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class LoadedMean : public Observer {
 public:
  static std::vector<SummaryKey> keys();
  explicit LoadedMean(const Model& model);

  void plan(ObservationPlan& plan) override;
  void step(const ObservedStep& step) override;
  void archive(Archive& a) override { a("loaded_mean.marks", marks_[0], marks_[1], count_); }
  void summarise(Summary& summary, Vec u) override;

 private:
  double next(double t) const;
  double force(Vec u) const;

  const Model& model_;
  double period_;  // 0: nothing to measure
  VecHandle work_;
  std::array<double, 2> marks_{};  // the mean of eta + s delta psi/A at the last two ends of a period
  long count_ = 0;                 // of them so far
};

}  // namespace stickslip
