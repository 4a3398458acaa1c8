// The command `fit`: the options with which a run reproduces a measured course; to the summary, a file, and
// the terminal.
#include <fmt/format.h>

#include <cmath>

#include "commands/command.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/options/library_options.hpp"
#include "study/fit.hpp"

namespace stickslip {

namespace {

Table<FitParameter> parameter_table() {
  return {"parameters",
          "parameters/",
          "parameters/number",
          {{"name", "1", "option", &FitParameter::name},
           {"value", "1", "of the best fit", &FitParameter::value},
           {"error", "1", "its standard error; null where the data do not tell", &FitParameter::error}}};
}

Columns<Fit> keys() {
  return {
      {"parameters", "", "of each option that was sought, in their order: `name`, `value`, `error`",
       [](const Fit& fit) { return list_of(parameter_table(), fit.parameters); }},
      {"trend", "",
       "with `fit_trend`: the drift that was found, `value` for a unit of the first column, and its `error`",
       [](const Fit& fit) {
         return fit.drift ? Json::object({{"value", *fit.drift}, {"error", fit.drift_error}}) : Json();
       }},
      {"residual_correlation", "1", "of neighbouring rows of what is left", &Fit::residual_correlation},
      {"independent_rows", "1",
       "independent rows that tell as much: the errors are too small by the root of all rows over these",
       &Fit::independent_rows},
      {"correlation", "1", "of their errors: a row for each; null where an error is",
       [](const Fit& fit) { return Json(fit.correlation); }},
      {"residual", "", "root of the mean square of what is left, in the unit of the data", &Fit::residual},
      {"starts", "1", "of the search that ended at the best fit", [](const Fit& fit) { return fit.same; }},
      {"runs", "1", "that the search took", &Fit::runs},
      {"method", "", "of PETSc's TAO", &Fit::method}};
}

std::string unit_of(CourseOf of) {
  return of == CourseOf::force ? "1" : of == CourseOf::psi ? "velocity" : "length";
}

void add_fit(ResultFile& file, const Options& options, const FitProblem& problem, const Fit& fit) {
  std::vector<double> place, left;
  for (const auto& [at, value] : options.pairs("fit_data")) {
    place.push_back(at);
    left.push_back(value - fit.course[left.size()]);
  }
  const std::string unit = unit_of(problem.of), of = options.text("fit_of");
  file.scale({"t", "time", "time of each row of the data"}, problem.times);
  file.add({"place", options.text("fit_against") == "time" ? "time" : "length", "first column of the data"},
           {"t"}, place);
  file.add({"data", unit, of + ", measured"}, {"t"}, problem.data);
  file.add({"fit", unit, of + " of the best fit"}, {"t"}, fit.course);
  file.add({"left", unit, "data less fit"}, {"t"}, left);
  add_rows(file, parameter_table(), fit.parameters);
  file.attribute("residual", fit.residual);
}

void describe(Summary& summary, const Fit& fit, int starts, const std::string& unit) {
  std::string text;
  for (const FitParameter& p : fit.parameters)
    text += (text.empty() ? "" : ", ") + called(p.name) + " " +
            in_unit(with_error(p.value, p.error), find_option(p.name)->unit, p.name);
  if (fit.drift)
    text += ", drift " + with_error(*fit.drift, fit.drift_error) + " for a unit of the first column";
  summary.say(text);
  summary.say(
      fmt::format("what is left: {:.4g}{} (root mean square); {} of {} starts ended there, in {} runs",
                  fit.residual, unit == "1" ? "" : " of " + unit, fit.same, starts, fit.runs));
}

void warn_of(const Fit& fit, int starts) {
  if (fit.same == 1 && starts > 1)
    warn(
        fmt::format("only 1 of {} starts ended at the best fit: there may be a better one; raise fit_starts, "
                    "or begin nearer to "
                    "the data",
                    starts));
  if (fit.together.size() > 1)
    warn("these data do not tell " + joined(fit.together) +
         " apart: a change of one is made up for by the others; no errors are given. Fix one of them");
  if (fit.together.size() == 1)
    warn("the best fit does not depend on " + fit.together[0] + "; no errors are given");
  const double rows = double(fit.course.size()), enough = 3 / std::sqrt(rows),
               factor = std::sqrt(rows / fit.independent_rows);
  if (fit.residual_correlation > enough && factor > 1.1)
    warn(
        fmt::format("what is left of neighbouring rows is alike (correlation {:.2f}): {:.0f} rows tell as "
                    "much as {:.0f} independent ones, and the errors are too small by a factor of about "
                    "{:.2g}",
                    fit.residual_correlation, rows, fit.independent_rows, factor));
  for (const FitParameter& p : fit.parameters)
    if (p.at_bound)
      warn(p.name + " " + number_text(p.value) +
           ": the best fit lies at the end of the range that was searched, " + number_text(p.low) + " to " +
           number_text(p.high));
}

std::vector<TableText> tables() { return {keys(), parameter_table()}; }

int fit(const Options& options) {
  const FitProblem problem = fit_problem(options);
  CommandRun run("fit", options, keys_of(keys()));
  Summary& summary = run.summary;
  return run.search("", [&] {
    Fit fit;
    const auto tell = [&] { describe(summary, fit, problem.starts, unit_of(problem.of)); };
    keeping_what_is_found(
        [&] {
          fit = solve_fit(problem, [&](const Fit& best) {
            fit = best;
            set_keys(summary, keys(), fit);
          });
        },
        [&] {
          if (!fit.parameters.empty()) tell();
        });
    set_keys(summary, keys(), fit);
    tell();
    warn_of(fit, problem.starts);
    ResultFile file = run.file();
    add_fit(file, options, problem, fit);
    file.write();
  });
}

}  // namespace

Command fit_command() {
  return {"fit", "finds the options with which a run reproduces what was measured", fit, true, tables};
}

}  // namespace stickslip
