#include "stickslip/chart.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <sstream>

#include "chart_log.hpp"
#include "progress.hpp"
#include "share.hpp"
#include "stickslip/error.hpp"
#include "stickslip/file.hpp"
#include "stickslip/library_options.hpp"
#include "stickslip/methods.hpp"
#include "stickslip/summary.hpp"

namespace stickslip {

namespace {

constexpr double margin = 100;  // a row's error over that of the reference, at least

std::string key_of(const Setting& s) {
  return s.method.name() + "|" + s.method.implicit + "|" + number_text(s.tolerance) + "|" + number_text(s.step) + "|" +
         std::to_string(s.order) + "|" + std::to_string(s.n);
}

Texts texts_of(const ChartRow& row) {
  std::string warned;
  for (const std::string& w : row.warnings) warned += w + "\n";
  return {{"row", key_of(row.setting)},
          {"method", row.method},
          {"implicit", row.implicit},
          {"error", optional_text(row.error)},
          {"error_time", optional_text(row.error_time)},
          {"error_space", optional_text(row.error_space)},
          {"seconds", number_text(row.seconds)},
          {"repeats", std::to_string(row.repeats)},
          {"steps", std::to_string(row.steps)},
          {"rejections", std::to_string(row.rejections)},
          {"rhs_evaluations", std::to_string(row.rhs_evaluations)},
          {"failed", row.failed},
          {"warnings", warned}};
}

ChartRow row_of(const Setting& setting, const Texts& texts) {
  ChartRow row;
  row.setting = setting;
  row.method = texts.at("method");
  row.implicit = texts.at("implicit");
  row.error = optional_of(texts.at("error"));
  row.error_time = optional_of(texts.at("error_time"));
  row.error_space = optional_of(texts.at("error_space"));
  row.seconds = number_of(texts.at("seconds"));
  row.repeats = int(number_of(texts.at("repeats")));
  row.steps = PetscInt(number_of(texts.at("steps")));
  row.rejections = PetscInt(number_of(texts.at("rejections")));
  row.rhs_evaluations = long(number_of(texts.at("rhs_evaluations")));
  row.failed = texts.at("failed");
  std::istringstream lines(texts.at("warnings"));
  for (std::string line; std::getline(lines, line);) row.warnings.push_back(line);
  return row;
}

PetscInt doubled(const Scene& scene, PetscInt n) { return scene.ring() ? 2 * n : 2 * (n - 1) + 1; }
// 0 where the nodes of the coarser grid would not be among those of this one, or too few for the order
PetscInt halved(const Scene& scene, PetscInt n, int order) {
  const PetscInt cells = scene.ring() ? n : n - 1;
  const PetscInt half = cells / 2 + (scene.ring() ? 0 : 1);
  return cells % 2 == 0 && half >= order + 1 ? half : 0;
}

class Chart {
 public:
  Chart(const Options& options, ChartLog& log)
      : options_(options), scene_(Scene::from(options, false)), settings_(chart_settings(options)), log_(log),
        progress_(options, "chart: "), row_limit_(options.real("chart_row_seconds")),
        reference_limit_(options.real("chart_reference_seconds")) {
    for (const Texts& line : log.lines()) {
      if (line.count("row")) known_rows_[line.at("row")] = line;
      if (line.count("converged")) {
        Converged c;
        c.fields = {numbers_of(line.at("psi")), numbers_of(line.at("eta"))};
        c.time_error = number_of(line.at("time_error"));
        c.seconds = number_of(line.at("seconds"));
        c.method = line.at("method");
        c.failed = line.at("failed");
        const int order = int(number_of(line.at("order")));
        const PetscInt n = PetscInt(number_of(line.at("n")));
        c.scene = Scene::from(options_for(options_, {settings_[0].method, 0, 0, order, n}), false);
        converged_[{order, n}] = c;
      }
    }
  }

  void find_references() {
    if (options_.text("chart_reference") != "auto") {
      read_reference();
    } else if (has_grid_limit(options_, scene_)) {
      refine_reference();
    }
    for (const Setting& s : settings_) (void)converged(s.order, s.n);
    if (reference_) return;
    reference_error_ = 0;
    for (const Setting& s : settings_)
      reference_error_ = std::max(reference_error_, converged(s.order, s.n).time_error);
  }

  void run_rows() {
    std::size_t known = 0;
    for (const Setting& s : settings_) known += known_rows_.count(key_of(s));
    progress_.restart_clock();
    for (const Setting& s : settings_) {
      if (progress_.due()) show_row(s, known);
      const auto it = known_rows_.find(key_of(s));
      if (it != known_rows_.end()) {
        rows_.push_back(row_of(s, it->second));
      } else {
        rows_.push_back(measure(s));
        log_.add(texts_of(rows_.back()));
      }
    }
  }

  const std::vector<ChartRow>& rows() const { return rows_; }
  std::optional<double> reference_error() const {
    return std::isnan(reference_error_) ? std::nullopt : std::optional<double>(reference_error_);
  }
  const std::string& reference_text() const { return reference_text_; }
  std::size_t rows_taken_over() const { return known_rows_.size(); }

 private:
  // `known` rows took no time.
  void show_row(const Setting& s, std::size_t known) {
    const std::size_t done = rows_.size(), all = settings_.size();
    const double part = done > known ? double(done - known) / double(all - known) : 0;
    progress_.show("row " + std::to_string(done + 1) + " of " + std::to_string(all) + progress_.left(part) + " (" +
                   s.method.name() + ", n = " + std::to_string(s.n) + ", order " + std::to_string(s.order) + ")");
  }

  const Converged& converged(int order, PetscInt n) {
    const auto key = std::make_pair(order, n);
    const auto it = converged_.find(key);
    if (it != converged_.end()) return it->second;
    if (progress_.due()) progress_.show("reference, n = " + std::to_string(n) + ", order " + std::to_string(order));
    const Converged& c = converged_[key] = converge_in_time(options_, order, n, reference_limit_);
    log_.add({{"converged", "yes"},
              {"order", std::to_string(order)},
              {"n", std::to_string(n)},
              {"time_error", number_text(c.time_error)},
              {"seconds", number_text(c.seconds)},
              {"method", c.method},
              {"failed", c.failed},
              {"psi", numbers_text(c.fields.psi)},
              {"eta", numbers_text(c.fields.eta)}});
    return c;
  }

  void read_reference() {
    const std::string path = options_.text("chart_reference");
    const Frame frame = read_frame("chart_reference", path);
    const std::string says = "chart_reference " + quoted(path) + ": ";
    const double t_end = options_.real("ts_max_time");
    if (std::abs(frame.t - t_end) > 1e-12 * (1 + t_end))
      throw UsageError(says + "its last frame is at t = " + number_text(frame.t) + ", ts_max_time is " +
                       number_text(t_end));
    Converged c;
    const int order = possible_orders(scene_).back();
    c.scene = scene_;
    c.scene.n = PetscInt(frame.x.size());
    c.scene.order = std::min(order, int(c.scene.n) - 1);
    for (PetscInt i = 0; i < c.scene.n; ++i)
      if (std::abs(frame.x[std::size_t(i)] - c.scene.x(i)) > 1e-9 * (1 + c.scene.length))
        throw UsageError(says + "its nodes are not those of a grid over this scene's length " +
                         number_text(c.scene.length) + " with its ends");
    c.fields = {frame.fields.at("psi"), frame.fields.at("eta")};
    reference_ = c;
    reference_error_ = NAN;
    reference_text_ = "frame at t = " + number_text(frame.t) + " of '" + path + "', " + std::to_string(c.scene.n) +
                      " nodes; its error is not known";
    warn("chart_reference '" + path + "': its own error is not known; errors below it are not those of the rows");
  }

  void refine_reference() {
    const int order = possible_orders(scene_).back();
    PetscInt largest = 0;
    for (const Setting& s : settings_) largest = std::max(largest, s.n);
    std::vector<PetscInt> rungs;
    if (const PetscInt half = halved(scene_, largest, order)) rungs.push_back(half);
    rungs.push_back(std::max<PetscInt>(largest, order + 1));
    double before = NAN, last = NAN;
    std::string why_not_better;
    for (std::size_t k = 0;; ++k) {
      if (k == rungs.size()) rungs.push_back(doubled(scene_, rungs.back()));
      const Converged& fine = converged(order, rungs[k]);
      if (!fine.failed.empty()) {
        if (!reference_) throw Failure("no reference: n = " + std::to_string(rungs[k]) + ": " + fine.failed);
        break;
      }
      if (k > 0) {
        before = last;
        last = difference(converged(order, rungs[k - 1]), fine);
      }
      if (k < 1) continue;
      if (k > 1 && last > before && last < 1e-6) {  // round-off, which grows with 1/h^2: the grid before was the better
        reference_error_ = last + reference_->time_error;
        reference_text_ = described(before, last, order) + "; finer grids are worse by round-off";
        break;
      }
      const double in_space = k > 1 ? error_of_finest(before, last, order) : 2 * last;
      reference_ = fine;
      reference_error_ = in_space + fine.time_error;
      reference_text_ = described(before, last, order);
      if (last <= fine.time_error || (k > 1 && in_space <= fine.time_error)) break;
      double smallest = std::numeric_limits<double>::infinity();
      for (const Setting& s : settings_) {
        const Converged& c = converged(s.order, s.n);
        if (c.failed.empty())
          smallest = std::min(smallest, distance(c.fields, resample(fine.fields, fine.scene, c.scene)));
      }
      if (k > 1 && reference_error_ * 2 * margin <= smallest) break;
      if (4 * fine.seconds > 3 * reference_limit_) break;  // the next grid would take that long
    }
  }

  std::string described(double before, double last, int order) const {
    return "n = " + std::to_string(reference_->scene.n) + ", order " + std::to_string(order) + ", " +
           reference_->method + "; differences of the last grids " +
           (std::isnan(before) ? "" : number_text(before) + ", ") + number_text(last) + ", error in time " +
           number_text(reference_->time_error);
  }

  // Of two grids: at the nodes of the coarser one and at those of every row.
  double difference(const Converged& coarse, const Converged& fine) const {
    double largest = distance(coarse.fields, resample(fine.fields, fine.scene, coarse.scene));
    std::vector<PetscInt> seen;
    for (const Setting& s : settings_) {
      if (std::find(seen.begin(), seen.end(), s.n) != seen.end()) continue;
      seen.push_back(s.n);
      Scene at = scene_;
      at.n = s.n;
      largest = std::max(largest, distance(resample(coarse.fields, coarse.scene, at),
                                           resample(fine.fields, fine.scene, at)));
    }
    return largest;
  }

  // A value of which `uncertainty` is less than one part in `margin`.
  static std::optional<double> resolved(double value, double uncertainty) {
    if (std::isnan(uncertainty)) return value;
    return value >= margin * uncertainty ? std::optional<double>(value) : std::nullopt;
  }

  ChartRow measure(const Setting& s) {
    ChartRow row;
    row.setting = s;
    row.method = s.method.name();
    row.implicit = s.method.implicit;
    for (const ChartRow& other : rows_) {
      const Setting& o = other.setting;
      if (other.failed.rfind("stopped", 0) == 0 && o.method.name() == s.method.name() &&
          o.method.implicit == s.method.implicit && o.order == s.order && o.n == s.n &&
          (s.method.has_estimate() ? s.tolerance <= o.tolerance : s.step <= o.step)) {
        row.failed = "not run: a looser " + std::string(s.method.has_estimate() ? "tolerance" : "step") +
                     " took too long already";
        return row;
      }
    }
    std::vector<double> seconds;
    const PetscInt repeats = options_.integer("chart_repeats");
    Trial trial;
    double spent = 0;
    while (PetscInt(seconds.size()) < repeats && (seconds.empty() || spent + seconds.back() < row_limit_)) {
      trial = run_trial(options_, s, "", row_limit_);
      seconds.push_back(trial.seconds);
      spent += trial.seconds;
      if (!trial.failed.empty()) break;
    }
    std::sort(seconds.begin(), seconds.end());
    row.seconds = seconds.size() % 2 ? seconds[seconds.size() / 2]
                                     : (seconds[seconds.size() / 2 - 1] + seconds[seconds.size() / 2]) / 2;
    row.repeats = int(seconds.size());
    row.method = trial.method;
    row.implicit = trial.implicit;
    row.steps = trial.steps;
    row.rejections = trial.rejections;
    row.rhs_evaluations = trial.rhs_evaluations;
    row.warnings = trial.warnings;
    row.failed = trial.failed;
    if (!row.failed.empty()) return row;

    const Converged& c = converged(s.order, s.n);
    const bool in_time = c.failed.empty();
    if (in_time) row.error_time = resolved(distance(trial.end, c.fields), c.time_error);
    if (!reference_ && !in_time) {
      row.failed = "no reference: " + c.failed;
      return row;
    }
    if (reference_) {
      Scene here = scene_;
      here.n = s.n;
      const Fields exact = resample(reference_->fields, reference_->scene, here);
      row.error = resolved(distance(trial.end, exact), reference_error_);
      if (in_time && has_grid_limit(options_, scene_))
        row.error_space = resolved(distance(c.fields, exact), reference_error_);
    } else {
      row.error = row.error_time;
    }
    if (!row.error) row.failed = "its error is below what the reference resolves";
    return row;
  }

  const Options& options_;
  Scene scene_;
  std::vector<Setting> settings_;
  ChartLog& log_;
  Progress progress_;
  double row_limit_, reference_limit_;
  std::map<std::string, Texts> known_rows_;
  std::map<std::pair<int, PetscInt>, Converged> converged_;
  std::optional<Converged> reference_;  // of the differential equation
  double reference_error_ = NAN;
  std::string reference_text_;
  std::vector<ChartRow> rows_;
};

Json text_or_null(const std::string& text) { return text.empty() ? Json() : Json(text); }

Json json_of(const ChartRow& row) {
  const Setting& s = row.setting;
  const bool adaptive = s.method.has_estimate();
  return Json::object({{"method", row.method},
                       {"implicit", row.implicit},
                       {"tolerance", adaptive ? Json(s.tolerance) : Json()},
                       {"step", adaptive ? Json() : Json(s.step)},
                       {"order", s.order},
                       {"n", s.n},
                       {"error", row.error},
                       {"error_time", row.error_time},
                       {"error_space", row.error_space},
                       {"seconds", row.repeats > 0 ? Json(row.seconds) : Json()},
                       {"repeats", row.repeats},
                       {"steps", row.steps},
                       {"rejections", row.rejections},
                       {"rhs_evaluations", row.rhs_evaluations},
                       {"failed", text_or_null(row.failed)},
                       {"warnings", row.warnings}});
}

void write_file(const std::string& path, const Provenance& provenance, const std::vector<ChartRow>& rows,
                const std::vector<std::size_t>& best, const Chart& chart) {
  ResultFile file(PETSC_COMM_WORLD, path, provenance);
  file.attribute("reference", chart.reference_text());
  file.attribute("reference_error", chart.reference_error().value_or(NAN));
  const auto numbers = [&](const Field& field, auto value) {
    std::vector<double> values;
    for (const ChartRow& row : rows) values.push_back(value(row));
    file.add(field, {"row"}, values);
  };
  const auto texts = [&](const Field& field, auto value) {
    std::vector<std::string> values;
    for (const ChartRow& row : rows) values.push_back(value(row));
    file.add_text(field, {"row"}, values);
  };
  texts({"method", "1", "method"}, [](const ChartRow& r) { return r.method; });
  texts({"implicit", "1", "terms taken implicitly"}, [](const ChartRow& r) { return r.implicit; });
  numbers({"tolerance", "1", "relative and absolute tolerance of a step"},
          [](const ChartRow& r) { return r.setting.method.has_estimate() ? r.setting.tolerance : NAN; });
  numbers({"step", "time", "step, where all are the same"},
          [](const ChartRow& r) { return r.setting.method.has_estimate() ? NAN : r.setting.step; });
  numbers({"order", "1", "order in space"}, [](const ChartRow& r) { return double(r.setting.order); });
  numbers({"n", "1", "nodes"}, [](const ChartRow& r) { return double(r.setting.n); });
  numbers({"error", "1", "largest error of psi and eta"}, [](const ChartRow& r) { return r.error.value_or(NAN); });
  numbers({"error_time", "1", "the part of it from steps in time"},
          [](const ChartRow& r) { return r.error_time.value_or(NAN); });
  numbers({"error_space", "1", "the part of it from the grid"},
          [](const ChartRow& r) { return r.error_space.value_or(NAN); });
  numbers({"cost", "seconds of processor time", "processor time, median of the repetitions"},
          [](const ChartRow& r) { return r.repeats > 0 ? r.seconds : NAN; });
  numbers({"repeats", "1", "repetitions"}, [](const ChartRow& r) { return double(r.repeats); });
  numbers({"steps", "1", "steps"}, [](const ChartRow& r) { return double(r.steps); });
  numbers({"rhs_evaluations", "1", "right-hand sides, or parts of them"},
          [](const ChartRow& r) { return double(r.rhs_evaluations); });
  texts({"failed", "1", "why there is no error"}, [](const ChartRow& r) { return r.failed; });
  std::vector<double> front(rows.size(), 0);
  for (const std::size_t i : best) front[i] = 1;
  file.add({"best", "1", "1 where no other row is as good in as little time"}, {"row"}, front);
  file.write();
}

// What the chart sets for each row is not the user's to set for all.
void refuse_what_rows_choose(const Options& options) {
  std::vector<std::string> names = {"ts_type", "ts_rtol", "ts_atol", "ts_dt", "ts_adapt_type"};
  for (const Method& m : methods())
    if (const std::string name = subtype_option(m.type); !name.empty()) names.push_back(name);
  for (const std::string& name : names)
    if (options.is_set(name))
      throw UsageError("-" + name + " " + quoted(options.text(name)) + ": a chart chooses it row by row; see "
                       "chart_methods, chart_tolerances, chart_steps");
}

}  // namespace

std::vector<std::size_t> chart_front(const std::vector<ChartRow>& rows) {
  std::vector<std::size_t> order, front;
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (rows[i].failed.empty() && rows[i].error) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::make_pair(rows[a].seconds, *rows[a].error) < std::make_pair(rows[b].seconds, *rows[b].error);
  });
  double least = std::numeric_limits<double>::infinity();
  for (const std::size_t i : order) {
    if (*rows[i].error >= least) continue;
    least = *rows[i].error;
    front.push_back(i);
  }
  return front;
}

double error_of_finest(double before, double last, int order) {
  const double rate = before / last;
  if (!(rate > 2)) return 2 * last;
  return 2 * last / std::min(rate, std::pow(2., order));
}

std::vector<Setting> chart_settings(const Options& options) {
  const Scene scene = Scene::from(options, false);
  const bool chain = scene.form == Form::chain;
  std::vector<MethodChoice> list;
  std::vector<std::string> names = options.words("chart_methods");
  if (names.empty())
    names = {"rk:3bs", "rk:5dp", "rk:7vr", "rk:8vr", "arkimex:3:friction", "arkimex:4:friction", "arkimex:4:wave",
             "rosw:ra34pw2"};
  for (const std::string& name : names) list.push_back(MethodChoice::parse("chart_methods", name));

  std::vector<double> tolerances = options.reals("chart_tolerances"), steps = options.reals("chart_steps");
  if (tolerances.empty()) tolerances = {1e-3, 1e-5, 1e-7, 1e-9};

  std::vector<int> orders;
  const std::vector<int> possible = possible_orders(scene);
  for (const PetscInt order : options.integers("chart_orders")) {
    if (std::find(possible.begin(), possible.end(), int(order)) == possible.end())
      throw UsageError("chart_orders " + options.text("chart_orders") + ": " + std::to_string(order) +
                       (chain ? ": the chain's second difference is the model itself, of order 2"
                              : order % 2 != 0 ? " is no order; there are 2, 4, 6 and 8"
                                               : ": order 8 with a held end is unstable; there are 2, 4 and 6"));
    orders.push_back(int(order));
  }
  if (orders.empty() && (options.is_set("grid_order") || chain)) orders = {scene.order};
  if (orders.empty()) orders = {2, 4, possible.back()};

  std::vector<PetscInt> grids = options.integers("chart_grids");
  const bool one_grid = !has_grid_limit(options, scene);
  if (one_grid && grids.size() > 1)
    throw UsageError("chart_grids " + options.text("chart_grids") + ": " +
                     (chain ? "the chain's blocks are the model itself"
                            : "the start (init_noise, init_type file) lives on one grid") +
                     "; give one");
  if (one_grid && orders.size() > 1) {
    if (options.is_set("chart_orders"))
      throw UsageError("chart_orders " + options.text("chart_orders") +
                       ": the start (init_noise, init_type file) lives "
                       "on one grid; give one order");
    orders = {scene.order};
  }
  if (grids.empty()) {
    if (const PetscInt half = halved(scene, scene.n, orders.back()); half > 0 && !one_grid) grids.push_back(half);
    grids.push_back(scene.n);
  }

  const double own = std::sqrt(scene.A() * scene.K0()), rate = own > 0 ? own : 1;
  std::vector<Setting> settings;
  for (const MethodChoice& method : list)
    for (const int order : orders)
      for (const PetscInt n : grids) {
        const auto add = [&](double tolerance, double step) {
          const Setting s{method, tolerance, step, order, n};
          (void)Scene::from(options_for(options, s), false);
          settings.push_back(s);
        };
        if (!method.has_estimate() && !steps.empty()) {
          for (const double step : steps) add(0, step);
          continue;
        }
        for (const double tolerance : tolerances)
          add(tolerance, method.has_estimate() ? 0 : std::pow(tolerance, 1. / method.order()) / rate);
      }
  return settings;
}

int chart_errors(const Options& options) {
  refuse_what_rows_choose(options);
  const Scene scene = Scene::from(options, false);
  if (has_threshold(scene.friction.law) && !scene.friction.regularised)
    throw UsageError("friction_stick exact: a chart needs friction_stick regularised with friction_law " +
                     to_string(scene.friction.law));
  if (options.real("ts_max_time") == 0) throw UsageError("ts_max_time 0: a chart needs a run of some length");
  const std::string out_file = options.text("out_file");
  check_outputs(out_file, options.text("summary"));

  const Provenance provenance = Provenance::of("chart", options.all());
  Summary summary(provenance, {"rows", "best", "reference_error", "reference", "clock", "rows_taken_over"},
                  options.text("summary"));
  return with_summary(summary, [&] {
    check_settings(options, chart_settings(options));
    check_unused_after_setup(options, "snes ksp pc");
    ChartLog log(options, provenance);
    summary.set("clock", "processor time, the largest over the ranks");
    Chart chart(options, log);
    summary.set("rows_taken_over", chart.rows_taken_over());
    const auto report = [&] {
      Json rows = Json::array(), best = Json::array();
      std::vector<std::size_t> front = chart_front(chart.rows());
      for (const ChartRow& row : chart.rows()) rows.push(json_of(row));
      for (const std::size_t i : front) best.push(json_of(chart.rows()[i]));
      summary.set("rows", rows);
      summary.set("best", best);
      summary.set("reference_error", chart.reference_error());
      summary.set("reference", text_or_null(chart.reference_text()));
      return front;
    };
    try {
      chart.find_references();
      chart.run_rows();
    } catch (...) {
      (void)report();
      throw;
    }
    const std::vector<std::size_t> front = report();
    if (front.empty())
      warn("no row has an error that could be told: see `failed` of the rows (more chart_reference_seconds, a shorter "
           "ts_max_time or finer grids help)");
    write_file(out_file, provenance, chart.rows(), front, chart);
    log.remove();
    return 0;
  });
}

}  // namespace stickslip
