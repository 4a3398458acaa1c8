// How much of the last quarter of a run its nodes rest, in the mean over those that are not held:
// `rest_fraction`. A node rests over a step at both ends of which its psi is 0: steps end where a node comes
// to rest or slips. With regularised friction it rests while |psi| is at most 4 eps, as in cycles; where it
// comes to that and leaves it lies within steps, on the course of psi there (step_course.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "output/step_course.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"

namespace stickslip {

class RestFraction : public Observer {
 public:
  static SummaryKey key();
  // Of a run that ends at t_end.
  RestFraction(const Model& model, double t_end);
  // Memory: rests_, and last_ of nodes whose unknowns take `unknowns` bytes.
  static double bytes_a_node(const FrictionParameters& friction, double unknowns) {
    return 1 + (friction.regularised ? unknowns : 0);
  }

  void plan(ObservationPlan& plan) override { by_clusters_ = plan.by_clusters; }
  void step(const ObservedStep& step) override;
  void moved(const MovedNodes& nodes, const MediumNow& now) override;
  void archive(Archive& a) override;
  void summarise(Summary& summary, Vec u) override;

 private:
  // Takes u as the end of a step; how many nodes of this rank rest there and did at the end before.
  long look_at(const double* u);
  // The same for nodes that come slowly to rest: how many there are in the mean over the part of the step of
  // length dt that begins at `begin`, a part of it, over that part.
  double look_within(const double* u, double t, double dt, double begin);
  double part_at_rest(PetscInt node, const double* u, double normal, double dt, double begin) const;
  std::pair<PetscInt, PetscInt> free_nodes() const;  // of this rank: from, to

  const Model& model_;
  double t_end_, slow_;              // at most this fast at rest
  std::vector<std::uint8_t> rests_;  // 1 or 0 of each of this rank's nodes, at the end of the last step
  std::vector<double> rested_;       // the time that they did, added up
  double measured_ = 0;              // time that was looked at
  std::vector<double> last_;         // u at the end of the last step, with slow_ > 0
  double last_normal_ = 1;
  std::array<NodeRates, 2> rates_;  // of the last two ends of steps
  int now_ = 0;                     // the newer of them
  bool by_clusters_ = false;
};

}  // namespace stickslip
