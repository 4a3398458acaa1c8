#include "stickslip/study/chart.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/pulse.hpp"
#include "output/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/time/methods.hpp"
#include "study/ladder.hpp"
#include "study/work_precision.hpp"

namespace stickslip {

namespace {

Table<ChartRow> chart_table() {
  using Row = const ChartRow&;
  const auto adaptive = [](Row r) { return r.setting.method.can().has_estimate; };
  return {"rows",
          "",
          "row",
          {{"method", "1", "method", &ChartRow::method},
           {"implicit", "1", "terms taken implicitly", &ChartRow::implicit},
           {"tolerance", "1", "tolerance of a step, relative and in parts of the scales",
            [=](Row r) { return adaptive(r) ? Json(r.setting.tolerance) : Json(); }},
           {"step", "time", "step, where all are the same",
            [=](Row r) { return adaptive(r) ? Json() : Json(r.setting.step); }},
           {"eps", "velocity", "velocity over which a threshold is smoothed; 0: as the scene has it",
            [](Row r) { return r.setting.eps; }},
           {"order", "1", "order in space", [](Row r) { return r.setting.order; }},
           {"n", "1", "nodes", [](Row r) { return r.setting.n; }},
           {"error", "1", "largest error of psi and eta, or of what chart_of names", &ChartRow::error},
           {"error_time", "1", "the part of it from steps in time", &ChartRow::error_time},
           {"error_space", "1", "the part of it from the grid", &ChartRow::error_space},
           // readers of the file take "seconds" for dates
           {"seconds", "seconds of processor time", "processor time, median of the repetitions",
            [](Row r) { return r.repeats > 0 ? Json(r.seconds) : Json(); }, In::both, "cost"},
           {"repeats", "1", "repetitions", &ChartRow::repeats},
           {"steps", "1", "steps", [](Row r) { return r.report.steps; }},
           {"rejections", "1", "steps taken back for their error", [](Row r) { return r.report.rejections; },
            In::summary},
           {"rhs_evaluations", "1", "right-hand sides, or parts of them",
            [](Row r) { return r.report.rhs_evaluations; }},
           {"failed", "1", "why there is no error", &ChartRow::failed},
           {"warnings", "", "lines of warning of this row", &ChartRow::warnings, In::summary},
           {"best", "1", "1 where no other row is as good in as little time", &ChartRow::best, In::file}}};
}

struct ChartResults {
  std::vector<ChartRow> rows;
  std::optional<double> reference_error;
  std::string reference;
  std::string of;  // what errors are of
};

Columns<ChartResults> keys() {
  using C = const ChartResults&;
  return {
      {"rows", "", "one for each method, tolerance (or fixed step), order in space and number of nodes",
       [](C c) { return list_of(chart_table(), c.rows); }},
      {"best", "", "the rows that no other beats in both error and seconds",
       [](C c) {
         Json best = Json::array();
         for (const std::size_t i : chart_front(c.rows))
           best.push_back(json_of(chart_table().columns, c.rows[i]));
         return best;
       }},
      {"of", "", "what errors are of (chart_of)", &ChartResults::of},
      {"reference_error", "1", "its own error", &ChartResults::reference_error},
      {"reference", "", "what errors are measured against", &ChartResults::reference},
      {"clock", "", "what `seconds` counts", [](C) { return "processor time, the largest over the ranks"; }}};
}

void write_file(const std::string& path, const Provenance& provenance, const ChartResults& results) {
  ResultFile file(PETSC_COMM_WORLD, path, provenance);
  file.attribute("of", results.of);
  file.attribute("reference", results.reference);
  file.attribute("reference_error", results.reference_error.value_or(NAN));
  add_rows(file, chart_table(), results.rows);
  file.write();
}

// Which rows have an error of at most 1e-3, 1e-6, 1e-9 in the least time, of all methods and of the IMEX
// ones.
void describe(Summary& summary, const std::vector<ChartRow>& rows, const std::string& of) {
  const auto words = [](const ChartRow& r) {
    return fmt::format("{}{}, order {}, n = {}, in {:.2g} s", r.method,
                       r.setting.method.can().splits ? " (" + r.implicit + " implicit)" : "", r.setting.order,
                       r.setting.n, r.seconds);
  };
  const auto quickest = [&](double wanted, bool imex) {
    const ChartRow* best = nullptr;
    for (const ChartRow& r : rows)
      if (r.error && *r.error <= wanted && (!imex || r.setting.method.can().splits) &&
          (!best || r.seconds < best->seconds))
        best = &r;
    return best;
  };
  for (const double wanted : {1e-3, 1e-6, 1e-9}) {
    const ChartRow *best = quickest(wanted, false), *imex = quickest(wanted, true);
    if (best)
      summary.say((of == "fields" ? "error" : "error of " + of) + " below " + rounded_text(wanted) + ": " +
                  words(*best) +
                  (!imex          ? "; no IMEX method reaches it"
                   : imex == best ? ""
                                  : "; of the IMEX methods " + words(*imex)));
  }
  const auto known =
      std::count_if(rows.begin(), rows.end(), [](const ChartRow& r) { return r.error.has_value(); });
  summary.say(fmt::format("{} of {} rows have an error that is known", known, rows.size()));
}

// What the chart sets for each row is not the user's to set for all.
void refuse_what_rows_choose(const Options& options) {
  std::vector<std::string> names = {"ts_type", "ts_rtol", "ts_atol", "ts_dt", "ts_adapt_type"};
  for (const Method& m : methods())
    if (const std::string name = capabilities(m).subtype_option; !name.empty()) names.push_back(name);
  for (const std::string& name : names)
    if (options.is_set(name))
      throw UsageError("-" + name + " " + quoted(options.text(name)) +
                       ": a chart chooses it row by row; see "
                       "chart_methods, chart_tolerances, chart_steps");
}

}  // namespace

std::vector<TableText> chart_tables() { return {keys(), chart_table()}; }

std::vector<MethodSpec> chart_methods(const Options& options, std::vector<std::string> names) {
  if (options.is_set("chart_methods")) names = options.words("chart_methods");
  std::vector<MethodSpec> list;
  for (const std::string& name : names) list.push_back(MethodSpec::parse("chart_methods", name));
  return list;
}

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

namespace {

std::vector<int> chart_orders(const Options& options, const Scene& scene) {
  const bool chain = scene.form == Form::chain;
  std::vector<int> orders;
  const std::vector<int> possible = possible_orders(scene);
  for (const PetscInt order : options.integers("chart_orders")) {
    if (std::find(possible.begin(), possible.end(), int(order)) == possible.end())
      throw UsageError("chart_orders " + options.text("chart_orders") + ": " + std::to_string(order) +
                       (chain            ? ": the chain's second difference is the model itself, of order 2"
                        : order % 2 != 0 ? " is no order; there are 2, 4, 6 and 8"
                                         : ": order 8 with a held end is unstable; there are 2, 4 and 6"));
    orders.push_back(int(order));
  }
  if (orders.empty() && (options.is_set("grid_order") || chain)) return {scene.order};
  if (orders.empty()) return {2, 4, possible.back()};
  return orders;
}

// Orders and grids of a scene that exists on one grid only: one of each.
void check_one_grid(const Options& options, const Scene& scene, const std::vector<PetscInt>& grids,
                    std::vector<int>& orders) {
  const std::string start = "the start (init_noise_length 0, init_type file) exists on one grid only";
  if (grids.size() > 1)
    throw UsageError("chart_grids " + options.text("chart_grids") + ": " +
                     (scene.form == Form::chain ? "the chain's blocks are the model itself" : start) +
                     "; give one");
  if (orders.size() < 2) return;
  if (options.is_set("chart_orders"))
    throw UsageError("chart_orders " + options.text("chart_orders") + ": " + start + "; give one order");
  orders = {scene.order};
}

}  // namespace

std::vector<Setting> chart_settings(const Options& options) {
  const Scene scene = Scene::from(options, false);
  std::vector<std::string> usual{"rk:3bs", "rk:5dp", "rk:7vr", "rk:8vr"};
  if (scene.massless())
    usual.insert(usual.end(), {"arkimex:3:both", "arkimex:4:both"});  // nothing to split
  else
    usual.insert(usual.end(), {"arkimex:3:friction", "arkimex:4:friction"});
  if (!scene.massless() && !scene.friction.sticks()) usual.emplace_back("arkimex:4:wave");
  usual.emplace_back("rosw:ra34pw2");
  const std::vector<MethodSpec> list = chart_methods(options, usual);
  std::vector<double> tolerances = options.reals("chart_tolerances"), steps = options.reals("chart_steps");
  if (tolerances.empty()) tolerances = {1e-3, 1e-5, 1e-7, 1e-9};
  std::vector<int> orders = chart_orders(options, scene);
  std::vector<PetscInt> grids = options.integers("chart_grids");
  const bool one_grid = !has_grid_limit(options, scene);
  if (one_grid) check_one_grid(options, scene, grids, orders);
  if (grids.empty()) {
    if (const PetscInt half = halved(scene, scene.n, orders.back()); half > 0 && !one_grid)
      grids.push_back(half);
    grids.push_back(scene.n);
  }

  std::vector<double> smoothings = options.reals("chart_smoothing");
  if (!smoothings.empty() && !scene.friction.sticks())
    throw UsageError("chart_smoothing " + options.text("chart_smoothing") +
                     ": what it is compared with is exact stick (friction_stick exact), which this scene "
                     "does not have");
  smoothings.insert(smoothings.begin(), 0);
  const double rate = scales_of(scene).rate;
  std::vector<Setting> settings;
  for (const double eps : smoothings)
    for (const MethodSpec& method : list)
      for (const int order : orders)
        for (const PetscInt n : grids) {
          const auto add = [&](double tolerance, double step) {
            const Setting s{method, tolerance, step, order, n, eps};
            (void)Scene::from(options_for(options, s), false);
            settings.push_back(s);
          };
          if (!method.can().has_estimate && !steps.empty()) {
            for (const double step : steps) add(0, step);
            continue;
          }
          for (const double tolerance : tolerances)
            add(tolerance, method.can().has_estimate ? 0 : std::pow(tolerance, 1. / method.order()) / rate);
        }
  return settings;
}

int chart_errors(const Options& options) {
  refuse_what_rows_choose(options);
  const Scene scene = Scene::from(options, false);
  if (options.real("ts_max_time") == 0) throw UsageError("ts_max_time 0: a chart needs a run of some length");
  const std::string out_file = options.text("out_file");
  const OutputLock lock = check_outputs(out_file, options.text("summary"));

  const Provenance provenance = Provenance::of("chart", options.all());
  Summary summary(provenance, keys_of(keys()), options.text("summary"));
  return with_summary(summary, [&] {
    const Pulse pulse("off", "chart");  // ends at a signal; each row shows itself
    warn_of_pieces(scene);
    check_settings(options, chart_settings(options));
    check_unused_after_setup(options);
    ChartResults results;
    set_keys(summary, keys(), results);
    WorkPrecision chart(options);
    const auto report = [&] {
      results = {chart.rows(), chart.reference_error(), chart.reference_text(), options.text("chart_of")};
      for (const std::size_t i : chart_front(results.rows)) results.rows[i].best = true;
      set_keys(summary, keys(), results);
    };
    keeping_what_is_found(
        [&] {
          try {
            chart.find_references();
            chart.run_rows();
          } catch (...) {
            report();
            throw;
          }
        },
        [&] { describe(summary, results.rows, options.text("chart_of")); });
    report();
    if (chart_front(results.rows).empty())
      warn(
          "no row has an error that could be told: see `failed` of the rows (more chart_reference_seconds, a "
          "shorter "
          "ts_max_time or finer grids help)");
    write_file(out_file, provenance, results);
    describe(summary, results.rows, options.text("chart_of"));
    return 0;
  });
}

// The command `chart -chart_kind limits`: rows of limits() over grids, orders and values of a parameter.

namespace {

std::vector<MethodSpec> wanted_methods(const Options& options) {
  if (options.text("chart_methods") != "all")
    return chart_methods(options, {"rk:5dp",
                                   "rk:3bs",
                                   "rk:4",
                                   "rk:8vr",
                                   "euler",
                                   "ssp:rks3",
                                   "arkimex:3:friction",
                                   "arkimex:3:wave",
                                   "arkimex:3:both",
                                   "arkimex:4:friction",
                                   "arkimex:4:wave",
                                   "arkimex:4:both",
                                   "arkimex:1bee:both",
                                   "leapfrog",
                                   "rosw:ra34pw2",
                                   "rosw:4l",
                                   "bdf:2",
                                   "bdf:4",
                                   "theta",
                                   "cn",
                                   "beuler",
                                   "alpha"});
  std::vector<MethodSpec> all;
  for (const Method& m : methods()) {
    const std::vector<std::string> splits = capabilities(m).parts;
    if (splits.empty()) all.push_back(MethodSpec::parse("chart_methods", m.name()));
    for (const std::string& split : splits)
      all.push_back(MethodSpec::parse("chart_methods", m.name() + (*m.subtype ? ":" : "::") + split));
  }
  return all;
}

// `parameter`: "" where nothing varies.
Table<LimitRow> limit_table(const std::string& parameter) {
  const bool varied = !parameter.empty();
  return {
      "rows",
      "",
      "row",
      {{"method", "1", "method", &LimitRow::method},
       {"implicit", "1", "what is implicit", &LimitRow::implicit},
       {"order", "1", "order in space", &LimitRow::order},
       {"n", "1", "nodes", &LimitRow::n},
       {"value", "1", varied ? parameter : "nothing varies",
        [=](const LimitRow& r) { return varied ? Json(r.value) : Json(); }},
       {"theory", "time", "stability limit of the linearised operator", &LimitRow::theory},
       {"limit", "time", "longest step of a run that ends within bounds", &LimitRow::limit},
       {"how", "1", "what happens beyond limit", &LimitRow::how},
       {"followed", "time", "longest step with the true regime, amplitude and speed", &LimitRow::followed},
       {"wrong", "1", "what is wrong beyond followed", &LimitRow::wrong},
       {"shortest_theory", "time", "step from which the shortest wave should grow falsely",
        &LimitRow::shortest_theory},
       {"shortest", "time", "step from which it does", &LimitRow::shortest},
       {"damps_theory", "time", "step from which sliding's perturbations should decay",
        &LimitRow::damps_theory},
       {"damps", "time", "step from which they do", &LimitRow::damps},
       {"longest", "time", "longest step tried", &LimitRow::longest},
       {"warned", "1", "1 if every failure gave a warning", &LimitRow::warned},
       {"runs", "1", "runs that it took", &LimitRow::runs, In::summary},
       {"silent", "time", "steps of failures without a warning", &LimitRow::silent, In::summary}}};
}

struct LimitResults {
  std::vector<LimitRow> rows;
  std::string parameter;
};

Columns<LimitResults> limit_keys() {
  using L = const LimitResults&;
  return {{"rows", "", "one for each method, value, order in space and number of nodes",
           [](L l) { return list_of(limit_table(l.parameter), l.rows); }},
          {"best", "", "of the other kind of chart", {}},
          {"reference_error", "1", "likewise", {}},
          {"silent", "1", "rows with failures without a warning", [](L l) {
             return std::count_if(l.rows.begin(), l.rows.end(), [](const LimitRow& r) { return !r.warned; });
           }}};
}

void write_limits(const Options& options, const Provenance& provenance, const LimitResults& results) {
  ResultFile file(PETSC_COMM_WORLD, options.text("out_file"), provenance);
  file.attribute("chart_kind", "limits");
  file.attribute("parameter", results.parameter);
  add_rows(file, limit_table(results.parameter), results.rows);
  file.write();
}

// A scene of the chart, and the value in it of what varies.
struct Varied {
  Options options;
  double value;
};

// Values, orders, grids. Throws UsageError.
std::vector<Varied> varied_scenes(const Options& options, const OptionSpec* parameter) {
  std::vector<double> values = options.reals("chart_values");
  if (values.empty()) values = {0};
  std::vector<PetscInt> orders = options.integers("chart_orders"), grids = options.integers("chart_grids");
  if (orders.empty()) orders = {options.integer("grid_order")};
  if (grids.empty()) grids = {options.integer("grid_n")};
  std::vector<Varied> scenes;
  for (const double value : values)
    for (const PetscInt order : orders)
      for (const PetscInt n : grids) {
        const Options o = options_for(parameter ? options.with(parameter->name, value) : options,
                                      {MethodSpec(), 0, 0, int(order), n});
        if (Scene::from(o, false).massless())
          throw UsageError(
              "-chart_kind limits: its splits and waves are those of a chain with mass; take a small model_m "
              "in "
              "place of 0, or -chart_kind error");
        scenes.push_back({o, value});
      }
  return scenes;
}

// chart_parameter, nullptr where it is not set. Throws UsageError.
const OptionSpec* parameter_of(const Options& options) {
  const std::string parameter = options.text("chart_parameter");
  if (parameter.empty() != options.reals("chart_values").empty())
    throw UsageError(parameter.empty()
                         ? "-chart_values " + options.text("chart_values") + ": without chart_parameter"
                         : "-chart_parameter " + parameter + ": needs chart_values, e.g. 3,30,300");
  const OptionSpec* spec = parameter.empty() ? nullptr : find_option(parameter);
  if (!parameter.empty() && (!spec || (spec->type != OptionType::real && spec->type != OptionType::integer)))
    throw UsageError("-chart_parameter " + quoted(parameter) +
                     ": no such option that takes a number; give one, such as model_gamma");
  return spec;
}

}  // namespace

std::vector<TableText> limit_tables() { return {limit_keys(), limit_table("the option that varies")}; }

int chart_limits(const Options& options) {
  const Provenance provenance = Provenance::of("chart", options.all());
  const OutputLock lock = check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(provenance, keys_of(limit_keys()), options.text("summary"));
  const std::vector<MethodSpec> choices = wanted_methods(options);
  const OptionSpec* spec = parameter_of(options);
  const std::vector<Varied> scenes = varied_scenes(options, spec);
  check_unused_after_setup(options);
  return with_summary(summary, [&] {
    const Pulse pulse(options.text("progress"), "limits");
    LimitResults results{{}, spec ? spec->name : ""};
    set_keys(summary, limit_keys(), results);
    std::vector<LimitRow>& rows = results.rows;
    const Progress clock("off", "");
    const std::size_t all = scenes.size() * choices.size();
    for (const Varied& scene : scenes) {
      Limits limits(scene.options);
      for (const MethodSpec& choice : choices) {
        Pulse::stage(fmt::format("row {} of {}{} ({}{})", rows.size() + 1, all,
                                 clock.left(double(rows.size()) / double(all)), choice.name(),
                                 choice.can().splits ? ":" + choice.implicit : ""));
        keeping_what_is_found([&] { rows.push_back(limits.row(choice)); },
                              [&] { summary.say(fmt::format("{} of {} rows", rows.size(), all)); });
        rows.back().value = scene.value;
        set_keys(summary, limit_keys(), results);
      }
    }
    for (const LimitRow& r : rows)
      if (!r.warned)
        warn(r.method + " (" + r.implicit + " implicit) went wrong at ts_dt " +
             number_text(r.silent.front()) + " (" + r.wrong + ") without a word");
    write_limits(options, provenance, results);
    summary.say(fmt::format("{} rows; {} went wrong beyond their limit without a warning", rows.size(),
                            summary.get<Json>("silent").dump()));
    return 0;
  });
}

}  // namespace stickslip
