// The command `cycle`: a periodic oscillation, its multipliers, waves on it, a branch; to the summary, a
// file, and the terminal.
#include <cmath>
#include <map>

#include "base/pulse.hpp"
#include "commands/continuation.hpp"
#include "commands/cycle_problem.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/commands/commands.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/summary.hpp"
#include "stickslip/study/run_layout.hpp"

namespace stickslip {

namespace {

Json listed(const std::vector<std::complex<double>>& values) {
  Json list = Json::array();
  for (const auto& z : values) list.push_back(Json::object({{"re", z.real()}, {"im", z.imag()}}));
  return list;
}

std::string shown(std::complex<double> z) {
  if (z.imag() == 0) return rounded_text(z.real(), 6);
  return rounded_text(z.real(), 6) + " ± " + rounded_text(std::abs(z.imag()), 6) + "i";
}

void add_multipliers(ResultFile& file, const Field& re, const Field& im,
                     const std::vector<std::string>& dimensions,
                     const std::vector<std::complex<double>>& values) {
  std::vector<double> real, imaginary;
  for (const auto& z : values) {
    real.push_back(z.real());
    imaginary.push_back(z.imag());
  }
  file.add(re, dimensions, real);
  file.add(im, dimensions, imaginary);
}

// The motion over one period, and what the picture needs of the scene.
void add_cycle(ResultFile& file, const Scene& scene, const FoundCycle& found) {
  const Cycle& cycle = found.cycle;
  file.scale({"t", "time", "time from the beginning of the cycle"}, cycle.times);
  file.scale({"x", scene.form == Form::chain ? "block" : "length", "position of the node"}, found.x);
  const StateLaw law = scene.friction.state;
  std::vector<std::vector<double>> fields(cycle.dof);
  for (std::size_t k = 0; k < cycle.times.size(); ++k)
    for (PetscInt node = 0; node < cycle.nodes; ++node)
      for (int a = 0; a < cycle.dof; ++a) {
        const double value = cycle.at(k, node)[a];
        fields[a].push_back(a < 2 ? value : state_to_output(law, value));
      }
  file.add(standard_field("psi"), {"t", "x"}, fields[0]);
  file.add(standard_field("eta"), {"t", "x"}, fields[1]);
  if (cycle.dof == 3) file.add(standard_field(state_name(law)), {"t", "x"}, fields[2]);
  add_multipliers(file, {"multiplier_re", "1", "Floquet multiplier, real part"},
                  {"multiplier_im", "1", "Floquet multiplier, imaginary part"}, {"multiplier"},
                  cycle.multipliers);
  if (!cycle.rests.empty()) {
    std::vector<double> node, begin, end;
    for (const Rest& rest : cycle.rests) {
      node.push_back(found.x[rest.node]);
      begin.push_back(rest.begin);
      end.push_back(rest.end);
    }
    file.add({"rest_x", scene.form == Form::chain ? "block" : "length", "node that rests"}, {"rest"}, node);
    file.add({"rest_begin", "time", "from when on"}, {"rest"}, begin);
    file.add({"rest_end", "time", "until when"}, {"rest"}, end);
  }
  const RunLayout layout = run_layout(scene);
  for (const auto& [name, value] : layout.numbers) file.attribute(name, value);
  file.scale({"friction/psi", "length/time", "sliding velocity"}, layout.friction_psi);
  file.add({"friction/F", "1", "friction force over its amplitude"}, {"friction/psi"}, layout.friction_F);
  file.attribute("period", cycle.period);
}

void set_cycle(Summary& summary, const FoundCycle& found) {
  const Cycle& cycle = found.cycle;
  const std::vector<std::pair<const char*, double>> numbers = {
      {"period", cycle.period},
      {"amplitude", cycle.amplitude},
      {"psi_max", cycle.psi_max},
      {"psi_min", cycle.psi_min},
      {"rest_fraction", cycle.rest_fraction},
      {"force_drop", cycle.force_drop},
      {"residual", cycle.residual},
      {"error_estimate", cycle.error_estimate},
      {"growth_rate", growth_rate(cycle)},
      {"wavenumber", 0},
      {"multiplier_error", std::abs(cycle.multipliers[cycle.phase_mode] - 1.)}};
  for (const auto& [key, value] : numbers) summary.set(key, value);
  summary.set("multipliers", listed(cycle.multipliers));
  summary.set("unknowns", cycle.nodes * cycle.dof);
  summary.set("mesh_intervals", found.mesh_intervals);
  // deviations that are alike in every cell; whether all decay is known where there are no others, or one
  // grows
  const bool alike = growth_rate(cycle) < 0;
  summary.set("stable_alike", alike);
  if (found.alone || !alike) summary.set("stable", alike);
}

void describe(Summary& summary, const FoundCycle& found) {
  const Cycle& cycle = found.cycle;
  const std::string cell = cycle.nodes == 1 ? "one node" : std::to_string(cycle.nodes) + " nodes";
  summary.say("cycle of " + cell + ": period T = " + rounded_text(cycle.period, 12) + ", error below " +
              rounded_text(cycle.error_estimate, 2) + " of it; psi from " + rounded_text(cycle.psi_min, 10) +
              " to " + rounded_text(cycle.psi_max, 10) + ", force drop " + rounded_text(cycle.force_drop, 8) +
              (cycle.rest_fraction > 0
                   ? ", at rest for " + rounded_text(100 * cycle.rest_fraction, 4) + " % of the time"
                   : ""));
  if (cycle.multipliers.size() < 2) {
    summary.say("deviations: none but along the motion itself; every other is wiped out by a rest");
    return;
  }
  const std::complex<double> largest = cycle.multipliers[cycle.phase_mode == 0 ? 1 : 0];
  summary.say(std::string("deviations") + (found.alone ? ": " : " alike in every cell: ") +
              (growth_rate(cycle) < 0 ? "stable" : "not stable") + ", largest multiplier " + shown(largest) +
              (found.alone ? "" : " (-cycle_spectrum asks about waves)"));
}

void add_spectrum(Summary& summary, ResultFile& file, const BlochSpectrum& spectrum) {
  summary.set("stable", spectrum.decided ? Json(spectrum.stable) : Json());
  summary.set("decided", spectrum.decided);
  summary.set("growth_rate", spectrum.growth_rate);
  summary.set("wavenumber", spectrum.wavenumber);
  if (!spectrum.coupled) return;
  summary.set("diffusion", spectrum.diffusion);
  std::vector<double> wavenumber, growth;
  std::vector<std::complex<double>> multipliers;
  for (const BlochPoint& point : spectrum.points) {
    wavenumber.push_back(point.wavenumber);
    growth.push_back(point.growth_rate);
    multipliers.insert(multipliers.end(), point.multipliers.begin(), point.multipliers.end());
  }
  file.scale({"spectrum/wavenumber", "1/length", "wavenumber"}, wavenumber);
  file.add({"spectrum/growth_rate", "1/time", "largest growth rate"}, {"spectrum/wavenumber"}, growth);
  add_multipliers(file, {"spectrum/multiplier_re", "1", "Floquet-Bloch multiplier, real part"},
                  {"spectrum/multiplier_im", "1", "Floquet-Bloch multiplier, imaginary part"},
                  {"spectrum/wavenumber", "spectrum/mode"}, multipliers);
  file.attribute("growth_rate", spectrum.growth_rate);
  file.attribute("growth_wavenumber", spectrum.wavenumber);
}

void describe(Summary& summary, const BlochSpectrum& spectrum) {
  if (!spectrum.coupled)
    return summary.say("waves: none, neighbours are not coupled; every cell keeps the phase that it has");
  const std::string most = "largest growth rate " + rounded_text(spectrum.growth_rate, 8) +
                           " at wavenumber " + rounded_text(spectrum.wavenumber, 8) + " (wavelength " +
                           rounded_text(2 * M_PI / spectrum.wavenumber, 6) + ")";
  const std::string phase = "phase diffusion " + rounded_text(spectrum.diffusion, 8);
  if (!spectrum.decided)
    return summary.say("waves: undecided, a growth rate is nearer to 0 than its error; " + phase);
  summary.say(spectrum.stable ? "waves: stable to every wavelength, " + phase
                              : "waves: not stable, " + (spectrum.wavenumber > 0 ? most + "; " : "") + phase);
}

void add_special(Summary& summary, ResultFile& file, const CycleBranch& branch) {
  Json list = Json::array();
  std::vector<double> value, period, wavenumber;
  std::vector<std::string> kind;
  for (const SpecialPoint& point : branch.special) {
    list.push_back(Json::object({{"kind", point.kind},
                                 {"value", point.value},
                                 {"period", point.period},
                                 {"wavenumber", point.kind == "wave" ? Json(point.wavenumber) : Json()},
                                 {"after", point.after}}));
    kind.push_back(point.kind);
    value.push_back(point.value);
    period.push_back(point.period);
  }
  summary.set("special", list);
  if (kind.empty()) return;
  file.add_text({"special/kind", "1", "what happens to the cycle there"}, {"special/number"}, kind);
  file.add({"special/value", "1", "of the option"}, {"special/number"}, value);
  file.add({"special/period", "time", "period there"}, {"special/number"}, period);
}

void add_branch(Summary& summary, ResultFile& file, const std::string& name, const CycleBranch& branch) {
  using Getter = double (*)(const CyclePoint&);
  static const std::vector<std::pair<Field, Getter>> columns = {
      {{"value", "1", "of the option"}, [](const CyclePoint& p) { return p.value; }},
      {{"period", "time", "period"}, [](const CyclePoint& p) { return p.cycle.period; }},
      {{"amplitude", "length/time", "half the largest range of psi"},
       [](const CyclePoint& p) { return p.cycle.amplitude; }},
      {{"psi_min", "length/time", "least psi"}, [](const CyclePoint& p) { return p.cycle.psi_min; }},
      {{"psi_max", "length/time", "largest psi"}, [](const CyclePoint& p) { return p.cycle.psi_max; }},
      {{"rest_fraction", "1", "part of the time at rest"},
       [](const CyclePoint& p) { return p.cycle.rest_fraction; }},
      {{"force_drop", "1", "range of the mean eta"}, [](const CyclePoint& p) { return p.cycle.force_drop; }},
      {{"growth_rate", "1/time", "largest growth rate"}, [](const CyclePoint& p) { return p.growth_rate; }},
      {{"wavenumber", "1/length", "which grows so"}, [](const CyclePoint& p) { return p.wavenumber; }},
      {{"error_estimate", "1", "of the period, relative"},
       [](const CyclePoint& p) { return p.cycle.error_estimate; }},
      {{"stable", "1", "1 where nothing that was looked at grows"},
       [](const CyclePoint& p) { return double(p.stable); }}};
  Json points = Json::array();
  for (const CyclePoint& point : branch.points) {
    Json row = Json::object();
    for (const auto& [field, get] : columns)
      row[field.name] = field.name == "stable" ? Json(point.stable) : Json(get(point));
    points.push_back(row);
  }
  summary.set("branch", Json::object({{"parameter", name}, {"points", points}, {"end", branch.end}}));
  for (const auto& [field, get] : columns) {
    std::vector<double> values;
    for (const CyclePoint& point : branch.points) values.push_back(get(point));
    file.add({"branch/" + field.name, field.units, field.name == "value" ? name : field.long_name},
             {"branch/point"}, values);
  }
  file.attribute("branch_parameter", name);
  file.attribute("branch_end", branch.end);
  add_special(summary, file, branch);
  summary.say("branch in " + name + ": " + std::to_string(branch.points.size()) + " points; " + branch.end);
  for (const SpecialPoint& point : branch.special)
    summary.say("  " + point.kind + " at " + name + " = " + rounded_text(point.value, 10) +
                (point.kind == "wave" ? ", wavenumber " + rounded_text(point.wavenumber, 6) : "") +
                (std::isfinite(point.period) ? ", period " + rounded_text(point.period, 8) : ""));
}

}  // namespace

int cycle_command(const Options& options) {
  const Provenance provenance = Provenance::of("cycle", options.all());
  const OutputLock lock = check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(provenance,
                  {"period",         "amplitude",   "psi_max",        "psi_min",          "rest_fraction",
                   "force_drop",     "multipliers", "stable",         "stable_alike",     "growth_rate",
                   "wavenumber",     "diffusion",   "decided",        "multiplier_error", "residual",
                   "error_estimate", "unknowns",    "mesh_intervals", "branch",           "special"},
                  options.text("summary"));
  check_continuation(options, "cycle");
  const Scene cell = cell_of_options(options);
  check_cycle_options(options, cell);
  return with_summary(summary, [&] {
    const Pulse pulse(options.text("progress"), "cycle");
    const FoundCycle found = find_cycle(options, cell);
    check_unused_after_setup(options, "");
    ResultFile file(PETSC_COMM_WORLD, options.text("out_file"), provenance);
    set_cycle(summary, found);
    add_cycle(file, cell, found);
    describe(summary, found);
    const bool with_waves = options.boolean("cycle_spectrum") && found.waves;
    if (with_waves) {
      const BlochSpectrum spectrum = found.waves(int(options.integer("cycle_wavenumbers")));
      add_spectrum(summary, file, spectrum);
      describe(summary, spectrum);
    }
    if (options.is_set("cycle_continue")) {
      const std::string name = options.text("cycle_continue");
      add_branch(
          summary, file, name,
          found.branch(name, options.real("cycle_to"), int(options.integer("cycle_steps")), with_waves));
    }
    file.write();
    warn_unused_at_end(options);
    return 0;
  });
}

}  // namespace stickslip
