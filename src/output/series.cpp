#include "output/series.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "model/moved_nodes.hpp"
#include "output/field_watch.hpp"
#include "output/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/collocation.hpp"

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

namespace {
constexpr double largest_count = 9e15;  // below 2^53: the number of a frame is exact in a double
}  // namespace

FrameTimes::FrameTimes(const Options& options) : last_(options.real("ts_max_time")) {
  const char* name = options.is_set("out_times")   ? "out_times"
                     : options.is_set("out_every") ? "out_every"
                                                   : "out_frames";
  option_ = std::string(name) + " " + options.text(name);
  const double t_end = last_;
  if (options.is_set("out_times")) {
    list_ = options.reals("out_times");
    for (const double t : list_)
      if (t < 0 || t > t_end)
        throw UsageError(option_ + ": " + number_text(t) + " lies outside 0 to ts_max_time " +
                         number_text(t_end));
    std::sort(list_.begin(), list_.end());
    list_.erase(std::unique(list_.begin(), list_.end()), list_.end());
  } else if (options.is_set("out_every")) {
    every_ = options.real("out_every");
    count_ = std::floor(t_end * (1 + 1e-12) / every_) + 1;
    last_ = std::min((count_ - 1) * every_, t_end);
  } else {
    count_ = t_end > 0 ? double(options.integer("out_frames")) : 1;
  }
  if (!(count_ < largest_count)) throw UsageError(option_ + ": more frames than can be counted");
}

double FrameTimes::at(double i) const {
  return i >= count_ - 1 ? last_ : every_ > 0 ? i * every_ : last_ * i / (count_ - 1);
}

double FrameTimes::index_after(double t) const {
  const double apart = every_ > 0 ? every_ : last_ / std::max(1., count_ - 1);
  // one before what the division says, which may be rounded up
  double i = apart > 0 ? std::clamp(std::floor(t / apart) - 1, 0., count_) : 0;
  while (i < count_ && at(i) <= t) ++i;
  return i;
}

double FrameTimes::after(double t) const {
  const double none = std::numeric_limits<double>::infinity();
  if (!list_.empty()) {
    const auto next = std::upper_bound(list_.begin(), list_.end(), t);
    return next == list_.end() ? none : *next;
  }
  const double i = index_after(t);
  return i < count_ ? at(i) : none;
}

double FrameTimes::count_after(double t) const {
  return list_.empty() ? count_ - index_after(t)
                       : double(list_.end() - std::upper_bound(list_.begin(), list_.end(), t));
}

Frames::Frames(const Model& model, const Scene& whole, const Options& options,
               const Displacement* displacement, const Plate& plate)
    : model_(model), state_(whole.friction.state), most_bytes_(1e9 * options.real("out_limit")),
      nodes_(whole.n), displacement_(displacement), plate_(plate), work_(model.create_vector()),
      slab_(model, whole.n), times_(options) {
  if (displacement_) chi_ = displacement_->create_vector();
}

void Frames::plan(ObservationPlan& plan) {
  next_ = times_.after(plan.after);
  plan.next_times.push_back([this](double t) { return times_.after(t); });
  const double count = times_.count_after(plan.after);
  plan.layout.frames = static_cast<std::int64_t>(count);
  plan.layout.slab = slab_;
  if (displacement_) plan.layout.fields.push_back(standard_field("chi"));
  const double each = 8. * (1 + double(plan.layout.fields.size() * nodes_));
  if (count * each > most_bytes_)
    throw UsageError(times_.option() + ": " + number_text(count) + " frames of " + rounded_text(each) +
                     " bytes need " + rounded_text(count * each / 1e9) + " GB, more than out_limit, " +
                     rounded_text(most_bytes_ / 1e9) + " GB");
}

void Frames::step(const ObservedStep& step) {
  for (; next_ <= step.t; next_ = times_.after(next_)) {
    step.interpolate(next_, work_);
    write(next_);
  }
  if (halts(model_.scene()) && plate_.at(step.t) >= plate_.end && file_->last_time() < step.t) {
    SS_TRY(VecCopy(step.u, work_));
    write(step.t);
  }
}

void Frames::write(double t) {
  model_.set_time(t);
  model_.set_held(work_);
  const auto dof = std::size_t(model_.dof());
  rows_.resize(dof + (displacement_ ? 1 : 0));
  for (std::vector<double>& row : rows_) row.clear();
  {
    const Reading u(work_);
    for (std::size_t d = 0; d < dof; ++d) slab_.take(u + d, int(dof), rows_[d]);
  }
  if (dof == 3)
    std::transform(rows_[2].begin(), rows_[2].end(), rows_[2].begin(),
                   [&](double s) { return state_to_output(state_, s); });
  if (const double push = model_.scene().push(t); push != 0)
    for (double& eta : rows_[1]) eta -= push;
  if (displacement_) {
    displacement_->solve(work_, t, chi_);
    slab_.take(Reading(chi_), 1, rows_[dof]);
  }
  std::vector<const double*> fields;
  for (const std::vector<double>& row : rows_) fields.push_back(row.data());
  file_->frame(t, fields);
}

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

Travel::Travel(const Model& model, Displacement& displacement)
    : model_(model), displacement_(displacement), work_(model.create_vector()),
      chi_(std::size_t(model.local())), eta_(chi_), slip_(chi_), before_(chi_), now_(chi_) {}

void Travel::plan(ObservationPlan& plan) {
  plan.next_times.emplace_back([](double t) { return std::nextafter(t, HUGE_VAL); });  // within every step
}

void Travel::archive(Archive& a) {
  if (!a.has("travel.until"))
    throw std::runtime_error(
        "its run did not count the displacement, which with model_k0 0 is that since the start "
        "(out_displacement)");
  a.list("travel.until", [this](NumberList& x) { x(until_); });
  a.nodes("travel.start", {&chi_, &eta_});
  a.nodes("travel.slip", {&slip_});
  if (a.restores()) tell();
}

void Travel::step(const ObservedStep& step) {
  step_ = &step;
  if (step.index == 0) {
    const VecHandle chi = displacement_.create_vector();
    displacement_.solve_at_start(step.u, chi);
    const Reading u(step.u), x(chi);
    for (std::size_t i = 0; i < eta_.size(); ++i) {
      eta_[i] = u[PetscInt(i) * model_.dof() + 1];
      chi_[i] = x[PetscInt(i)];
    }
    tell();
    return;
  }
  before_ = slip_;
  add(step.t_before, step.t, slip_);
  until_ = step.t;
}

const std::vector<double>& Travel::at(double t) {
  if (t == until_) return slip_;
  now_ = before_;
  add(step_->t_before, t, now_);
  return now_;
}

// No dense output has a degree of more than 9.
void Travel::add(double from, double to, std::vector<double>& slip) {
  static const Tableau points = Tableau::gauss(5);
  for (int k = 0; k < points.s && to > from; ++k) {
    step_->interpolate(from + (to - from) * points.c[k], work_);
    const double weight = (to - from) * points.b[k];
    const Reading u(work_);
    for (std::size_t i = 0; i < slip.size(); ++i) slip[i] += weight * u[PetscInt(i) * model_.dof()];
  }
}

void Travel::tell() {
  displacement_.count(chi_, eta_, [this](double t) -> const std::vector<double>& { return at(t); });
}

double SlipOfStep::sum_at(const ObservedStep& step, double t, int unknown) {
  if (t < step.t) step.interpolate(t, work_);
  const Reading u(t < step.t ? work_.get() : step.u);
  double sum = 0;
  for (PetscInt i = 0; i < model_.local(); ++i) sum += u[i * model_.dof() + unknown];
  return sum;
}

// No dense output has a degree of more than 9.
double SlipOfStep::between(const ObservedStep& step, double from, double to) {
  static const Tableau points = Tableau::gauss(5);
  double sum = 0;
  for (int i = 0; i < points.s && to > from; ++i)
    sum += (to - from) * points.b[i] * sum_at(step, from + (to - from) * points.c[i], 0);
  return sum;
}

}  // namespace stickslip
