#include "output/series.hpp"

#include <cmath>
#include <limits>
#include <utility>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "output/field_loops.hpp"
#include "output/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

FieldStatistics statistics(const Model& model, Vec u) {
  const FieldSums own = sums_of({Reading(u), model.local(), model.dof()});
  double extremes[2] = {-own.low, own.high}, sums[2] = {own.psi, own.eta};
  largest_over(model.comm(), extremes, 2);
  sum_over(model.comm(), sums, 2);
  const auto nodes = double(model.scene().n);
  return {-extremes[0], extremes[1], sums[0] / nodes, sums[1] / nodes - model.scene().push(model.time())};
}

struct Series::Row {
  FieldStatistics fields;
  double dt, steps, rejections, v, plate_time, normal;
  Energy energy;  // of the whole scene
};

std::vector<RowColumn<Series::Row>> Series::columns(bool load, bool halt, bool normal, bool energy) {
  std::vector<RowColumn<Row>> columns = {
      {{"psi_mean", "length/time", "mean of psi over the nodes"},
       [](const Row& r) { return r.fields.psi_mean; }},
      {{"psi_min", "length/time", "least psi"}, [](const Row& r) { return r.fields.psi_min; }},
      {{"psi_max", "length/time", "largest psi"}, [](const Row& r) { return r.fields.psi_max; }},
      {{"eta_mean", "1", "mean of eta over the nodes"}, [](const Row& r) { return r.fields.eta_mean; }},
      {{"dt", "time", "step taken; with clusters the time since the row before"},
       [](const Row& r) { return r.dt; }},
      {{"step", "1", "steps so far"}, [](const Row& r) { return r.steps; }},
      {{"rejections", "1", "rejected steps so far"}, [](const Row& r) { return r.rejections; }}};
  const std::vector<RowColumn<Row>> of_load = {
      {{"v", "length/time", "velocity of the driving plate"}, [](const Row& r) { return r.v; }}};
  const std::vector<RowColumn<Row>> of_halt = {{{"plate_time", "time", "with `load_halt`: the plate's clock"},
                                                [](const Row& r) { return r.plate_time; }}};
  const std::vector<RowColumn<Row>> of_normal = {
      {{"normal", "1", "normal load, by which friction is multiplied"},
       [](const Row& r) { return r.normal; }}};
  const std::vector<RowColumn<Row>> of_energy = {
      // see displacement.hpp
      {{"energy_kinetic", "amplitude*length", "kinetic energy in units of the friction amplitude"},
       [](const Row& r) { return r.energy.kinetic; }},
      {{"energy_elastic", "amplitude*length", "elastic energy"},
       [](const Row& r) { return r.energy.elastic; }},
      {{"power_input", "amplitude*length/time", "power of the driving plate, and of a harmonic force"},
       [](const Row& r) { return r.energy.input; }},
      {{"power_friction", "amplitude*length/time", "power lost in friction"},
       [](const Row& r) { return r.energy.friction; }},
      {{"power_viscous", "amplitude*length/time", "power lost in damping"},
       [](const Row& r) { return r.energy.viscous; }}};
  if (load) columns.insert(columns.end(), of_load.begin(), of_load.end());
  if (halt) columns.insert(columns.end(), of_halt.begin(), of_halt.end());
  if (normal) columns.insert(columns.end(), of_normal.begin(), of_normal.end());
  if (energy) columns.insert(columns.end(), of_energy.begin(), of_energy.end());
  return columns;
}

Series::Series(const Model& model, const Scene& whole, const Displacement* displacement, const Plate& plate,
               std::int64_t every)
    : model_(model), plate_(plate),
      displacement_(displacement && displacement->has_energy() ? displacement : nullptr), every_(every) {
  const Scene& cell = model.scene();
  const PetscInt blocks = whole.n / cell.n;  // whole cells
  if (displacement && !displacement_)
    warn("out_series: the series hold no energies and powers with a held end, which works on the system too");
  cells_ = whole.form == Form::chain ? blocks : whole.length / cell.length;
  columns_ = columns(cell.load.varies(), halts(cell), cell.normal.varies(), displacement_ != nullptr);
}

std::vector<Field> Series::fields() { return fields_of(columns(true, true, true, true)); }

void Series::plan(ObservationPlan& plan) {
  plan.layout.groups.push_back({"series", standard_field("t"), fields_of(columns_)});
  by_clusters_ = plan.by_clusters;
}

void Series::step(const ObservedStep& step) {
  if (by_clusters_ ? step.index > 0 && !displacement_ : step.index % every_ != 0) return;
  model_.set_time(step.t);
  Row row{statistics(model_, step.u),
          step.t - (by_clusters_ ? last_ : step.t_before),
          double(step.index),
          double(step.rejections),
          velocity_of_plate_alone(model_.scene(), model_.plate_velocity(step.t), step.t),
          plate_.at(step.t),
          model_.normal_load(step.t).N,
          {}};
  if (displacement_) {
    const Energy e = displacement_->energy(step.u, step.t);
    row.energy = {cells_ * e.kinetic, cells_ * e.elastic, cells_ * e.input, cells_ * e.friction,
                  cells_ * e.viscous};
  }
  if (!by_clusters_) return file_->row("series", step.t, numbers_of(columns_, row));
  put(step.t, row);
  shown_ = step.t;
}

void Series::put(double t, const Row& row) {
  row_.put(t, numbers_of(columns_, row), writer());
  last_ = t;
  changes_ = node_steps_ = 0;
}

void Series::put(double t, const MediumNow& now) {
  if (t == shown_) return;  // and its energies are known
  const MediumNow::Totals all = now.totals(t);
  const auto n = double(model_.scene().n);
  const Load& load = model_.scene().load;
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  Row row{{all.psi_min, all.psi_max, all.psi_sum / n, all.eta_sum / n},
          t - last_,
          double(now.steps()),
          double(now.rejections()),
          halts(model_.scene()) ? (plate_.goes ? model_.scene().v : 0)
          : load.varies()       ? load.before(t)
                                : model_.scene().v,
          plate_.at(t),
          1,
          {unknown, unknown, unknown, unknown, unknown}};
  put(t, row);
}

void Series::changed(double t, const MediumNow& now) {
  if (++changes_ >= double(every_)) put(t, now);
}

void Series::moved(const MovedNodes& nodes, const MediumNow& now) {
  node_steps_ += nodes.count;
  if (node_steps_ >= double(every_) * double(now.advanced())) put(nodes.t1, now);
}

RowOfTime::Write Series::writer() const {
  return [this](double t, const std::vector<double>& row) { file_->row("series", t, row); };
}

void Series::told_until(double t) { row_.write_until(t, writer()); }

void Series::archive(Archive& a) {
  if (a.restores() ? !a.has("series.row") : !by_clusters_) return;
  a("series.since_row", last_, changes_, node_steps_, shown_);
  row_.archive(a, "series.row");
}

ProbeRows::ProbeRows(const Model& model, const Scene& whole, std::vector<double> x)
    : model_(model), x_(std::move(x)), probes_(model, whole, x_),
      attention_(probes_.nodes(), model.scene().n) {}

void ProbeRows::plan(ObservationPlan& plan) {
  if (!x_.empty())
    plan.layout.groups.push_back(
        {"probes", standard_field("t"), {standard_field("psi"), standard_field("eta")}, x_});
  by_clusters_ = plan.by_clusters;
}

void ProbeRows::step(const ObservedStep& step) {
  if (!file_ || x_.empty()) return;
  model_.set_time(step.t);
  if (by_clusters_)
    put(step.t, probes_.read(step.u));
  else
    file_->row("probes", step.t, row(probes_.read(step.u)));
}

std::vector<double> ProbeRows::row(const Probes::Values& values) {
  std::vector<double> row = values.psi;
  row.insert(row.end(), values.eta.begin(), values.eta.end());
  return row;
}

void ProbeRows::put(double t, const Probes::Values& values) { row_.put(t, row(values), writer()); }

void ProbeRows::moved(const MovedNodes& nodes, const MediumNow& now) {
  if (file_ && attention_.moved(nodes))
    put(nodes.t1, probes_.read([&](PetscInt i, double* u) { now.node(i, nodes.t1, u); }));
}

void ProbeRows::changed(double t, const MediumNow& now) {
  if (file_ && attention_.changed(now))
    put(t, probes_.read([&](PetscInt i, double* u) { now.node(i, t, u); }));
}

RowOfTime::Write ProbeRows::writer() const {
  return [this](double t, const std::vector<double>& row) { file_->row("probes", t, row); };
}

void ProbeRows::told_until(double t) { row_.write_until(t, writer()); }

void ProbeRows::archive(Archive& a) {
  if (x_.empty() || (a.restores() ? !a.has("probes.row") : !by_clusters_)) return;
  a.list("probes.advanced", [&](NumberList& x) { attention_.archive(x); });
  row_.archive(a, "probes.row");
}

void ProbeRows::summarise(Summary& summary, Vec u) {
  if (!u) return;
  const Probes::Values& values = probes_.read(u);
  Json probes = Json::array();
  for (std::size_t i = 0; i < x_.size(); ++i)
    probes.push_back(Json::object({{"x", x_[i]}, {"psi", values.psi[i]}, {"eta", values.eta[i]}}));
  summary.set("probes", probes);
}

namespace {

Columns<FieldStatistics> statistics_columns() {
  return {{"psi_min", "length/time", "least psi of a node at `t_end`", &FieldStatistics::psi_min},
          {"psi_max", "length/time", "largest psi of a node at `t_end`", &FieldStatistics::psi_max},
          {"psi_mean", "length/time", "mean of psi over the nodes at `t_end`", &FieldStatistics::psi_mean},
          {"eta_mean", "1", "mean of eta over the nodes at `t_end`", &FieldStatistics::eta_mean}};
}

}  // namespace

std::vector<SummaryKey> EndStatistics::keys() { return keys_of(statistics_columns()); }

void EndStatistics::summarise(Summary& summary, Vec u) {
  if (u) set_keys(summary, statistics_columns(), statistics(model_, u));
}

}  // namespace stickslip
