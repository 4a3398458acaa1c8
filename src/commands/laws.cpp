// The command `laws`: tabulates friction laws over a range of velocities (the paper's figure 2).
//
// All laws, each with the parameters the user gave it, or with friction_law or state_law set the one chosen.
// With a state law F is that of steady sliding at each velocity, the state being what it settles to there. At
// psi = 0 a law with a threshold may take any value of its stick range; the table holds F(0) = 0, and the
// range beside it.
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "stickslip/commands/commands.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

namespace {

constexpr double inf = std::numeric_limits<double>::infinity();

struct Table {
  Law law;
  std::vector<double> F;
  // forces at which a stuck contact holds; NaN where the law has no exact stick
  double stick_low, stick_high;
};

FrictionParameters parameters_of(const Options& options) { return Scene::from(options, false).friction; }

// `options` with the law set, and without the parameters that belong to others.
Options options_for(Law law, Options options) {
  options = options.with("friction_law", to_string(law));
  for (const std::string& name : friction_options_of_other_laws(law)) options = options.with(name, "");
  return options;
}

std::vector<FrictionParameters> wanted_laws(const Options& options) {
  if (options.is_set("friction_law") || options.is_set("state_law")) return {parameters_of(options)};
  std::vector<FrictionParameters> laws;
  for (const Law law : all_laws()) laws.push_back(parameters_of(options_for(law, options)));
  return laws;
}

Table tabulate(const FrictionParameters& p, const std::vector<double>& psi) {
  Table table{p.law, {}, NAN, NAN};
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

}  // namespace

int laws_command(const Options& options) {
  const std::vector<FrictionParameters> laws = wanted_laws(options);
  const double from = options.real("laws_from"), to = options.real("laws_to");
  if (!(from < to))
    throw UsageError("-laws_from " + number_text(from) + ": it must be below laws_to, " + number_text(to));
  const PetscInt points = options.integer("laws_points");
  check_unused_after_setup(options);
  const OutputLock lock = check_outputs(options.text("out_file"), options.text("summary"));

  const Provenance provenance = Provenance::of("laws", options.all());
  std::vector<std::string> keys = {"psi"};
  for (const Law law : all_laws()) keys.push_back(to_string(law));
  keys.push_back("stick");
  Summary summary(provenance, keys, options.text("summary"));
  return with_summary(summary, [&] {
    std::vector<double> psi(points);
    // weighted ends: a range symmetric about 0 stays so to the last digit, and holds 0 where points is odd
    for (PetscInt i = 0; i < points; ++i)
      psi[i] =
          from * (double(points - 1 - i) / double(points - 1)) + to * (double(i) / double(points - 1));

    ResultFile file(PETSC_COMM_WORLD, options.text("out_file"), provenance);
    file.scale({"psi", "velocity", "sliding velocity"}, psi);
    Json stick = Json::object();
    std::vector<std::string> names;
    std::vector<double> low, high;
    for (const FrictionParameters& p : laws) {
      const Table table = tabulate(p, psi);
      const std::string name = to_string(p.law);
      summary.set(name, table.F);
      if (!std::isnan(table.stick_high)) stick[name] = {table.stick_low, table.stick_high};
      file.add({name, "1", "friction law " + name + (p.has_state() ? ", steady state of the contact" : "")},
               {"psi"}, table.F);
      names.push_back(name);
      low.push_back(table.stick_low);
      high.push_back(table.stick_high);
    }
    summary.set("psi", psi);
    summary.set("stick", stick);
    file.add_text({"stick/name", "1", "law"}, {"law"}, names);
    file.add({"stick/low", "1", "smallest force at which a contact stays stuck"}, {"law"}, low);
    file.add({"stick/high", "1", "largest force at which a contact stays stuck"}, {"law"}, high);
    file.write();
    std::string listed;
    for (const std::string& name : names) listed += (listed.empty() ? "" : ", ") + name;
    summary.say("F(psi) of " + listed + " at " + std::to_string(points) + " velocities from " +
                number_text(from) + " to " + number_text(to));
    return 0;
  });
}

}  // namespace stickslip
