#include "study/work_precision.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/base/error.hpp"
#include "stickslip/output/reader.hpp"
#include "study/ladder.hpp"

namespace stickslip {

namespace {

constexpr double margin = 100;  // a row's error over that of the reference, at least

PetscInt doubled(const Scene& scene, PetscInt n) { return scene.ring() ? 2 * n : 2 * (n - 1) + 1; }

// A value of which `uncertainty` is less than one part in `margin`.
std::optional<double> resolved(double value, double uncertainty) {
  if (std::isnan(uncertainty)) return value;
  return value >= margin * uncertainty ? std::optional<double>(value) : std::nullopt;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

}  // namespace

PetscInt halved(const Scene& scene, PetscInt n, int order) {
  const PetscInt cells = scene.ring() ? n : n - 1;
  const PetscInt half = cells / 2 + (scene.ring() ? 0 : 1);
  return cells % 2 == 0 && half >= order + 1 ? half : 0;
}

WorkPrecision::WorkPrecision(const Options& options)
    : options_(options), scene_(Scene::from(options, false)), of_(Quantity::from(options, "chart_of")),
      settings_(chart_settings(options)), progress_(options.text("progress"), "chart: "),
      reference_error_(NAN) {}

std::optional<double> WorkPrecision::reference_error() const {
  return std::isnan(reference_error_) ? std::nullopt : std::optional<double>(reference_error_);
}

// ---- references ----

void WorkPrecision::find_references() {
  if (options_.text("chart_reference") != "auto")
    read_reference();
  else if (has_grid_limit(options_, scene_))
    refine_reference();
  for (const Setting& s : settings_) (void)converged(s.order, s.n);
  if (reference_) return;
  reference_error_ = 0;
  for (const Setting& s : settings_)
    reference_error_ = std::max(reference_error_, converged(s.order, s.n).time_error);
}

const Converged& WorkPrecision::converged(int order, PetscInt n) {
  const auto key = std::make_pair(order, n);
  const auto it = converged_.find(key);
  if (it != converged_.end()) return it->second;
  if (progress_.due()) progress_.show(fmt::format("reference, n = {}, order {}", n, order));
  return converged_[key] = converge_in_time(order, n);
}

Converged WorkPrecision::converge_in_time(int order, PetscInt n) const {
  struct Attempt {
    MethodSpec method;
    double tolerance;
  };
  static const std::vector<std::pair<Attempt, Attempt>> pairs = {
      {{{"rk", "8vr", "auto"}, 1e-13}, {{"rk", "7vr", "auto"}, 1e-12}},
      {{{"arkimex", "5", "both"}, 1e-11}, {{"rosw", "4l", "auto"}, 1e-10}}};
  const double limit = options_.real("chart_reference_seconds");
  Converged result;
  result.scene = on_grid(scene_, n, order);
  const auto fail = [&](const std::string& method, const std::string& why) {
    result.failed += fmt::format("{}{}: {}", result.failed.empty() ? "" : "; ", method, why);
  };
  const auto run = [&](const Attempt& attempt, double most) {
    Trial made = run_trial(options_, {attempt.method, attempt.tolerance, 0, order, n}, "reference_", most,
                           of_.measure(options_));
    result.seconds += made.seconds;
    if (!made.is_answer()) fail(made.report.method, made.failed);
    return made;
  };
  for (const auto& [best, second] : pairs) {
    const Trial a = run(best, limit);
    if (!a.is_answer()) continue;
    const Trial b = run(second, 3 * limit);
    if (!b.is_answer()) continue;
    result.answer = {a.end, a.measured};
    result.time_error = apart(result.answer, result.scene, {b.end, b.measured}, result.scene);
    result.method = a.report.method;
    if (of_.is_measured() && a.measured.empty()) {
      fail(result.method, of_.missing());
    } else if (std::isinf(result.time_error)) {
      fail(result.method, fmt::format("{} events, {} of {}; a shorter ts_max_time may help",
                                      a.measured.size() / 2, b.measured.size() / 2, b.report.method));
    } else {
      result.failed.clear();
      return result;
    }
  }
  return result;
}

double WorkPrecision::apart(const Answer& one, const Scene& there, const Answer& other,
                            const Scene& of_other) const {
  if (of_.is_measured()) return Quantity::difference(one.measured, other.measured);
  if (of_.kind == Quantity::Kind::probe)
    return distance(at_points(one.fields, there, {of_.x}), at_points(other.fields, of_other, {of_.x}));
  return distance(one.fields, resample(other.fields, of_other, there));
}

void WorkPrecision::read_reference() {
  const std::string path = options_.text("chart_reference");
  if (of_.is_measured())
    throw UsageError("chart_reference " + quoted(path) + ": a frame does not tell what chart_of " +
                     options_.text("chart_of") + " measures");
  const Frame frame = read_frame("chart_reference", path);
  const std::string says = "chart_reference " + quoted(path) + ": ";
  const double t_end = options_.real("ts_max_time");
  if (std::abs(frame.t - t_end) > 1e-12 * t_end)
    throw UsageError(fmt::format("{}its last frame is at t = {}, ts_max_time is {}", says,
                                 number_text(frame.t), number_text(t_end)));
  Converged c;
  c.scene = scene_;
  c.scene.n = PetscInt(frame.x.size());
  c.scene.order = std::min(possible_orders(scene_).back(), int(c.scene.n) - 1);
  for (PetscInt i = 0; i < c.scene.n; ++i)
    if (std::abs(frame.x[i] - c.scene.x(i)) > 1e-9 * c.scene.length)
      throw UsageError(says + "its nodes are not those of a grid over this scene's length " +
                       number_text(c.scene.length) + " with its ends");
  const StateLaw law = scene_.friction.state;
  std::vector<double> state;
  if (const auto shown = frame.fields.find(state_name(law)); !law.none() && shown != frame.fields.end())
    for (const double value : shown->second) state.push_back(state_from_output(law, value));
  if (!law.none() && state.empty())
    throw UsageError(says + "its last frame has no " + state_name(law) +
                     ", which this scene's friction needs");
  c.answer.fields = fields_with_friction(c.scene, frame.fields.at("psi"), frame.fields.at("eta"), state);
  reference_ = c;
  reference_error_ = NAN;
  reference_text_ = fmt::format("frame at t = {} of '{}', {} nodes; its error is not known",
                                number_text(frame.t), path, c.scene.n);
  warn("chart_reference '" + path +
       "': its own error is not known; errors below it are not those of the rows");
}

void WorkPrecision::refine_reference() {
  const int order = possible_orders(scene_).back();
  PetscInt largest = 0;
  for (const Setting& s : settings_) largest = std::max(largest, s.n);
  std::vector<PetscInt> grids;
  if (const PetscInt half = halved(scene_, largest, order)) grids.push_back(half);
  grids.push_back(std::max<PetscInt>(largest, order + 1));
  FallingErrors errors;
  errors.best = order;
  errors.unseen = std::log2(1.5);  // of two grids the difference tells hardly more than itself
  for (std::size_t k = 0;; ++k) {
    if (k == grids.size()) grids.push_back(doubled(scene_, grids.back()));
    const Converged& fine = converged(order, grids[k]);
    if (!fine.failed.empty()) {
      if (!reference_) throw Failure(fmt::format("no reference: n = {}: {}", grids[k], fine.failed));
      break;
    }
    errors.fineness.push_back(cells_of(fine.scene));
    if (k < 1) continue;
    const double before = k > 1 ? errors.distances.back() : NAN,
                 last = difference(converged(order, grids[k - 1]), fine);
    errors.distances.push_back(last);
    // round-off, which grows with 1/h^2: the grid before was the better
    if (k > 1 && last > before && last < 1e-6) {
      reference_error_ = last + reference_->time_error;
      reference_text_ = described(before, last, order) + "; finer grids are worse by round-off";
      break;
    }
    // half as good as the rates promise
    const double in_space = (k > 1 ? 2 : 1) * errors.predicted(errors.fineness.back());
    reference_ = fine;
    reference_error_ = in_space + fine.time_error;
    reference_text_ = described(before, last, order);
    if (last <= fine.time_error) break;
    if (k > 1 && reference_suffices(in_space, fine)) break;
    // the next grid would take that long
    if (4 * fine.seconds > 3 * options_.real("chart_reference_seconds")) break;
  }
}

// Whether no row needs a better one, or a finer grid would not make it one.
bool WorkPrecision::reference_suffices(double in_space, const Converged& fine) {
  if (in_space <= fine.time_error) return true;
  double smallest = std::numeric_limits<double>::infinity();
  for (const Setting& s : settings_) {
    const Converged& c = converged(s.order, s.n);
    if (c.failed.empty())
      smallest = std::min(smallest, apart(c.answer, c.scene, fine.answer, fine.scene));
  }
  return reference_error_ * 2 * margin <= smallest;
}

std::string WorkPrecision::described(double before, double last, int order) const {
  return fmt::format("n = {}, order {}, {}; differences of the last grids {}{}, error in time {}",
                     reference_->scene.n, order, reference_->method,
                     std::isnan(before) ? "" : number_text(before) + ", ", number_text(last),
                     number_text(reference_->time_error));
}

// Of two grids: at the nodes of the coarser one and at those of every row.
double WorkPrecision::difference(const Converged& coarse, const Converged& fine) const {
  double largest = apart(coarse.answer, coarse.scene, fine.answer, fine.scene);
  if (of_.kind != Quantity::Kind::fields) return largest;
  std::vector<PetscInt> seen;
  for (const Setting& s : settings_) {
    if (std::find(seen.begin(), seen.end(), s.n) != seen.end()) continue;
    seen.push_back(s.n);
    const Scene at = on_grid(scene_, s.n, s.order);
    largest = std::max(largest, distance(resample(coarse.answer.fields, coarse.scene, at),
                                         resample(fine.answer.fields, fine.scene, at)));
  }
  return largest;
}

// ---- rows ----

void WorkPrecision::run_rows() {
  progress_.restart_clock();
  for (const Setting& s : settings_) {
    const std::size_t done = rows_.size(), all = settings_.size();
    if (progress_.due())
      progress_.show(fmt::format("row {} of {}{} ({}, n = {}, order {})", done + 1, all,
                                 progress_.left(double(done) / double(all)), s.method.name(), s.n, s.order));
    rows_.push_back(measure(s));
  }
}

ChartRow WorkPrecision::measure(const Setting& s) {
  ChartRow row;
  row.setting = s;
  row.method = s.method.name();
  row.implicit = s.method.implicit;
  if (looser_took_too_long(s)) {
    row.failed = fmt::format("not run: a looser {} took too long already",
                             s.method.can().has_estimate ? "tolerance" : "step");
    return row;
  }
  const Trial trial = repeated(s, row);
  if (row.failed.empty()) compare({trial.end, trial.measured}, row);
  return row;
}

bool WorkPrecision::looser_took_too_long(const Setting& s) const {
  return std::any_of(rows_.begin(), rows_.end(), [&](const ChartRow& other) {
    const Setting& o = other.setting;
    const bool stopped = other.fault == Fault::too_slow || other.fault == Fault::too_many_steps;
    return stopped && o.method.name() == s.method.name() &&
           o.method.implicit == s.method.implicit && o.order == s.order && o.n == s.n && o.eps == s.eps &&
           (s.method.can().has_estimate ? s.tolerance <= o.tolerance : s.step <= o.step);
  });
}

// Runs chart_repeats times, as far as chart_row_seconds last, and puts what it costs into the row.
Trial WorkPrecision::repeated(const Setting& s, ChartRow& row) const {
  const double limit = options_.real("chart_row_seconds");
  const std::size_t repeats = options_.integer("chart_repeats");
  std::vector<double> seconds;
  Trial trial;
  double spent = 0;
  while (seconds.size() < repeats && (seconds.empty() || spent + seconds.back() < limit)) {
    trial = run_trial(options_, s, "", limit, of_.measure(options_));
    seconds.push_back(trial.seconds);
    spent += trial.seconds;
    if (!trial.is_answer()) break;
  }
  static_cast<Outcome&>(row) = trial;
  row.seconds = median(seconds);
  row.repeats = int(seconds.size());
  row.method = trial.report.method + (s.eps > 0 ? ", smoothed over " + number_text(s.eps) : "");
  if (trial.is_answer() || trial.report.steps > 0) row.implicit = to_string(trial.report.implicit);
  return trial;
}

void WorkPrecision::compare(const Answer& end, ChartRow& row) {
  const Setting& s = row.setting;
  const Scene here = on_grid(scene_, s.n, s.order);
  const Converged& c = converged(s.order, s.n);
  const bool in_time = c.failed.empty();
  if (in_time) row.error_time = resolved(apart(end, here, c.answer, c.scene), c.time_error);
  if (!reference_ && !in_time) {
    row.failed = "no reference: " + c.failed;
    return;
  }
  if (reference_) {
    const Converged& exact = *reference_;
    row.error = resolved(apart(end, here, exact.answer, exact.scene), reference_error_);
    if (in_time && has_grid_limit(options_, scene_))
      row.error_space = resolved(apart(c.answer, c.scene, exact.answer, exact.scene), reference_error_);
  } else {
    row.error = row.error_time;
  }
  if (!row.error) row.failed = "its error is below what the reference resolves";
  if (!row.error || std::isfinite(*row.error)) return;
  const std::size_t times = (reference_ ? *reference_ : c).answer.measured.size();
  row.failed = of_.kind == Quantity::Kind::events
                   ? fmt::format("{} events in place of {}", end.measured.size() / 2, times / 2)
                   : of_.missing();
  row.error = row.error_time = row.error_space = std::nullopt;
}

}  // namespace stickslip
