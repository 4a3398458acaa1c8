// The command `chart -chart_kind limits`: rows of limits.hpp over grids, orders and values of a parameter.
#include <algorithm>

#include "base/progress.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/summary.hpp"
#include "stickslip/study/chart.hpp"
#include "stickslip/study/limits.hpp"
#include "stickslip/time/methods.hpp"
#include "study/row_table.hpp"

namespace stickslip {

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
    if (splits_of(m).empty()) all.push_back(MethodSpec::parse("chart_methods", m.name()));
    for (const std::string& split : splits_of(m))
      all.push_back(MethodSpec::parse("chart_methods", m.name() + (*m.subtype ? ":" : "::") + split));
  }
  return all;
}

// `parameter`: "" where nothing varies.
std::vector<Column<LimitRow>> limit_columns(const std::string& parameter) {
  using Row = const LimitRow&;
  const auto step = [](const char* name, const char* what, std::optional<double> LimitRow::*member) {
    return Column<LimitRow>{name, {name, "time", what}, [=](Row r) { return Json(r.*member); }};
  };
  const auto text = [](const char* name, const char* what, std::string LimitRow::*member) {
    return Column<LimitRow>{name, {name, "1", what}, [=](Row r) { return r.*member; }, true};
  };
  const bool varied = !parameter.empty();
  return {
      text("method", "method", &LimitRow::method),
      text("implicit", "what is implicit", &LimitRow::implicit),
      {"order", {"order", "1", "order in space"}, [](Row r) { return r.order; }},
      {"n", {"n", "1", "nodes"}, [](Row r) { return r.n; }},
      {"value",
       {"value", "1", varied ? parameter : "nothing varies"},
       [=](Row r) { return varied ? Json(r.value) : Json(); }},
      step("theory", "stability limit of the linearised operator", &LimitRow::theory),
      step("limit", "longest step of a run that ends within bounds", &LimitRow::limit),
      text("how", "what happens beyond limit", &LimitRow::how),
      step("followed", "longest step with the true regime, amplitude and speed", &LimitRow::followed),
      text("wrong", "what is wrong beyond followed", &LimitRow::wrong),
      step("shortest_theory", "step from which the shortest wave should grow falsely",
           &LimitRow::shortest_theory),
      step("shortest", "step from which it does", &LimitRow::shortest),
      step("damps_theory", "step from which sliding's perturbations should decay", &LimitRow::damps_theory),
      step("damps", "step from which they do", &LimitRow::damps),
      {"longest", {"longest", "time", "longest step tried"}, [](Row r) { return r.longest; }},
      {"warned", {"warned", "1", "1 where every failure was told"}, [](Row r) { return r.warned; }},
      {"runs", {}, [](Row r) { return r.runs; }},
  };
}

void write_file(const Options& options, const Provenance& provenance, const std::vector<LimitRow>& rows,
                const std::string& parameter) {
  ResultFile file(PETSC_COMM_WORLD, options.text("out_file"), provenance);
  file.attribute("chart_kind", "limits");
  file.attribute("parameter", parameter);
  add_columns(file, limit_columns(parameter), rows);
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

int chart_limits(const Options& options) {
  const Provenance provenance = Provenance::of("chart", options.all());
  const OutputLock lock = check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(provenance, {"rows", "best", "reference_error", "silent"}, options.text("summary"));
  const std::vector<MethodSpec> choices = wanted_methods(options);
  const OptionSpec* spec = parameter_of(options);
  const std::string parameter = spec ? spec->name : "";
  const std::vector<Varied> scenes = varied_scenes(options, spec);
  check_unused_after_setup(options, "ts snes ksp pc");
  return with_summary(summary, [&] {
    std::vector<LimitRow> rows;
    Progress progress(options.text("progress"), "limits: ");
    const std::size_t all = scenes.size() * choices.size();
    Json list = Json::array();
    for (const Varied& scene : scenes) {
      Limits limits(scene.options);
      for (const MethodSpec& choice : choices) {
        if (progress.due())
          progress.show("row " + std::to_string(rows.size() + 1) + " of " + std::to_string(all) +
                        progress.left(double(rows.size()) / double(all)) + " (" + choice.name() +
                        (choice.splits() ? ":" + choice.implicit : "") + ")");
        rows.push_back(limits.row(choice));
        rows.back().value = scene.value;
        list.push_back(json_of(limit_columns(parameter), rows.back()));
        list.back()["silent"] = rows.back().silent;
        summary.set("rows", list);
      }
    }
    const auto silent = std::count_if(rows.begin(), rows.end(), [](const LimitRow& r) { return !r.warned; });
    summary.set("silent", long(silent));
    for (const LimitRow& r : rows)
      if (!r.warned)
        warn(r.method + " (" + r.implicit + " implicit) went wrong at ts_dt " +
             number_text(r.silent.front()) + " (" + r.wrong + ") without a word");
    write_file(options, provenance, rows, parameter);
    summary.say(std::to_string(rows.size()) + " rows; " + std::to_string(silent) +
                " went wrong beyond their limit without a warning");
    return 0;
  });
}

}  // namespace stickslip
