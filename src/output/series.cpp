#include "output/series.hpp"

#include <algorithm>
#include <utility>

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
  const double* a;
  SS_TRY(VecGetArrayRead(u, &a));
  const int dof = model.dof();
  double extremes[2] = {-1e300, -1e300}, sums[2] = {0, 0};  // of -psi and psi; of psi and eta
  for (PetscInt i = 0; i < model.local(); ++i) {
    const double psi = a[i * dof];
    extremes[0] = std::max(extremes[0], -psi);
    extremes[1] = std::max(extremes[1], psi);
    sums[0] += psi;
    sums[1] += a[i * dof + 1];
  }
  SS_TRY(VecRestoreArrayRead(u, &a));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, extremes, 2, MPI_DOUBLE, MPI_MAX, model.comm()));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_DOUBLE, MPI_SUM, model.comm()));
  const auto n = double(model.scene().n);
  return {-extremes[0], extremes[1], sums[0] / n, sums[1] / n};
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
  if (displacement_) fields.insert(fields.end(), energy_fields.begin(), energy_fields.end());
}

void Series::step(const ObservedStep& step) {
  const FieldStatistics s = statistics(model_, step.u);
  std::vector<double> row = {s.psi_mean, s.psi_min, s.psi_max, s.eta_mean, step.t - step.t_before,
                             double(step.index), double(step.rejections)};
  if (displacement_) {
    const Energy e = displacement_->energy(step.u);
    for (const double part : {e.kinetic, e.elastic, e.input, e.friction, e.viscous}) row.push_back(cells_ * part);
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
