// How much of the last quarter of a run its nodes rest, in the mean over those that are not held:
// `rest_fraction`. A node rests over a step at both ends of which its psi is 0 (steps end where a node comes
// to rest or slips), with regularised friction within 4 eps, as in cycles.
#pragma once

#include <cstdint>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class RestFraction : public Observer {
 public:
  static SummaryKey key();
  // Of a run that ends at t_end.
  RestFraction(const Model& model, double t_end);
  static double bytes_a_node() { return 1; }  // memory: rests_

  void plan(ObservationPlan& plan) override { by_clusters_ = plan.by_clusters; }
  void step(const ObservedStep& step) override;
  void moved(const MovedNodes& nodes, const MediumNow& now) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;

 private:
  // Takes u as the end of a step; how many nodes of this rank rest there and did at the end before.
  long look_at(Vec u);

  const Model& model_;
  double t_end_, slow_;              // at most this fast at rest
  std::vector<std::uint8_t> rests_;  // 1 or 0 of each of this rank's nodes, at the end of the last step
  std::vector<double> rested_;       // the time that they did, added up
  double measured_ = 0;              // time that was looked at
  bool by_clusters_ = false;
};

}  // namespace stickslip
