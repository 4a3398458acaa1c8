// The command `wave`: a train of pulses, its stability, a branch of trains; to the summary, a file, and the
// terminal.
#include <cmath>

#include "base/pulse.hpp"
#include "stickslip/commands/commands.hpp"
#include "stickslip/base/json_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/output/field.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/study/run_layout.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/summary.hpp"
#include "commands/wave_limits.hpp"
#include "commands/wave_options.hpp"
#include "stickslip/waves/branch.hpp"
#include "stickslip/waves/wave_stability.hpp"

namespace stickslip {

namespace {

// The train as it stands on its ring at t = 0, at the mesh and Gauss points of every pulse, x rising; and
// what the picture needs of the scene.
void add_train(ResultFile& file, const Scene& scene, const Train& train) {
  const std::vector<double> phases = train.phases();
  std::vector<double> x, psi, eta, state;
  const double pulse = train.length / double(train.pulses);
  auto put = [&](double at, double phase) {
    x.push_back(at);
    psi.push_back(train.psi_at(phase));
    eta.push_back(train.eta_at(phase));
    state.push_back(state_to_output(scene.friction.state, train.state_at(phase)));
  };
  for (PetscInt k = 0; k < train.pulses; ++k) {
    if (train.speed < 0) {
      for (double phase : phases) put((double(k) + phase) * pulse, phase);
    } else {  // psi = f(t - x/V): phase falls with x
      put(double(k) * pulse, 0);
      for (size_t i = phases.size(); i-- > 1;) put((double(k) + 1 - phases[i]) * pulse, phases[i]);
    }
  }
  put(train.length, 0);
  file.scale({"x", "length", "position on the ring"}, x);
  file.add(standard_field("psi"), {"x"}, psi);
  file.add(standard_field("eta"), {"x"}, eta);
  const StateLaw law = scene.friction.state;
  if (!law.none()) file.add(standard_field(state_name(law)), {"x"}, state);
  const RunLayout layout = run_layout(scene);
  for (const auto& [name, value] : layout.numbers) file.attribute(name, value);
  file.scale({"friction/psi", "length/time", "sliding velocity"}, layout.friction_psi);
  file.add({"friction/F", "1", "friction force over its amplitude"}, {"friction/psi"}, layout.friction_F);
  file.attribute("speed", train.speed);
  file.attribute("length", train.length);
  file.attribute("pulses", double(train.pulses));
  file.attribute("period", train.period);
}

void describe(Summary& summary, const Train& train) {
  summary.say("train of " + std::to_string(train.pulses) + (train.pulses == 1 ? " pulse" : " pulses") +
              " on a ring: speed V = " + rounded_text(train.speed, 12) + ", length L = " +
              rounded_text(train.length, 12) + ", period T = " + rounded_text(train.period, 12));
  summary.say(std::string("solved for the ") + (train.length_given ? "speed" : "length") + ", error below " +
              rounded_text(train.error_estimate, 2) + "; psi from " + rounded_text(train.psi_min, 10) +
              " to " + rounded_text(train.psi_max, 10) + "; " + std::to_string(train.intervals()) +
              " mesh intervals");
}

Json verdict(bool known, bool stable) { return known ? Json(stable) : Json(); }

void add_spectrum(Summary& summary, ResultFile& file, const TrainSpectrum& spectrum) {
  Json list = Json::array();
  std::vector<double> re, im, wavenumber, resolved;
  for (const TrainMode& mode : spectrum.modes) {
    list.push_back(Json::object({{"re", mode.lambda.real()},
                                 {"im", mode.lambda.imag()},
                                 {"residual", mode.residual},
                                 {"wavenumber", mode.wavenumber},
                                 {"resolved", mode.resolved},
                                 {"bloch", mode.bloch},
                                 {"translation", mode.translation}}));
    re.push_back(mode.lambda.real());
    im.push_back(mode.lambda.imag());
    wavenumber.push_back(mode.wavenumber);
    resolved.push_back(mode.resolved);
  }
  summary.set("eigenvalues", list);
  summary.set("stable", verdict(spectrum.known, spectrum.stable));
  summary.set("growth_rate", spectrum.growth_rate);
  summary.set("translation_error", spectrum.translation_error);
  summary.set("complete", spectrum.complete);
  summary.set("completeness_check", spectrum.completeness_check);
  summary.set("endless", Json::object({{"stable", verdict(spectrum.infinite_known, spectrum.infinite_stable)},
                                       {"growth_rate", spectrum.infinite_growth},
                                       {"wavenumber", spectrum.infinite_wavenumber},
                                       {"frequency", spectrum.infinite_frequency}}));
  if (re.empty()) return;
  file.add({"spectrum/re", "1/time", "growth rate of the mode"}, {"spectrum/mode"}, re);
  file.add({"spectrum/im", "1/time", "its frequency in the frame of the train"}, {"spectrum/mode"}, im);
  file.add({"spectrum/wavenumber", "1/length", "wavenumber of its Bloch factor"}, {"spectrum/mode"},
           wavenumber);
  file.add({"spectrum/resolved", "1", "1 where a finer mesh agrees"}, {"spectrum/mode"}, resolved);
}

void describe(Summary& summary, const TrainSpectrum& spectrum) {
  if (std::isnan(spectrum.growth_bound)) return summary.say("stability: " + spectrum.completeness_check);
  const std::string rate =
      std::isnan(spectrum.growth_rate)
          ? ", every other mode at a growth rate below " + rounded_text(spectrum.growth_bound, 6)
          : ", largest growth rate " + rounded_text(spectrum.growth_rate, 6);
  summary.say(spectrum.known
                  ? std::string("on its ring: ") + (spectrum.stable ? "stable" : "not stable") + rate +
                        " (translation mode: " + rounded_text(spectrum.translation_error, 2) + ")"
                  : "on its ring: whether it is stable is not known" +
                        (std::isnan(spectrum.growth_rate) ? "" : rate + " of those found"));
  summary.say(!spectrum.infinite_known ? "infinite train: whether it is stable is not known"
              : spectrum.infinite_stable
                  ? "infinite train: stable to every wavelength"
                  : "infinite train: not stable, growth rate " + rounded_text(spectrum.infinite_growth, 6) +
                        " at wavenumber " + rounded_text(spectrum.infinite_wavenumber, 6) + ", frequency " +
                        rounded_text(spectrum.infinite_frequency, 6));
}

// With wave_spectrum, the stability of every train of the branch too.
void add_branch(Summary& summary, ResultFile& file, const Options& options, const Branch& branch) {
  const std::string name = options.text("wave_continue");
  const bool with_spectrum = options.boolean("wave_spectrum");
  std::map<std::string, std::vector<double>> columns;
  Json points = Json::array();
  for (const BranchPoint& point : branch.points) {
    const Train& train = point.train;
    std::vector<std::pair<std::string, double>> row = {
        {"value", point.value},   {"speed", train.speed},     {"length", train.length},
        {"period", train.period}, {"psi_min", train.psi_min}, {"psi_max", train.psi_max}};
    Json stable;
    if (with_spectrum) {
      const TrainSpectrum spectrum = train_spectrum(train, 4);
      row.push_back({"growth_rate", spectrum.growth_rate});
      stable = verdict(spectrum.known, spectrum.stable);
      columns["stable"].push_back(spectrum.known ? double(spectrum.stable) : std::nan(""));
    }
    Json object = Json::object();
    for (const auto& [key, value] : row) {
      object[key] = value;
      columns[key].push_back(value);
    }
    object["fold"] = point.fold;
    object["stable"] = stable;
    columns["fold"].push_back(point.fold);
    points.push_back(object);
  }
  summary.set("branch", Json::object({{"parameter", name}, {"points", points}, {"end", branch.end}}));
  const std::map<std::string, Field> fields = {
      {"value", {"branch/value", "1", name}},
      {"speed", {"branch/speed", "length/time", "speed of the train"}},
      {"length", {"branch/length", "length", "length of the ring"}},
      {"period", {"branch/period", "time", "period"}},
      {"psi_min", {"branch/psi_min", "length/time", "least psi"}},
      {"psi_max", {"branch/psi_max", "length/time", "largest psi"}},
      {"fold", {"branch/fold", "1", "1 where the parameter has just turned round"}},
      {"stable",
       {"branch/stable", "1", "1 where the train is stable on its ring, nan where it is not known"}},
      {"growth_rate", {"branch/growth_rate", "1/time", "largest growth rate on the ring"}}};
  for (const auto& [key, values] : columns) file.add(fields.at(key), {"branch/point"}, values);
  file.attribute("branch_parameter", name);
  file.attribute("branch_end", branch.end);
}

void describe(Summary& summary, const Options& options, const Branch& branch) {
  int folds = 0;
  for (const BranchPoint& point : branch.points) folds += point.fold;
  summary.say("branch in " + options.text("wave_continue") + ": " + std::to_string(branch.points.size()) +
              " points, " + std::to_string(folds) + (folds == 1 ? " fold; " : " folds; ") + branch.end);
}

}  // namespace

int wave_command(const Options& options) {
  const Provenance provenance = Provenance::of("wave", options.all());
  const OutputLock lock = check_outputs(options.text("out_file"), options.text("summary"));
  Summary summary(provenance, {"speed",          "length",
                               "pulses",         "period",
                               "psi_max",        "psi_min",
                               "residual",       "error_estimate",
                               "stable",         "eigenvalues",
                               "growth_rate",    "translation_error",
                               "complete",       "completeness_check",
                               "endless",        "branch",
                               "special",        "curves",
                               "shortest_pulse", "mesh_intervals"},
                  options.text("summary"));
  const TrainRequest request = train_request(options);
  check_branch(options);
  const Scene scene = Scene::from(options, true);
  check_train_scene(scene);
  return with_summary(summary, [&] {
    const Pulse pulse(options.text("progress"), "wave");
    summary.set("pulses", request.pulses);
    summary.set("shortest_pulse", shortest_pulse(scene));
    const Train train = solve_train(scene, request);
    check_unused_after_setup(options, "eps st bv ds");
    summary.set("speed", train.speed);
    summary.set("length", train.length);
    summary.set("period", train.period);
    summary.set("psi_max", train.psi_max);
    summary.set("psi_min", train.psi_min);
    summary.set("residual", train.residual);
    summary.set("error_estimate", train.error_estimate);
    summary.set("mesh_intervals", train.intervals());
    ResultFile file(PETSC_COMM_WORLD, options.text("out_file"), provenance);
    add_train(file, scene, train);
    describe(summary, train);
    if (options.boolean("wave_spectrum")) {
      const TrainSpectrum spectrum = train_spectrum(train, int(options.integer("spectrum_count")));
      add_spectrum(summary, file, spectrum);
      describe(summary, spectrum);
    }
    if (options.is_set("wave_continue")) {
      const Branch branch = continue_train(train_family(options, options.text("wave_continue")),
                                           options.real(options.text("wave_continue")),
                                           options.real("wave_to"), int(options.integer("wave_steps")));
      add_branch(summary, file, options, branch);
      describe(summary, options, branch);
      add_limits(summary, file, options, branch);
    }
    file.write();
    warn_unused_at_end(options);
    return 0;
  });
}

}  // namespace stickslip
