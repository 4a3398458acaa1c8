// The command `chart -chart_kind limits`: rows of limits.hpp over grids, orders and values of a parameter.
#include <fmt/format.h>

#include <algorithm>

#include "base/progress.hpp"
#include "base/found_until.hpp"
#include "output/table.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/study/chart.hpp"
#include "stickslip/study/limits.hpp"
#include "stickslip/time/methods.hpp"

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

Columns<LimitResults> keys() {
  using L = const LimitResults&;
  return {{"rows", "", "one for each method, value, order in space and number of nodes",
           [](L l) { return list_of(limit_table(l.parameter), l.rows); }},
          {"best", "", "of the other kind of chart", {}},
          {"reference_error", "1", "likewise", {}},
          {"silent", "1", "rows with failures without a warning", [](L l) {
             return std::count_if(l.rows.begin(), l.rows.end(), [](const LimitRow& r) { return !r.warned; });
           }}};
}

void write_file(const Options& options, const Provenance& provenance, const LimitResults& results) {
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

std::vector<TableText> limit_tables() { return {keys(), limit_table("the option that varies")}; }

int chart_limits(const Options& options) {
  const Provenance provenance = Provenance::of("chart", options.all());
  const OutputLock lock = check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(provenance, keys_of(keys()), options.text("summary"));
  const std::vector<MethodSpec> choices = wanted_methods(options);
  const OptionSpec* spec = parameter_of(options);
  const std::vector<Varied> scenes = varied_scenes(options, spec);
  check_unused_after_setup(options);
  return with_summary(summary, [&] {
    const Pulse pulse(options.text("progress"), "limits");
    LimitResults results{{}, spec ? spec->name : ""};
    set_keys(summary, keys(), results);
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
        set_keys(summary, keys(), results);
      }
    }
    for (const LimitRow& r : rows)
      if (!r.warned)
        warn(r.method + " (" + r.implicit + " implicit) went wrong at ts_dt " +
             number_text(r.silent.front()) + " (" + r.wrong + ") without a word");
    write_file(options, provenance, results);
    summary.say(fmt::format("{} rows; {} went wrong beyond their limit without a warning", rows.size(),
                            summary.get<Json>("silent").dump()));
    return 0;
  });
}

}  // namespace stickslip
