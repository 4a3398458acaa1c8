#include "output/series.hpp"

#include <utility>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "output/field_loops.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

const std::vector<Field> series_fields = {{"psi_mean", "length/time", "mean of psi over the nodes"},
                                          {"psi_min", "length/time", "least psi"},
                                          {"psi_max", "length/time", "largest psi"},
                                          {"eta_mean", "1", "mean of eta over the nodes"},
                                          {"dt", "time", "step taken"},
                                          {"step", "1", "steps so far"},
                                          {"rejections", "1", "rejected steps so far"}};

// With out_displacement; see displacement.hpp.
const std::vector<Field> energy_fields = {
    {"energy_kinetic", "amplitude*length", "kinetic energy in units of the friction amplitude"},
    {"energy_elastic", "amplitude*length", "elastic energy"},
    {"power_input", "amplitude*length/time", "power of the driving plate"},
    {"power_friction", "amplitude*length/time", "power lost in friction"},
    {"power_viscous", "amplitude*length/time", "power lost in damping"}};

}  // namespace

FieldStatistics statistics(const Model& model, Vec u) {
  const FieldSums own = sums_of({Reading(u), model.local(), model.dof()});
  double extremes[2] = {-own.low, own.high}, sums[2] = {own.psi, own.eta};
  largest_over(model.comm(), extremes, 2);
  sum_over(model.comm(), sums, 2);
  const auto nodes = double(model.scene().n);
  return {-extremes[0], extremes[1], sums[0] / nodes, sums[1] / nodes};
}

Series::Series(const Model& model, const Scene& whole, const Displacement* displacement)
    : model_(model), displacement_(displacement && displacement->has_energy() ? displacement : nullptr) {
  const Scene& cell = model.scene();
  const PetscInt blocks = whole.n / cell.n;  // whole cells
  if (displacement && !displacement_)
    warn("out_series: the series hold no energies and powers with a held end, which works on the system too");
  cells_ = whole.form == Form::chain ? blocks : whole.length / cell.length;
}

void Series::plan(ObservationPlan& plan) {
  std::vector<Field>& fields = plan.layout.series;
  fields = series_fields;
  if (model_.scene().load.varies()) fields.push_back({"v", "length/time", "velocity of the driving plate"});
  if (displacement_) fields.insert(fields.end(), energy_fields.begin(), energy_fields.end());
}

void Series::step(const ObservedStep& step) {
  const FieldStatistics s = statistics(model_, step.u);
  std::vector<double> row = {s.psi_mean,
                             s.psi_min,
                             s.psi_max,
                             s.eta_mean,
                             step.t - step.t_before,
                             double(step.index),
                             double(step.rejections)};
  if (model_.scene().load.varies()) row.push_back(model_.plate_velocity(step.t));
  if (displacement_) {
    const Energy e = displacement_->energy(step.u, step.t);
    for (const double part : {e.kinetic, e.elastic, e.input, e.friction, e.viscous})
      row.push_back(cells_ * part);
  }
  file_->series(step.t, row);
}

ProbeRows::ProbeRows(const Model& model, const Scene& whole, std::vector<double> x)
    : x_(std::move(x)), probes_(model, whole, x_) {}

void ProbeRows::plan(ObservationPlan& plan) { plan.layout.probe_x = x_; }

void ProbeRows::step(const ObservedStep& step) {
  if (!file_ || x_.empty()) return;
  const Probes::Values& values = probes_.read(step.u);
  file_->probes(step.t, values.psi, values.eta);
}

void ProbeRows::summarise(Summary& summary, Vec u) {
  if (!u) return;
  const Probes::Values& values = probes_.read(u);
  Json probes = Json::array();
  for (std::size_t i = 0; i < x_.size(); ++i)
    probes.push_back(Json::object({{"x", x_[i]}, {"psi", values.psi[i]}, {"eta", values.eta[i]}}));
  summary.set("probes", probes);
}

void EndStatistics::summarise(Summary& summary, Vec u) {
  if (!u) return;
  const FieldStatistics s = statistics(model_, u);
  summary.set("psi_min", s.psi_min);
  summary.set("psi_max", s.psi_max);
  summary.set("psi_mean", s.psi_mean);
  summary.set("eta_mean", s.eta_mean);
}

}  // namespace stickslip
