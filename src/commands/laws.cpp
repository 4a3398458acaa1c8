// The command `laws`: tabulates friction laws over a range of velocities (the paper's figure 2).
//
// All laws, each with the parameters the user gave it, or with friction_law or state_law set the one chosen.
// With a state law F is that of steady sliding at each velocity, the state being what it settles to there. At
// psi = 0 a law with a threshold may take any value of its stick range; the table holds F(0) = 0, and the
// range beside it.
#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "commands/command.hpp"
#include "model/scene_reading.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/library_options.hpp"

namespace stickslip {

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();

struct Tabulated {
  Law law;
  bool has_state;
  std::vector<double> F;
  // forces at which a stuck contact holds; NaN where the law has no exact stick
  double stick_low, stick_high;
};

// Of the law alone, whatever stands beside it in the scene.
FrictionParameters parameters_of(const Options& options) {
  FrictionParameters law = Scene::from(options, false).friction;
  law.terms = {};
  return law;
}

// `options` with the law set, and without the parameters that belong to others.
Options options_for(Law law, Options options) {
  options = options.with("friction_law", to_string(law));
  for (const std::string& name : friction_options_of_other_laws(law)) options = options.with(name, "");
  return options;
}

// A law made of points that nobody gave is none.
bool has_its_curve(Law law, const Options& options) {
  for (const Parameter& p : law->parameters)
    if (p.range == Parameter::Range::curve && has_meaning(p, options) &&
        !options.is_set("friction_" + std::string(p.name)))
      return false;
  return true;
}

std::vector<FrictionParameters> wanted_laws(const Options& options) {
  if (options.is_set("friction_law") || options.is_set("state_law")) return {parameters_of(options)};
  std::vector<FrictionParameters> laws;
  for (const Law law : all_laws())
    if (has_its_curve(law, options)) laws.push_back(parameters_of(options_for(law, options)));
  return laws;
}

Tabulated tabulate(const FrictionParameters& p, const std::vector<double>& psi) {
  Tabulated table{p.law, p.has_state(), {}, NAN, NAN};
  table.F.reserve(psi.size());
  const auto friction = Friction::of(p);
  for (const double velocity : psi)
    table.F.push_back(friction->force(velocity, friction->steady_state(velocity)));
  if (friction->sticks) {
    table.stick_high = friction->threshold_at_long_rest();
    table.stick_low = p.back_slip ? -table.stick_high : -inf;
  }
  return table;
}

struct LawResults {
  std::vector<double> psi;
  std::vector<Tabulated> laws;
};

Table<Tabulated> stick_table() {
  return {"",
          "stick/",
          "law",
          {{"name", "1", "law", [](const Tabulated& t) { return to_string(t.law); }},
           {"low", "1", "smallest force at which a contact stays stuck", &Tabulated::stick_low},
           {"high", "1", "largest force at which a contact stays stuck", &Tabulated::stick_high}}};
}

Json stick_of(const LawResults& results) {
  Json stick = Json::object();
  for (const Tabulated& t : results.laws)
    if (!std::isnan(t.stick_high)) stick[to_string(t.law)] = {t.stick_low, t.stick_high};
  return stick;
}

Columns<LawResults> keys() {
  Columns<LawResults> columns = {{"psi", "length/time", "velocities", &LawResults::psi}};
  for (const Law law : all_laws())
    columns.push_back({to_string(law), "1", "F of this law there", [law](const LawResults& results) {
                         for (const Tabulated& t : results.laws)
                           if (t.law == law) return Json(t.F);
                         return Json();
                       }});
  columns.push_back({"stick", "1", "the threshold of those that stick, backward and forward", stick_of});
  return columns;
}

std::vector<TableText> tables() { return {keys(), stick_table()}; }

int laws(const Options& options) {
  const std::vector<FrictionParameters> laws = wanted_laws(options);
  const double from = options.real("laws_from"), to = options.real("laws_to");
  if (!(from < to))
    throw UsageError("-laws_from " + number_text(from) + ": it must be below laws_to, " + number_text(to));
  const PetscInt points = options.integer("laws_points");
  check_unused_after_setup(options);
  CommandRun run("laws", options, keys_of(keys()));
  return run.carry_out([&] {
    LawResults results;
    // weighted ends: a range symmetric about 0 stays so to the last digit, and holds 0 where points is odd
    for (PetscInt i = 0; i < points; ++i)
      results.psi.push_back(from * (double(points - 1 - i) / double(points - 1)) +
                            to * (double(i) / double(points - 1)));
    std::vector<std::string> names;
    for (const FrictionParameters& p : laws) {
      results.laws.push_back(tabulate(p, results.psi));
      names.push_back(to_string(p.law));
    }
    set_keys(run.summary, keys(), results);
    ResultFile file = run.file();
    file.scale({"psi", "velocity", "sliding velocity"}, results.psi);
    for (const Tabulated& t : results.laws) {
      const std::string name = to_string(t.law);
      file.add({name, "1", "friction law " + name + (t.has_state ? ", steady state of the contact" : "")},
               {"psi"}, t.F);
    }
    add_rows(file, stick_table(), results.laws);
    file.write();
    run.summary.say(fmt::format("F(psi) of {} at {} velocities from {} to {}", joined(names), points,
                            number_text(from), number_text(to)));
  });
}

}  // namespace

Command laws_command() { return {"laws", "tabulates friction laws", laws, false, tables}; }

}  // namespace stickslip
