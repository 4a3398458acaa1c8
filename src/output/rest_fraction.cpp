#include "output/rest_fraction.hpp"

#include <algorithm>
#include <cmath>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "model/moved_nodes.hpp"

namespace stickslip {

SummaryKey RestFraction::key() {
  return {
      "rest_fraction", "1",
      "part of `measured_over` at rest, a mean over the nodes; 0: nothing rests. With regularised friction "
      "a node rests where abs(psi) is below 4 `friction_eps`"};
}

RestFraction::RestFraction(const Model& model, double t_end)
    : model_(model), t_end_(t_end),
      slow_(model.scene().friction.jumps_at_rest() && model.scene().friction.regularised
                ? 4 * model.scene().friction.eps
                : 0),
      rests_(std::size_t(model.local())), rested_(1) {}

void RestFraction::step(const ObservedStep& step) {
  const double begin = std::max(step.t_before, 0.75 * t_end_), dt = std::max(step.t - begin, 0.);
  measured_ += dt;
  if (by_clusters_) {
    rested_[0] +=
        dt * (model_.scene().n - double(model_.held(0)) - double(model_.held(model_.scene().n - 1)));
    return;
  }
  const Reading a(step.u);
  for (PetscInt i = 0; i < model_.local(); ++i) {
    if (model_.held(model_.first() + i)) continue;
    const double rests = std::abs(a[i * model_.dof()]) <= slow_ ? 1 : 0;
    rested_[0] += dt * rests * rests_[i];
    rests_[i] = rests;
  }
}

// What is advanced and slides does not rest.
void RestFraction::moved(const MovedNodes& m, const MediumNow&) {
  const double dt = m.t1 - std::max(m.t0, 0.75 * t_end_);
  for (PetscInt k = 0; k < m.count && dt > 0; ++k)
    if (m.direction[k] != 0 && !model_.held((m.first + k) % model_.scene().n)) rested_[0] -= dt;
}

void RestFraction::archive(Archive& a) {
  if (!a.has("rest.rested")) return;
  double t_end = t_end_;
  a("rest.measured", t_end, measured_);
  a.nodes("rest.rests", {&rests_});
  a.by_rank("rest.rested", rested_);
  if (t_end == t_end_) return;
  measured_ = 0;  // the last quarter of another run
  rested_ = {0};
}

void RestFraction::summarise(Summary& summary, Vec u) {
  if (!u || !(measured_ > 0)) return;
  double all[2] = {rested_[0], 0};
  for (PetscInt i = 0; i < model_.local(); ++i) all[1] += model_.held(model_.first() + i) ? 0 : 1;
  sum_over(model_.comm(), all, 2);
  if (all[1] > 0) summary.set("rest_fraction", all[0] / all[1] / measured_);
}

}  // namespace stickslip
