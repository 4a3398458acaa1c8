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
  rested_[0] += dt * double(look_at(step.u));
}

long RestFraction::look_at(Vec u) {
  const Reading values(u);
  const double* const psi = values + 0;
  const double slow = slow_;
  const PetscInt dof = model_.dof();
  PetscInt begin = 0, end = model_.local();  // held are ends of the line alone
  if (begin < end && model_.held(model_.first())) ++begin;
  if (begin < end && model_.held(model_.first() + end - 1)) --end;
  long both = 0;
  for (PetscInt i = begin; i < end; ++i) {
    const std::uint8_t rests = std::abs(psi[i * dof]) <= slow;
    both += rests & rests_[i];
    rests_[i] = rests;
  }
  return both;
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
  std::vector<double> rests(rests_.begin(), rests_.end());
  a.nodes("rest.rests", {&rests});
  rests_.assign(rests.begin(), rests.end());
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
