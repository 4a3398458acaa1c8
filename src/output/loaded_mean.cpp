#include "output/loaded_mean.hpp"

#include <cmath>
#include <limits>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "model/moved_nodes.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

LoadedMean::LoadedMean(const Model& model) : model_(model) {
  const Scene& s = model.scene();
  period_ = s.any_held() || s.medium.profile("model_k0") || springless(s) ? 0 : s.forcing_period();
  if (period_ > 0) work_ = model.create_vector();
}

std::vector<SummaryKey> LoadedMean::keys() {
  return {{"psi_loaded_mean", "length/time",
           "under a sine load: mean of psi over the nodes and the last whole period of the load; null with a "
           "held end, without springs to the plate or with unequal ones, or before a period has passed"}};
}

double LoadedMean::next(double t) const {
  double k = std::floor(t / period_);
  while (k * period_ <= t) ++k;
  return k * period_;
}

void LoadedMean::plan(ObservationPlan& plan) {
  if (period_ > 0) plan.next_times.emplace_back([this](double t) { return t < 0 ? 0 : next(t); });
}

double LoadedMean::force(Vec u) const {
  const Scene& s = model_.scene();
  const Reading a(u);
  double sum[2] = {0, 0};
  for (PetscInt i = 0; i < model_.local(); ++i) {
    const double weight = node_weight(s, model_.first() + i);
    const NodeCoefficients c = model_.coefficients(i);
    sum[0] +=
        weight * (a[i * model_.dof() + 1] + (c.s_delta == 0 ? 0 : c.s_delta / c.A * a[i * model_.dof()]));
    sum[1] += weight;
  }
  sum_over(model_.comm(), sum, 2);
  return sum[0] / sum[1];
}

void LoadedMean::step(const ObservedStep& step) {
  if (period_ == 0) return;
  for (double t = double(count_) * period_; t <= step.t; t = double(count_) * period_) {
    if (t < step.t) step.interpolate(t, work_);
    marks_ = {marks_[1], force(t < step.t ? work_.get() : step.u)};
    ++count_;
  }
}

void LoadedMean::summarise(Summary& summary, Vec u) {
  if (!u || count_ < 2) return;
  const double end = double(count_ - 1) * period_, begin = end - period_;
  const Scene& scene = model_.scene();
  const double way = scene.way(end) - scene.way(begin);
  summary.set("psi_loaded_mean", (way - (marks_[1] - marks_[0]) / scene.K0()) / period_);
}

}  // namespace stickslip
