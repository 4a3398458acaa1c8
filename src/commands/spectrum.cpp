// The command `spectrum`: steady sliding and the rightmost eigenvalues of the operator linearised about it.
#include <algorithm>
#include <cmath>

#include "base/progress.hpp"
#include "base/pulse.hpp"
#include "stickslip/commands/commands.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/stability/spectrum.hpp"
#include "stickslip/stability/transient.hpp"
#include "stickslip/stability/uniform_states.hpp"
#include "stickslip/output/summary.hpp"

namespace stickslip {

namespace {

SpectrumMethod method_of(const std::string& text) {
  if (text == "dense") return SpectrumMethod::dense;
  if (text == "krylov") return SpectrumMethod::krylov;
  return SpectrumMethod::automatic;
}

constexpr const char* no_norm =
    "not for this scene, which has no energy norm (D2 is not symmetric: held ends of order "
    "4 or 6; k0 = 0 without a held end; or no mass), or too large for its matrix with model_nu";

// What the number says about the largest |exp(J t)|.
std::string growth_is(const Transient& t) {
  if (t.exact) return "the maximum over time";
  if (t.method != "iteration") return "a lower bound: the maximum over the times looked at";
  return "a lower bound: waves up to frequency " + rounded_text(t.frequency, 6);
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
  text += ": growth rate " + known_digits(spectrum.growth, spectrum.error) + " +- " +
          rounded_text(spectrum.error, 2) + ", frequency " + rounded_text(spectrum.frequency, 6);
  if (spectrum.degenerate) text += " (of the longest of several waves that grow alike)";
  if (!spectrum.complete) text += " (not proved to be the rightmost)";
  return text;
}

Json eigenvalue_list(const std::vector<Mode>& modes) {
  Json list = Json::array();
  for (const Mode& m : modes)
    for (const double sign : {1., -1.}) {
      if (sign < 0 && m.value.imag() == 0) continue;
      list.push_back(Json::object({{"re", m.value.real()},
                                   {"im", sign * m.value.imag()},
                                   {"residual", m.residual},
                                   {"wavenumber", m.wavenumber},
                                   {"resolved", m.resolved}}));
    }
  return list;
}

// The resolvent norm in a box round the listed eigenvalues with Im >= 0, the imaginary axis included.
struct Pseudospectrum {
  std::vector<double> re, im, norm;  // re fastest
};

Pseudospectrum pseudospectrum_beside(const LinearisedOperator& s, const Spectrum& spectrum, PetscInt side,
                                     Progress&& progress) {
  Pseudospectrum box;
  double left = 0, right = 0, bottom = 1e300, top = 0;
  for (const Mode& m : spectrum.modes) {
    left = std::min(left, m.value.real());
    right = std::max(right, m.value.real());
    bottom = std::min(bottom, m.value.imag());
    top = std::max(top, m.value.imag());
  }
  const double wide = std::max({0.5 * (right - left), 0.25 * (top - bottom), 1e-3 * top});
  const double high = std::max(0.3 * (top - bottom), wide);
  bottom = std::max(0., bottom - high);
  for (PetscInt k = 0; k < side; ++k) {
    const double part = (double(k) + 0.5) / double(side);  // off the axes, where eigenvalues may stand
    box.re.push_back(left - wide + part * (right - left + 2 * wide));
    box.im.push_back(bottom + part * (top + high - bottom));
  }
  box.norm = pseudospectrum(PETSC_COMM_WORLD, s, box.re, box.im, [&](double part) {
    if (progress.due())
      progress.show(std::to_string(int(100 * part)) + " % of the resolvent norms" + progress.left(part));
  });
  return box;
}

// Steady sliding and the eigenvectors (the members with Im >= 0; 0 at held nodes), scaled so that the largest
// psi is 1.
void write_file(const SteadySliding& steady, const LinearisedOperator& s, const Spectrum& spectrum,
                const Pseudospectrum& box, const std::string& path, const Provenance& provenance) {
  ResultFile file(PETSC_COMM_WORLD, path, provenance);
  if (path.empty()) return;
  const std::size_t n = std::size_t(s.scene.n), modes = spectrum.modes.size(), d = s.fields();
  std::vector<double> x(n), number(modes);
  for (std::size_t i = 0; i < n; ++i) x[i] = s.scene.x(PetscInt(i));
  for (std::size_t k = 0; k < modes; ++k) number[k] = double(k);
  file.attribute("form", to_string(s.scene.form));
  file.attribute("method", spectrum.method);
  file.attribute("completeness_check", spectrum.completeness_check);
  file.attribute("growth_rate", spectrum.growth);
  file.attribute("frequency", spectrum.frequency);
  file.scale({"x", "length", "position of the nodes"}, x);
  file.scale({"mode", "1", "number of the eigenvalue, rightmost first"}, number);
  const auto of_modes = [&](const Field& field, const auto& value) {
    std::vector<double> values;
    for (const Mode& m : spectrum.modes) values.push_back(value(m));
    file.add(field, {"mode"}, values);
  };
  of_modes({"re", "1/time", "growth rate"}, [](const Mode& m) { return m.value.real(); });
  of_modes({"im", "1/time", "frequency"}, [](const Mode& m) { return m.value.imag(); });
  of_modes({"residual", "1/time", "|J x - lambda x|/|x|"}, [](const Mode& m) { return m.residual; });
  of_modes({"wavenumber", "1/length", "wavenumber"}, [](const Mode& m) { return m.wavenumber; });
  of_modes({"resolved", "1", "1 where the grid resolves the mode"},
           [](const Mode& m) { return double(m.resolved); });

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
  std::vector<std::vector<double>> parts(2 * names.size(), std::vector<double>(modes * n, 0.));
  for (std::size_t k = 0; k < modes; ++k) {
    const std::vector<Complex> v = s.expand_fields(spectrum.modes[k].value, spectrum.modes[k].psi);
    for (std::size_t i = 0; i < s.size(); ++i)
      for (std::size_t c = 0; c < d; ++c) {
        const std::size_t at = k * n + std::size_t(s.coupling.node[i]);
        // the stored state is ln(theta): d theta = theta d ln(theta)
        const double scale =
            c == 2 && logarithmic ? std::exp(steady.state[s.coupling.node[i]]) : 1;
        parts[2 * c][at] = scale * v[i * d + c].real();
        parts[2 * c + 1][at] = scale * v[i * d + c].imag();
      }
  }
  for (std::size_t c = 0; c < names.size(); ++c) {
    const std::string units = standard_field(names[c]).units;
    file.add({names[c] + "_re", units, names[c] + " of the eigenvectors, real part"}, {"mode", "x"},
             parts[2 * c]);
    file.add({names[c] + "_im", units, names[c] + " of the eigenvectors, imaginary part"}, {"mode", "x"},
             parts[2 * c + 1]);
  }
  if (!box.norm.empty()) {
    file.scale({"pseudo_re", "1/time", "real part of z"}, box.re);
    file.scale({"pseudo_im", "1/time", "imaginary part of z"}, box.im);
    std::vector<double> logarithm(box.norm.size());
    std::transform(box.norm.begin(), box.norm.end(), logarithm.begin(),
                   [](double r) { return std::log10(r); });
    file.add({"log10_resolvent", "1", "log10 of |(z - J)^-1| times a unit of time, energy norm"},
             {"pseudo_im", "pseudo_re"}, logarithm);
  }
  file.write();
}

// The uniform motions at the force of the start, which init_eta says; in a line each for a person.
Json uniform_state_list(const Scene& scene, const Options& options, Summary& summary) {
  const auto friction = Friction::of(scene.friction);
  const bool steady = options.text("init_eta") == "steady";
  const double stress = steady
                            ? scene.B() * scene.v + friction->force(scene.v, friction->steady_state(scene.v))
                            : options.real("init_eta");
  Json list = Json::array();
  for (const UniformState& u : uniform_states(scene, stress)) {
    list.push_back(Json::object({{"psi", u.psi},
                                 {"state", u.state ? Json(*u.state) : Json()},
                                 {"slope", u.rests ? Json() : Json(u.slope)},
                                 {"growth_rate", u.rests ? Json() : Json(u.growth_rate)},
                                 {"frequency", u.rests ? Json() : Json(u.frequency)},
                                 {"wavenumber", u.rests ? Json() : Json(u.wavenumber)},
                                 {"stable", u.stable}}));
    summary.say("at the force " + rounded_text(stress, 6) + " of the start: psi = " + rounded_text(u.psi, 6) +
                ", " +
                (u.rests ? "at rest"
                         : (u.stable ? "stable, " : "unstable, ") + std::string("growth rate ") +
                               rounded_text(u.growth_rate, 4)));
  }
  return list;
}

}  // namespace

int spectrum_command(const Options& options) {
  const Provenance provenance = Provenance::of("spectrum", options.all());
  const OutputLock lock = check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(
      provenance,
      {"steady", "growth_rate", "growth_rate_error", "frequency", "degenerate", "stable", "growth_continuum",
       "wavenumber_continuum", "eigenvalues", "dispersion_error", "complete", "list_complete", "missing",
       "completeness_check", "method", "unknowns", "transient", "kreiss", "uniform_states"},
      options.text("summary"));
  const Scene scene = Scene::from(options, true);
  return with_summary(summary, [&] {
    const Pulse pulse(options.text("progress"), "spectrum");
    const SteadySliding steady(scene);
    const LinearisedOperator J(steady);
    const auto [low, high] = std::minmax_element(steady.psi.begin(), steady.psi.end());
    summary.set("steady",
                Json::object({{"psi_min", *low}, {"psi_max", *high}, {"residual", steady.residual}}));
    summary.set("unknowns", J.size() * J.dof());
    SpectrumSettings settings;
    settings.count = options.integer("spectrum_count");
    settings.method = method_of(options.text("spectrum_method"));
    settings.refine = options.text("spectrum_refine") == "auto";
    Spectrum spectrum = compute_spectrum(PETSC_COMM_WORLD, J, settings);
    const auto any_resolved = [&] {
      return std::any_of(spectrum.modes.begin(), spectrum.modes.end(),
                         [](const Mode& m) { return m.resolved; });
    };
    // Many modes at the edge of what the grid carries may stand right of those that it resolves.
    for (int round = 0; round < 3 && !any_resolved(); ++round) {
      settings.count *= 4;
      spectrum = compute_spectrum(PETSC_COMM_WORLD, J, settings);
    }
    check_unused_after_setup(options, "snes pep dm");
    summary.set("growth_rate", spectrum.growth);
    summary.set("growth_rate_error", spectrum.error);
    summary.set("frequency", spectrum.frequency);
    summary.set("degenerate", spectrum.degenerate);
    summary.set("growth_continuum", spectrum.growth_continuum);
    summary.set("wavenumber_continuum", spectrum.wavenumber_continuum);
    summary.set("stable", spectrum.stable);
    summary.set("eigenvalues", eigenvalue_list(spectrum.modes));
    summary.set("dispersion_error", spectrum.dispersion_error);
    summary.set("complete", spectrum.complete);
    summary.set("list_complete", spectrum.list_complete);
    summary.set("missing", spectrum.missing ? Json(*spectrum.missing) : Json());
    summary.set("completeness_check", spectrum.completeness_check);
    summary.set("method", spectrum.method);
    if (options.boolean("spectrum_transient")) {
      const std::optional<Transient> t = transient_growth(J, spectrum.growth);
      if (t) {
        summary.set("transient",
                    Json::object({{"norm", "energy"},
                                  {"method", t->method},
                                  {"numerical_abscissa", t->abscissa},
                                  {"growth", spectrum.stable ? Json(t->growth) : Json()},
                                  {"time", spectrum.stable ? Json(t->time) : Json()},
                                  {"growth_is", spectrum.stable ? Json(growth_is(*t)) : Json()}}));
      } else {
        warn(std::string("-spectrum_transient: ") + no_norm);
      }
    }
    Pseudospectrum box;
    if (const PetscInt side = options.integer("spectrum_pseudo"); side > 0) {
      box = pseudospectrum_beside(J, spectrum, side, Progress(options.text("progress"), "spectrum: "));
      if (box.norm.empty()) warn(std::string("-spectrum_pseudo: ") + no_norm);
      double kreiss = 0;
      for (std::size_t k = 0; k < box.norm.size(); ++k)
        kreiss = std::max(kreiss, box.re[k % box.re.size()] * box.norm[k]);
      if (!box.norm.empty() && spectrum.stable) summary.set("kreiss", kreiss);
    }
    if (has_uniform_states(scene)) summary.set("uniform_states", uniform_state_list(scene, options, summary));
    write_file(steady, J, spectrum, box, options.text("out_file"), provenance);
    if (!any_resolved())
      warn("no mode found is resolved by the grid: take more nodes (grid_n), or -spectrum_refine off");
    for (const std::string& remark : spectrum.remarks) warn(remark);
    if (!spectrum.complete)
      warn("the rightmost mode may have been missed: " + spectrum.completeness_check);
    else if (!spectrum.list_complete)
      warn("the list of eigenvalues may have holes: " + spectrum.completeness_check);
    summary.say("steady sliding is " + verdict(spectrum));
    summary.say(std::to_string(spectrum.modes.size()) + " modes of " + std::to_string(J.size() * J.dof()) +
                " by " + spectrum.method + "; " + spectrum.completeness_check);
    return 0;
  });
}

}  // namespace stickslip
