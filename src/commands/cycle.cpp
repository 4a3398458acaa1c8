// The command `cycle`: a periodic oscillation, its multipliers, waves on it, a branch; to the summary, a
// file, and the terminal.

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "commands/command.hpp"
#include "commands/problems.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/displacement.hpp"
#include "stickslip/study/size.hpp"
#include "stickslip/study/start.hpp"

namespace stickslip {

namespace {

// What is known, one after the other.
struct CycleResults {
  FoundCycle found;
  std::optional<BlochSpectrum> spectrum;
  std::optional<CycleBranch> branch;
  std::string parameter;  // of the branch
};

// How far a node goes to either side of its mean motion, psi being nearly straight between two times; of all
// nodes the most.
double displacement_of(const Cycle& cycle) {
  const std::size_t last = cycle.times.size() - 1;
  double most = 0;
  for (PetscInt i = 0; i < cycle.nodes; ++i) {
    const auto step = [&](std::size_t k) { return cycle.times[k + 1] - cycle.times[k]; };
    const auto between = [&](std::size_t k) { return (cycle.psi(k, i) + cycle.psi(k + 1, i)) / 2; };
    double mean = 0, at = 0, low = 0, high = 0;
    for (std::size_t k = 0; k < last; ++k) mean += step(k) * between(k);
    mean /= cycle.period;
    for (std::size_t k = 0; k < last; ++k) {
      at += step(k) * (between(k) - mean);
      low = std::min(low, at), high = std::max(high, at);
    }
    most = std::max(most, (high - low) / 2);
  }
  return most;
}

// Largest of all nodes, by slopes of parabolas through three times, of which none lies beyond a corner: where
// a rest begins or ends they are one-sided.
double acceleration_of(const Cycle& cycle) {
  const std::size_t last = cycle.times.size() - 1;
  double most = 0;
  for (PetscInt i = 0; i < cycle.nodes; ++i) {
    const auto step = [&](std::size_t k) { return cycle.times[k + 1] - cycle.times[k]; };
    const auto moves = [&](std::size_t k) {
      return step(k) > 0 && (cycle.psi(k, i) != 0 || cycle.psi(k + 1, i) != 0);
    };
    const auto secant = [&](std::size_t k) { return (cycle.psi(k + 1, i) - cycle.psi(k, i)) / step(k); };
    // at the beginning or the end of interval k, with the interval `other` beside it
    const auto slope = [&](std::size_t k, std::size_t other, bool shared) {
      const double part = step(k) / (step(k) + step(other));
      return secant(k) + (shared ? 1 : -1) * part * (secant(other) - secant(k));
    };
    for (std::size_t k = 0; k < last; ++k) {
      if (!moves(k)) continue;
      const bool before = k > 0 && moves(k - 1), behind = k + 1 < last && moves(k + 1);
      for (const double found :
           {before ? slope(k, k - 1, true) : behind ? slope(k, k + 1, false) : secant(k),
            behind ? slope(k, k + 1, true) : before ? slope(k, k - 1, false) : secant(k)})
        most = std::max(most, std::abs(found));
    }
  }
  return most;
}

Columns<Cycle> cycle_columns() {
  return {{"period", "time", "period", &Cycle::period},
          {"amplitude", "length/time", "half the largest range of psi", &Cycle::amplitude},
          {"psi_min", "length/time", "least psi", &Cycle::psi_min},
          {"psi_max", "length/time", "largest psi", &Cycle::psi_max},
          {"displacement", "length",
           "half the largest range of a node's displacement about its mean motion, to about a part in 1000",
           [](const Cycle& c) { return displacement_of(c); }},
          {"acceleration", "velocity/time", "largest acceleration of a node, to about a part in 1000",
           [](const Cycle& c) { return acceleration_of(c); }},
          {"rest_fraction", "1", "part of the time at rest", &Cycle::rest_fraction},
          {"force_drop", "1", "range of the mean eta", &Cycle::force_drop},
          {"error_estimate", "1", "of the period, relative", &Cycle::error_estimate}};
}

Table<CyclePoint> branch_table(const std::string& parameter) {
  return {"branch.points", "branch/", "branch/point",
          Columns<CyclePoint>{{"value", "1", parameter, &CyclePoint::value}} +
              of<CyclePoint>(&CyclePoint::cycle, cycle_columns()) +
              Columns<CyclePoint>{
                  {"growth_rate", "1/time", "largest growth rate", &CyclePoint::growth_rate},
                  {"wavenumber", "1/length", "which grows so", &CyclePoint::wavenumber},
                  {"stable", "1", "1 where nothing that was looked at grows", &CyclePoint::stable}}};
}

Table<SpecialPoint> special_table() {
  using Row = const SpecialPoint&;
  return {"special",
          "special/",
          "special/number",
          {{"kind", "1", "what happens to the cycle there", &SpecialPoint::kind},
           {"value", "1", "of the option", &SpecialPoint::value},
           {"period", "time", "period there", &SpecialPoint::period},
           {"wavenumber", "1/length", "of a wave that begins or ceases to grow",
            [](Row p) { return p.kind == "wave" ? Json(p.wavenumber) : Json(); }, In::summary},
           {"after", "1", "number of the point of the branch that it comes after", &SpecialPoint::after,
            In::summary}}};
}

struct RestAt {
  double x, begin, end;
};
Table<RestAt> rest_table(const std::string& unit_of_x) {
  return {"",
          "rest_",
          "rest",
          {{"x", unit_of_x, "node that rests", &RestAt::x},
           {"begin", "time", "from when on", &RestAt::begin},
           {"end", "time", "until when", &RestAt::end}}};
}

// Null where deviations are not linear.
Json is_stable_alike(const CycleResults& a) {
  const double growth = growth_rate(a.found.cycle);
  return std::isnan(growth) ? Json() : Json(growth < 0);
}

// Whether all deviations decay: known without a look at waves where there are none, or where one grows that
// is alike in every cell.
Json is_stable(const CycleResults& a) {
  if (a.spectrum) return a.spectrum->decided ? Json(a.spectrum->stable) : Json();
  const Json alike = is_stable_alike(a);
  return a.found.alone || alike == Json(false) ? alike : Json();
}

Json branch_of(const CycleResults& a) {
  if (!a.branch) return {};
  return {{"parameter", a.parameter},
          {"points", list_of(branch_table(a.parameter), a.branch->points)},
          {"end", a.branch->end}};
}

Columns<CycleResults> keys() {
  using A = const CycleResults&;
  return of<CycleResults>([](A a) -> const Cycle& { return a.found.cycle; }, cycle_columns()) +
         Columns<CycleResults>{
             {"multipliers", "1",
              "Floquet multipliers of the cell, largest first: `re`, `im`; the phase mode's, 1, among them, "
              "but "
              "not under a load",
              [](A a) {
                const Cycle& c = a.found.cycle;
                return c.not_linear.empty() ? Json(c.multipliers) : Json();
              }},
             {"multiplier_error", "1", "how far the phase mode's is from 1; null under a load",
              [](A a) {
                const Cycle& c = a.found.cycle;
                const bool none = c.forcing_periods > 0 || !c.not_linear.empty();
                return none ? Json() : Json(std::abs(c.multipliers[c.phase_mode] - 1.));
              }},
             {"forcing_periods", "1", "periods of the load in one of the cycle; null without a load",
              [](A a) {
                const int periods = a.found.cycle.forcing_periods;
                return periods > 0 ? Json(periods) : Json();
              }},
             {"stable_alike", "", "perturbations that are the same in every cell decay",
              is_stable_alike},
             {"stable", "",
              "all perturbations decay: with `-cycle_spectrum`, and for a whole scene; null where waves were "
              "not "
              "looked at and nothing grows without them, or where it is undecided",
              is_stable},
             {"decided", "", "false where a growth rate that matters is nearer to 0 than its error",
              [](A a) { return a.spectrum ? Json(a.spectrum->decided) : Json(); }},
             {"growth_rate", "1/time",
              "largest growth rate, ln of the multiplier over the period, the phase mode of wavenumber 0 "
              "left "
              "out, and waves that are longer than the longest listed and decay. Refined between the listed "
              "wavenumbers",
              [](A a) { return a.spectrum ? a.spectrum->growth_rate : growth_rate(a.found.cycle); }},
             {"wavenumber", "1/length", "which wave has it",
              [](A a) { return a.spectrum ? a.spectrum->wavenumber : 0; }},
             {"diffusion", "length^2/time",
              "with `-cycle_spectrum`: of the phase of long waves; negative where they grow",
              [](A a) { return a.spectrum && a.spectrum->coupled ? Json(a.spectrum->diffusion) : Json(); }},
             {"residual", "1", "of the equations, in units of psi and eta",
              [](A a) { return a.found.cycle.residual; }},
             {"unknowns", "1", "of the cell",
              [](A a) {
                const Cycle& c = a.found.cycle;
                return c.not_linear.empty() ? c.multipliers.size() : std::size_t(c.nodes * c.dof);
              }},
             {"mesh_intervals", "1", "of the collocation in time, 0 with exact stick",
              [](A a) { return a.found.mesh_intervals; }},
             {"branch", "",
              "with `-cycle_continue`: the `parameter`, the `points` and how it came to an `end`", branch_of},
             {"special", "",
              "points of the branch at which something changes ([Oscillations](oscillations.md#branches))",
              [](A a) { return a.branch ? list_of(special_table(), a.branch->special) : Json(); }}};
}

std::string shown(std::complex<double> z) {
  return z.imag() == 0 ? fmt::format("{:.6g}", z.real())
                       : fmt::format("{:.6g} ± {:.6g}i", z.real(), std::abs(z.imag()));
}

// chi at the times of the cycle, as far as its nodes are unknowns of it.
std::vector<double> chi_of(const Scene& scene, const Cycle& cycle) {
  const Model model(PETSC_COMM_SELF, scene);
  const Plate plate;
  const Displacement displacement(model, plate);
  const VecHandle u = model.create_vector(), chi = displacement.create_vector();
  std::vector<PetscInt> nodes;
  for (PetscInt i = 0; i < scene.n; ++i)
    if (cycle.nodes == scene.n || !scene.held(i)) nodes.push_back(i);
  std::vector<double> all;
  for (std::size_t k = 0; k < cycle.times.size(); ++k) {
    {
      const Writing a(u);
      for (std::size_t j = 0; j < nodes.size(); ++j)
        std::copy_n(cycle.at(k, PetscInt(j)), cycle.dof, a + nodes[j] * cycle.dof);
    }
    displacement.solve(u, cycle.times[k], chi);
    const Reading x(chi);
    for (const PetscInt i : nodes) all.push_back(x[i]);
  }
  return all;
}

// The motion over one period, and what the picture needs of the scene.
void add_cycle(ResultFile& file, const Scene& scene, const FoundCycle& found) {
  const Cycle& cycle = found.cycle;
  file.scale({"t", "time", "time from the beginning of the cycle"}, cycle.times);
  const std::string unit_of_x = scene.form == Form::chain ? "block" : "length";
  file.scale({"x", unit_of_x, "position of the node"}, found.x);
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
  file.add(standard_field("chi"), {"t", "x"}, chi_of(scene, cycle));
  if (cycle.not_linear.empty())
    file.add_complex({"multiplier", "1", "Floquet multiplier"}, {"multiplier"}, cycle.multipliers);
  std::vector<RestAt> rests;
  for (const Rest& rest : cycle.rests) rests.push_back({found.x[rest.node], rest.begin, rest.end});
  add_rows(file, rest_table(unit_of_x), rests);
  add_scene(file, scene);
  file.attribute("period", cycle.period);
}

// A force as eta has it, in parts of f0; behind it in the scene's unit.
std::string force_text(double eta, const Scene& scene, int digits) {
  const std::string own = rounded_text(eta, digits);
  if (scene.form != Form::chain || names().force.empty()) return own;
  return own + " (" + in_unit(eta * scene.f0, 4, "force") + ")";
}

void describe(Summary& summary, const Scene& scene, const FoundCycle& found) {
  const Cycle& cycle = found.cycle;
  const std::string cell = cycle.nodes == 1 ? "one node" : std::to_string(cycle.nodes) + " nodes";
  const std::string of_load = cycle.forcing_periods == 0 ? ""
                              : cycle.forcing_periods == 1
                                  ? ", that of the load"
                                  : fmt::format(", {} of the load", cycle.forcing_periods);
  summary.say(fmt::format(
      "cycle of {}: period T = {}{}, error below {:.2g} of it; psi from {:.10g} to {}, force drop {}{}",
      cell, period_text(cycle.period, 12), of_load, cycle.error_estimate, cycle.psi_min,
      in_unit(cycle.psi_max, 10, "velocity"), force_text(cycle.force_drop, scene, 8),
      cycle.rest_fraction > 0 ? fmt::format(", at rest for {:.4g} % of the time", 100 * cycle.rest_fraction)
                              : ""));
  if (!names().length.empty() && !names().time.empty())
    summary.say(fmt::format("amplitude {}, displacement {} to either side, acceleration up to {}",
                            in_unit(cycle.amplitude, 4, "velocity"),
                            in_unit(displacement_of(cycle), 4, "length"),
                            in_unit(acceleration_of(cycle), 4, "velocity/time")));
  if (!cycle.not_linear.empty()) {
    summary.say("perturbations: without multipliers and a verdict on stability: " + cycle.not_linear);
    return;
  }
  if (cycle.multipliers.size() < 2 && cycle.forcing_periods == 0) {
    summary.say("perturbations: none but a shift along the motion itself; a rest erases every other");
    return;
  }
  const std::complex<double> largest = cycle.multipliers[cycle.phase_mode == 0 ? 1 : 0];
  summary.say(std::string("perturbations") + (found.alone ? ": " : ", the same in every cell: ") +
              (growth_rate(cycle) < 0 ? "stable" : "not stable") + ", largest multiplier " + shown(largest) +
              (found.alone ? "" : " (-cycle_spectrum asks about waves)"));
}

void add_spectrum(ResultFile& file, const BlochSpectrum& spectrum) {
  if (!spectrum.coupled) return;
  std::vector<double> wavenumber, growth;
  std::vector<std::complex<double>> multipliers;
  for (const BlochPoint& point : spectrum.points) {
    wavenumber.push_back(point.wavenumber);
    growth.push_back(point.growth_rate);
    multipliers.insert(multipliers.end(), point.multipliers.begin(), point.multipliers.end());
  }
  file.scale({"spectrum/wavenumber", "1/length", "wavenumber"}, wavenumber);
  file.add({"spectrum/growth_rate", "1/time", "largest growth rate"}, {"spectrum/wavenumber"}, growth);
  file.add_complex({"spectrum/multiplier", "1", "Floquet-Bloch multiplier"},
                   {"spectrum/wavenumber", "spectrum/mode"}, multipliers);
  file.attribute("growth_rate", spectrum.growth_rate);
  file.attribute("growth_wavenumber", spectrum.wavenumber);
}

void describe(Summary& summary, const BlochSpectrum& spectrum) {
  if (!spectrum.coupled)
    return summary.say("waves: none, neighbours are not coupled; every cell keeps the phase that it has");
  const std::string most =
      fmt::format("largest growth rate {:.8g} at wavenumber {:.8g} (wavelength {:.6g})", spectrum.growth_rate,
                  spectrum.wavenumber, 2 * M_PI / spectrum.wavenumber);
  const std::string phase = fmt::format("phase diffusion {:.8g}", spectrum.diffusion);
  if (!spectrum.decided)
    return summary.say("waves: undecided, a growth rate is nearer to 0 than its error; " + phase);
  summary.say(spectrum.stable ? "waves: stable to every wavelength, " + phase
                              : "waves: not stable, " + (spectrum.wavenumber > 0 ? most + "; " : "") + phase);
}

void add_branch(ResultFile& file, const std::string& parameter, const CycleBranch& branch) {
  add_rows(file, branch_table(parameter), branch.points);
  add_rows(file, special_table(), branch.special);
  file.attribute("branch_parameter", parameter);
  file.attribute("branch_end", branch.end);
}

void describe(Summary& summary, const std::string& name, const CycleBranch& branch) {
  summary.say(fmt::format("branch in {}: {} points; {}", name, branch.points.size(), branch.end));
  for (const SpecialPoint& p : branch.special)
    summary.say(fmt::format("  {} at {} = {:.10g}{}{}", p.kind, name, p.value,
                            p.kind == "wave" ? fmt::format(", wavenumber {:.6g}", p.wavenumber) : "",
                            std::isfinite(p.period) ? fmt::format(", period {:.8g}", p.period) : ""));
}

std::vector<TableText> tables() {
  return {keys(), branch_table("the option's value"), special_table(), rest_table("length")};
}

int cycle(const Options& options) {
  CommandRun run("cycle", options, keys_of(keys()));
  Summary& summary = run.summary;
  check_continuation(options, "cycle");
  const Scene cell = cell_of_options(options);
  check_cycle_options(options, cell);
  return run.search("the cycle", [&] {
    CycleResults answer{find_cycle(options, cell), {}, {}, options.text("cycle_continue")};
    const FoundCycle& found = answer.found;
    check_unused_after_setup(options);
    ResultFile file = run.file();
    set_keys(summary, keys(), answer);
    add_cycle(file, cell, found);
    describe(summary, cell, found);
    say_beyond_table(options, found.cycle.psi_min, found.cycle.psi_max, summary);
    const bool with_waves = options.boolean("cycle_spectrum") && found.waves;
    if (with_waves) {
      Pulse::stage("waves on the cycle");
      answer.spectrum = found.waves(int(options.integer("cycle_wavenumbers")));
      set_keys(summary, keys(), answer);
      add_spectrum(file, *answer.spectrum);
      describe(summary, *answer.spectrum);
    }
    if (options.is_set("cycle_continue")) {
      Pulse::stage("branch in " + answer.parameter);
      answer.branch = found.branch(answer.parameter, options.real("cycle_to"),
                                   int(options.integer("cycle_steps")), with_waves);
      set_keys(summary, keys(), answer);
      add_branch(file, answer.parameter, *answer.branch);
      describe(summary, answer.parameter, *answer.branch);
      run.end_at_signal(file);
    }
    file.write();
    warn_unused_at_end(options);
  });
}

}  // namespace

Command cycle_command() {
  return {"cycle", "solves for a periodic oscillation: period, stability, waves on it, branches", cycle,
          false, tables};
}

namespace {

// Waves looked at for each cycle of a branch.
constexpr int wavenumbers_of_branch = 50;

bool has_neighbours(const Options& options) { return options.integer("cycle_cell") > 0; }

bool alone(const Options& options, const Scene& cell) {
  return !has_neighbours(options) || !(cell.mean_K1() > 0);
}

bool one_node(const Scene& cell) { return cell.n == 1; }

std::vector<double> positions(const Scene& cell) {
  std::vector<double> x;
  for (PetscInt i = 0; i < cell.n; ++i)
    if (!cell.held(i)) x.push_back(cell.x(i));
  return x;
}

CycleBranch smooth_branch(const Options& options, const SmoothCycle& first, const std::string& name,
                          double to, int steps, bool with_waves) {
  const double from = options.real(name);
  const auto cell_at = [options, name](double value) { return cell_of_options(options.with(name, value)); };
  const std::unique_ptr<CycleFamily> path = smooth_family(cell_at, from, std::abs(to - from), first);
  CycleWatch watch;
  if (with_waves)
    watch = [&path](double, const Cycle&) {
      return watch_waves(bloch_spectrum(smooth_candidate(*path), wavenumbers_of_branch));
    };
  return continue_cycle(*path, {name, from, to, steps}, watch);
}

FoundCycle smooth(const Options& options, const Scene& cell, const SmoothCycle& cycle) {
  const auto found = std::make_shared<const SmoothCycle>(cycle);
  FoundCycle result{found->cycle, positions(cell),      found->mesh.size() - 1,
                    nullptr,      alone(options, cell), nullptr};
  if (has_neighbours(options)) result.waves = [found](int count) { return bloch_spectrum(*found, count); };
  result.branch = [options, found](const std::string& name, double to, int steps, bool with_waves) {
    return smooth_branch(options, *found, name, to, steps, with_waves);
  };
  return result;
}

CycleBranch stick_branch(const Options& options, const StickCycle& first, const std::string& name, double to,
                         int steps, bool with_waves) {
  const double from = options.real(name);
  const auto cell_at = [options, name](double value) { return cell_of_options(options.with(name, value)); };
  const std::unique_ptr<CycleFamily> path = stick_family(cell_at, from, std::abs(to - from), first);
  CycleWatch watch;
  if (with_waves)
    watch = [&path, cell_at](double value, const Cycle& cycle) {
      return watch_waves(
          bloch_spectrum(stick_candidate(*path), cycle, cell_at(value), wavenumbers_of_branch));
    };
  return continue_cycle(*path, {name, from, to, steps}, watch);
}

[[noreturn]] void refuse_fate(const std::string& none, const StickFate& fate) {
  throw Failure(none + ": the motion " + to_string(fate.fate) + " (looked at for a time of " +
                rounded_text(fate.time) + ")");
}

FoundCycle sticking(const Options& options, const Scene& cell, const StickCycle& stick) {
  FoundCycle result{described(cell, stick), positions(cell), 0, nullptr, alone(options, cell), nullptr};
  const std::string why = result.cycle.not_linear;
  if (has_neighbours(options) && why.empty())
    result.waves = [cell, course = result.cycle, stick](int count) {
      return bloch_spectrum(stick, course, cell, count);
    };
  result.branch = [options, stick, why](const std::string& name, double to, int steps, bool with_waves) {
    if (!why.empty()) throw Failure("cycle_continue: a branch is followed by deviations that add up; " + why);
    return stick_branch(options, stick, name, to, steps, with_waves);
  };
  return result;
}

FoundCycle sticking(const Options& options, const Scene& cell) {
  const bool uniform = one_node(cell) && has_neighbours(options);
  const StickFate fate = uniform ? uniform_stick_fate(cell) : stick_fate(cell, start_of_cell(options, cell));
  if (fate.fate != Fate::repeats) refuse_fate("no cycle with rests", fate);
  return sticking(options, cell, fate.cycle);
}

// Under a load: the cycle with rests that the motion settles on, or one that never stops.
FoundCycle sticking_under_load(const Options& options, const Scene& cell) {
  const StickFate fate = forced_stick_fate(cell, start_of_cell(options, cell));
  if (fate.fate == Fate::repeats) return sticking(options, cell, fate.cycle);
  if (fate.fate != Fate::oscillates) refuse_fate("no cycle", fate);
  std::vector<double> start = fate.cycle.start;
  start.pop_back();  // the time
  const SmoothCycle found = settled_cycle(cell, start, turns_to_settle);
  if (!(least_along(found.cycle, cell.v) > 0))
    throw Failure("no cycle: the motion slides without a stop, and the cycle beside it would stop");
  return smooth(options, cell, found);
}

}  // namespace

Scene cell_of_options(const Options& options) {
  Scene scene = Scene::from(options);
  const PetscInt cell = options.integer("cycle_cell");
  if (cell == 0) return scene;
  const std::string which = "cycle_cell " + std::to_string(cell) + ": ";
  if (scene.has_profile())
    throw UsageError(which + "with a profile along x no cell repeats; cycle_cell 0 takes the whole scene");
  const std::vector<double> amplitude = friction_amplitude(scene, 0, scene.n);
  if (std::any_of(amplitude.begin(), amplitude.end(), [](double a) { return a != 1; }))
    throw UsageError(
        which +
        "where the amplitude of friction differs from node to node no cell repeats; cycle_cell 0 "
        "takes the whole scene");
  if (scene.any_held())
    throw UsageError(which +
                     "with a held end all nodes move differently; cycle_cell 0 takes the whole scene");
  if (cell > 1 && !scene.ring())
    throw UsageError(
        which +
        "several nodes repeat on a ring only; cycle_cell 1: all nodes move in the same way, 0: the "
        "whole scene");
  scene.length = cell == 1 && scene.form == Form::chain ? 1 : scene.h() * double(cell);
  scene.n = cell;
  scene.left = scene.right = End::periodic;
  return scene;
}

std::vector<double> start_of_cell(const Options& options, const Scene& cell) {
  const Model model(PETSC_COMM_SELF, cell);
  const VecHandle u = model.create_vector();
  Start(cell, options).fill(model, u);
  const Reading values(u);
  std::vector<double> start;
  for (PetscInt node = 0; node < cell.n; ++node)
    for (int k = 0; k < model.dof(); ++k) start.push_back(values[node * model.dof() + k]);
  return start;
}

void check_cycle_options(const Options& options, const Scene& cell) {
  if (!cell.friction.sticks()) {
    check_smooth_cell(cell);
  } else {
    if (cell.n > stick_cycle_limit)
      throw UsageError("a cycle of " + std::to_string(cell.n) + " nodes with exact stick: at most " +
                       std::to_string(stick_cycle_limit) +
                       " are solved for; take fewer (grid_n, cycle_cell) or "
                       "friction_stick regularised");
  }
  if (options.boolean("cycle_spectrum") && !has_neighbours(options))
    throw UsageError(
        "cycle_spectrum: a whole scene (cycle_cell 0) has no neighbours; its own multipliers say all");
  if (springless(cell))
    throw UsageError(
        cell.forced()
            ? "model_k0 0: the mean force of the springs stays what it is at the start, so that under a load "
              "there is a cycle for each and none is apart; set a positive stiffness to the plate, or take "
              "`run`"
            : "model_k0 0: nothing drives a cycle; set a positive stiffness to the plate");
}

FoundCycle find_cycle(const Options& options, const Scene& cell) {
  const bool forced = cell.forced();
  if (cell.friction.sticks()) return forced ? sticking_under_load(options, cell) : sticking(options, cell);
  return smooth(options, cell,
                one_node(cell) && has_neighbours(options) && !forced && !cell.massless()
                    ? uniform_cycle(cell)
                    : settled_cycle(cell, start_of_cell(options, cell), turns_to_settle));
}

}  // namespace stickslip
