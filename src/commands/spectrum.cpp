// The command `spectrum`: steady sliding and the rightmost eigenvalues of the operator linearised about it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "commands/command.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

namespace {

SpectrumMethod method_of(const std::string& text) {
  if (text == "dense") return SpectrumMethod::dense;
  if (text == "krylov") return SpectrumMethod::krylov;
  return SpectrumMethod::automatic;
}

// A number with the digits that its error leaves.
std::string known_digits(double value, double error) {
  if (!std::isfinite(value) || !(error > 0)) return number_text(value);
  const double digits = std::floor(std::log10(std::max(std::abs(value), error) / error)) + 1;
  return rounded_text(std::abs(value) < error ? 0 : value, int(std::clamp(digits, 1., 15.)));
}

std::string verdict(const Spectrum& spectrum) {
  const bool unstable = spectrum.growth > spectrum.error || spectrum.growth_continuum.value_or(-1) > 0;
  std::string text = spectrum.stable ? "stable" : unstable ? "unstable" : "undecided";
  text += fmt::format(": growth rate {} +- {}, frequency {}", known_digits(spectrum.growth, spectrum.error),
                      in_unit(spectrum.error, 2, "1/time"), frequency_text(spectrum.frequency, 6));
  if (spectrum.degenerate) text += " (of the longest of several waves with the same growth)";
  if (!spectrum.complete) text += " (not proved to be the rightmost)";
  return text;
}

// One of a mode and its conjugate.
struct Eigenvalue {
  const Mode& mode;
  double im;
};
Table<Eigenvalue> mode_table() {
  using Row = const Eigenvalue&;
  return {"eigenvalues",
          "",
          "mode",
          {{"re", "1/time", "growth rate", [](Row e) { return e.mode.value.real(); }},
           {"im", "1/time", "frequency", &Eigenvalue::im},
           {"residual", "1/time", "|J x - lambda x|/|x|, x in the units in which J is balanced",
            [](Row e) { return e.mode.residual; }},
           {"wavenumber", "1/length", "wavenumber", [](Row e) { return e.mode.wavenumber; }},
           {"resolved", "1", "1 where the grid resolves the mode", [](Row e) { return e.mode.resolved; }}},
          "number of the eigenvalue, rightmost first"};
}

Json eigenvalue_list(const std::vector<Mode>& modes) {
  std::vector<Eigenvalue> all;
  for (const Mode& m : modes) {
    all.push_back({m, m.value.imag()});
    if (m.value.imag() != 0) all.push_back({m, -m.value.imag()});
  }
  return list_of(mode_table(), all);
}

Table<UniformState> state_table() {
  using Row = const UniformState&;
  const auto moving = [](double UniformState::*member) {
    return [member](Row u) { return u.rests ? Json() : Json(u.*member); };
  };
  return {"uniform_states",
          "",
          "",
          {{"psi", "length/time", "velocity", &UniformState::psi},
           {"state", "", "of the contact", &UniformState::state},
           {"slope", "time/length", "of steady friction with damping", moving(&UniformState::slope)},
           {"growth_rate", "1/time", "of its fastest wave", moving(&UniformState::growth_rate)},
           {"frequency", "1/time", "of that wave", moving(&UniformState::frequency)},
           {"wavenumber", "1/length", "of that wave", moving(&UniformState::wavenumber)},
           {"stable", "", "none grows", &UniformState::stable}}};
}

// What is known, one after the other.
struct SpectrumResults {
  const SteadySliding& steady;
  std::size_t unknowns;
  std::optional<Spectrum> spectrum;
  std::optional<std::vector<UniformState>> states;
};

Json steady_of(const SpectrumResults& r) {
  const auto [low, high] = std::minmax_element(r.steady.psi.begin(), r.steady.psi.end());
  return {{"psi_min", *low}, {"psi_max", *high}, {"residual", r.steady.residual}};
}

Columns<Spectrum> spectrum_columns() {
  return {{"growth_rate", "1/time", "largest real part among resolved modes", &Spectrum::growth},
          {"growth_rate_error", "1/time", "how far it may be off", &Spectrum::error},
          {"frequency", "1/time", "imaginary part of that mode (radians)", &Spectrum::frequency},
          {"degenerate", "", "many waves grow at the same rate; the longest is given", &Spectrum::degenerate},
          {"stable", "", "the growth rate is negative by more than its error, modes of symmetry excepted",
           &Spectrum::stable},
          {"growth_continuum", "1/time",
           "the largest growth rate over all waves, not only those that fit this ring and grid",
           &Spectrum::growth_continuum},
          {"wavenumber_continuum", "1/length", "of the wave that has it", &Spectrum::wavenumber_continuum},
          {"eigenvalues", "", "rightmost first", [](const Spectrum& s) { return eigenvalue_list(s.modes); }},
          {"dispersion_error", "1",
           "largest relative distance from the exact dispersion relation, where that holds",
           &Spectrum::dispersion_error},
          {"complete", "", "no mode right of the first one listed is missing", &Spectrum::complete},
          {"list_complete", "", "none is missing among those listed", &Spectrum::list_complete},
          {"missing", "1", "how many are, where that is known", &Spectrum::missing},
          {"completeness_check", "", "how that was established", &Spectrum::completeness_check},
          {"method", "", "how eigenvalues were computed", &Spectrum::method}};
}

Columns<SpectrumResults> keys() {
  using R = const SpectrumResults&;
  return Columns<SpectrumResults>{
             {"steady", "",
              "the state linearised about: `psi_min`, `psi_max` and the `residual` of its equations",
              steady_of}} +
         of<SpectrumResults>(&SpectrumResults::spectrum, spectrum_columns()) +
         Columns<SpectrumResults>{
             {"unknowns", "1", "size of the matrix", &SpectrumResults::unknowns},
             {"uniform_states", "",
              "of a chain with k0 = 0, uniform and without held ends: every steady velocity at the force of "
              "the start (`init_eta`)",
              [](R r) { return r.states ? list_of(state_table(), *r.states) : Json(); }}};
}

// Steady sliding and the eigenvectors (the members with Im >= 0; 0 at held nodes), scaled so that the largest
// psi is 1.
void write_file(const SteadySliding& steady, const LinearisedOperator& s, const Spectrum& spectrum,
                const CommandRun& run) {
  if (!run.has_file()) return;
  ResultFile file = run.file();
  const std::size_t n = std::size_t(s.scene.n), modes = spectrum.modes.size(), d = s.fields();
  std::vector<double> x(n);
  for (std::size_t i = 0; i < n; ++i) x[i] = s.scene.x(PetscInt(i));
  file.attribute("form", to_string(s.scene.form));
  file.attribute("method", spectrum.method);
  file.attribute("completeness_check", spectrum.completeness_check);
  file.attribute("growth_rate", spectrum.growth);
  file.attribute("frequency", spectrum.frequency);
  file.scale({"x", "length", "position of the nodes"}, x);
  std::vector<Eigenvalue> eigenvalues;
  for (const Mode& m : spectrum.modes) eigenvalues.push_back({m, m.value.imag()});
  add_rows(file, mode_table(), eigenvalues);

  file.add({"steady_psi", "length/time", "psi of steady sliding"}, {"x"}, steady.psi);
  file.add({"steady_eta", "1", "eta of steady sliding"}, {"x"}, steady.eta);
  const bool logarithmic = state_is_logarithmic(s.scene.friction.state);
  std::vector<std::string> names{"psi", "eta"};
  if (s.has_state()) {
    names.push_back(state_name(s.scene.friction.state));
    std::vector<double> shown = steady.state;
    for (double& y : shown) y = state_to_output(s.scene.friction.state, y);
    file.add({"steady_" + names[2], standard_field(names[2]).units, names[2] + " of steady sliding"}, {"x"},
             shown);
  }
  std::vector<std::vector<Complex>> parts(names.size(), std::vector<Complex>(modes * n));
  for (std::size_t k = 0; k < modes; ++k) {
    const std::vector<Complex> v = s.expand_fields(spectrum.modes[k].value, spectrum.modes[k].psi);
    for (std::size_t i = 0; i < s.size(); ++i)
      for (std::size_t c = 0; c < d; ++c) {
        const PetscInt node = s.coupling.node[i];
        // the stored state is ln(theta): d theta = theta d ln(theta)
        const double scale = c == 2 && logarithmic ? std::exp(steady.state[node]) : 1;
        parts[c][k * n + node] = scale * v[i * d + c];
      }
  }
  for (std::size_t c = 0; c < names.size(); ++c)
    file.add_complex({names[c], standard_field(names[c]).units, names[c] + " of the eigenvectors"},
                     {"mode", "x"}, parts[c]);
  file.write();
}

// The uniform motions at the force of the start, which init_eta says; in a line each for a person.
std::vector<UniformState> states_at_start(const Scene& scene, const Options& options, Summary& summary) {
  const auto friction = Friction::of(scene.friction);
  const bool steady = options.text("init_eta") == "steady";
  const double stress = steady
                            ? scene.B() * scene.v + friction->force(scene.v, friction->steady_state(scene.v))
                            : options.real("init_eta");
  const std::vector<UniformState> states = uniform_states(scene, stress);
  for (const UniformState& u : states)
    summary.say(fmt::format(
        "at the force {:.6g} of the start: psi = {:.6g}, {}", stress, u.psi,
        u.rests ? "at rest"
                : fmt::format("{}, growth rate {:.4g}", u.stable ? "stable" : "unstable", u.growth_rate)));
  return states;
}

bool any_resolved(const Spectrum& spectrum) {
  return std::any_of(spectrum.modes.begin(), spectrum.modes.end(), [](const Mode& m) { return m.resolved; });
}

// Many modes at the edge of what the grid carries may stand right of those that it resolves.
Spectrum resolved_spectrum(const LinearisedOperator& J, const Options& options) {
  SpectrumSettings settings;
  settings.count = options.integer("spectrum_count");
  settings.method = method_of(options.text("spectrum_method"));
  settings.refine = options.text("spectrum_refine") == "auto";
  Spectrum spectrum = compute_spectrum(PETSC_COMM_WORLD, J, settings);
  for (int round = 0; round < 3 && !any_resolved(spectrum); ++round) {
    settings.count *= 4;
    spectrum = compute_spectrum(PETSC_COMM_WORLD, J, settings);
  }
  return spectrum;
}

std::vector<TableText> tables() { return {keys(), mode_table(), state_table()}; }

int spectrum(const Options& options) {
  CommandRun run("spectrum", options, keys_of(keys()));
  Summary& summary = run.summary;
  const Scene scene = Scene::from(options, true);
  return run.search("steady sliding", [&] {
    const SteadySliding steady(scene);
    const LinearisedOperator J(steady);
    SpectrumResults results{steady, J.size() * J.dof(), {}, {}};
    const auto tell = [&] { set_keys(summary, keys(), results); };
    tell();
    Pulse::stage("eigenvalues");
    const Spectrum spectrum = resolved_spectrum(J, options);
    check_unused_after_setup(options);
    results.spectrum = spectrum;
    tell();
    if (has_uniform_states(scene)) results.states = states_at_start(scene, options, summary);
    tell();
    write_file(steady, J, spectrum, run);
    if (!any_resolved(spectrum))
      warn("no mode found is resolved by the grid: take more nodes (grid_n), or -spectrum_refine off");
    for (const std::string& remark : spectrum.remarks) warn(remark);
    if (!spectrum.complete)
      warn("the rightmost mode may have been missed: " + spectrum.completeness_check);
    else if (!spectrum.list_complete)
      warn("the list of eigenvalues may have holes: " + spectrum.completeness_check);
    summary.say("steady sliding is " + verdict(spectrum));
    summary.say(fmt::format("{} modes of {} by {}; {}", spectrum.modes.size(), results.unknowns,
                            spectrum.method, spectrum.completeness_check));
  });
}

}  // namespace

Command spectrum_command() {
  return {"spectrum", "steady sliding, then the eigenvalues of the operator linearised about it", spectrum,
          true, tables};
}

}  // namespace stickslip
