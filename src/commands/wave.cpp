// The command `wave`: a train of pulses, its stability, a branch of trains; to the summary, a file, and the
// terminal.
#include <fmt/format.h>

#include <cmath>

#include "commands/command.hpp"
#include "commands/problems.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/size.hpp"

namespace stickslip {

namespace {

struct BranchRow {
  BranchPoint point;
  std::optional<TrainSpectrum> spectrum;
};

// What is known, one after the other.
struct WaveResults {
  Scene scene;
  PetscInt pulses;
  std::optional<Train> train;
  std::optional<TrainSpectrum> spectrum;
  std::vector<BranchRow> branch;
  std::string parameter, parameter2,
      branch_end;  // of the branch; parameter2: "" where nothing is followed in it
  std::optional<std::vector<TrainLimit>> special;
  std::vector<TrainLimitCurve> curves;
};

Columns<Train> train_columns() {
  return {{"speed", "length/time", "speed of the train", &Train::speed},
          {"length", "length", "length of the ring", &Train::length},
          {"period", "time", "period", &Train::period},
          {"psi_min", "length/time", "least psi", &Train::psi_min},
          {"psi_max", "length/time", "largest psi", &Train::psi_max}};
}

Json known_stable(const TrainSpectrum& s) { return s.known ? Json(s.stable) : Json(); }
double known_rate(const TrainSpectrum& s) { return s.growth_known ? s.growth_rate : std::nan(""); }

// `with_spectrum`: the stability of every train of the branch is known too.
Table<BranchRow> branch_table(const std::string& parameter, bool with_spectrum) {
  using Row = const BranchRow&;
  const In where = with_spectrum ? In::both : In::summary;
  Columns<BranchRow> columns =
      Columns<BranchRow>{{"value", "1", parameter, [](Row r) { return r.point.value; }}} +
      of<BranchRow>([](Row r) -> const Train& { return r.point.train; }, train_columns()) +
      Columns<BranchRow>{
          {"fold", "1", "1 where the parameter has just turned round", [](Row r) { return r.point.fold; }},
          {"stable", "1", "1 where the train is stable on its ring, nan where it is not known",
           [](Row r) { return r.spectrum ? known_stable(*r.spectrum) : Json(); }, where}};
  if (with_spectrum)
    columns.push_back({"growth_rate", "1/time", "largest growth rate on the ring",
                       [](Row r) { return r.spectrum ? known_rate(*r.spectrum) : std::nan(""); }});
  return {"branch.points", "branch/", "branch/point", columns};
}

Table<TrainMode> mode_table() {
  using Row = const TrainMode&;
  return {"eigenvalues",
          "spectrum/",
          "spectrum/mode",
          {{"re", "1/time", "growth rate of the mode", [](Row m) { return m.lambda.real(); }},
           {"im", "1/time", "its frequency in the frame of the train", [](Row m) { return m.lambda.imag(); }},
           {"wavenumber", "1/length", "wavenumber of its Bloch factor", &TrainMode::wavenumber},
           {"resolved", "1", "1 where a finer mesh agrees", &TrainMode::resolved},
           {"residual", "1", "change on a finer mesh, relative", &TrainMode::residual, In::summary},
           {"bloch", "1", "Bloch number", &TrainMode::bloch, In::summary},
           {"translation", "", "the mode of a shift, always 0, which the rate leaves out",
            &TrainMode::translation, In::summary}}};
}

Columns<TrainLimit> limit_columns(const std::string& name, const std::string& name2) {
  const auto unit = [](const std::string& option) {
    return find_option(option) ? find_option(option)->unit : "";
  };
  return {
      {"kind", "1", "fold, hopf or zero", &TrainLimit::kind},
      {"value", unit(name), name, &TrainLimit::value},
      {"value2", unit(name2), name2,
       [two = !name2.empty()](const TrainLimit& limit) { return two ? Json(limit.value2) : Json(); }},
      {"frequency", "1/time", "of the mode that crosses, in the frame of the train", &TrainLimit::frequency},
      {"wavenumber", "1/length", "of its Bloch factor", &TrainLimit::wavenumber},
      {"bloch", "1", "Bloch number", &TrainLimit::bloch, In::summary},
      {"speed", "length/time", "speed of the train", &TrainLimit::speed, In::summary},
      {"length", "length", "length of the ring", &TrainLimit::length, In::summary},
      {"period", "time", "period", &TrainLimit::period, In::summary},
      {"leads", "1", "1 where no other mode grows", &TrainLimit::leads}};
}

Table<TrainLimit> special_table(const WaveResults& w) {
  return {"special", "", "", limit_columns(w.parameter, w.parameter2)};
}

// The points of all curves, one curve after the other.
struct CurvePoint {
  std::size_t curve;
  TrainLimit limit;
};
Table<CurvePoint> curve_table(const std::string& name, const std::string& name2) {
  return {"curves.points", "curves/", "curves/point",
          Columns<CurvePoint>{{"piece", "1", "number of the curve", &CurvePoint::curve, In::file}} +
              of<CurvePoint>(&CurvePoint::limit, limit_columns(name, name2))};
}

Json branch_of(const WaveResults& w) {
  if (w.branch.empty()) return {};
  return {{"parameter", w.parameter},
          {"points", list_of(branch_table(w.parameter, w.branch[0].spectrum.has_value()), w.branch)},
          {"end", w.branch_end}};
}

Json curves_of(const WaveResults& w) {
  if (w.parameter2.empty() || !w.special) return {};
  Json list = Json::array();
  for (const TrainLimitCurve& curve : w.curves)
    list.push_back({{"kind", curve.points.front().kind},
                    {"points", list_of(special_table(w), curve.points)},
                    {"end", curve.end}});
  return list;
}

Columns<TrainSpectrum> spectrum_columns() {
  using S = const TrainSpectrum&;
  return {{"stable", "", "with `-wave_spectrum`: on its ring; null: not known", known_stable},
          {"eigenvalues", "", "with `-wave_spectrum`: rightmost first",
           [](S s) { return list_of(mode_table(), s.modes); }},
          {"growth_rate", "1/time",
           "largest of them; null also if every other mode decays faster than short waves, and where the "
           "list is not complete",
           known_rate},
          {"growth_rate_at_least", "1/time", "where the list is not complete: the largest of those found",
           [](S s) { return s.growth_known ? std::nan("") : s.growth_rate; }},
          {"translation_error", "1/time", "how far the mode of a shift is from 0",
           &TrainSpectrum::translation_error},
          {"complete", "", "as in `spectrum`", &TrainSpectrum::complete},
          {"completeness_check", "", "as in `spectrum`", &TrainSpectrum::completeness_check},
          {"endless", "",
           "the same train on an infinite line: `stable`, `growth_rate`, `wavenumber`, `frequency`", [](S s) {
             return Json::object({{"stable", s.infinite_known ? Json(s.infinite_stable) : Json()},
                                  {"growth_rate", s.infinite_growth},
                                  {"wavenumber", s.infinite_wavenumber},
                                  {"frequency", s.infinite_frequency}});
           }}};
}

Columns<WaveResults> keys() {
  using W = const WaveResults&;
  const auto train = [](W w) -> const std::optional<Train>& { return w.train; };
  return of<WaveResults>(train, train_columns()) +
         Columns<WaveResults>{{"pulses", "1", "on the ring", &WaveResults::pulses},
                              {"shortest_pulse", "length", "length below which there is no pulse",
                               [](W w) { return shortest_pulse(w.scene); }}} +
         of<WaveResults>(
             train,
             Columns<Train>{
                 {"residual", "1", "of the collocation equations", &Train::residual},
                 {"error_estimate", "", "of the speed or the length, whichever was solved for",
                  &Train::error_estimate},
                 {"mesh_intervals", "1", "of the collocation, over one pulse", &Train::intervals}}) +
         of<WaveResults>(&WaveResults::spectrum, spectrum_columns()) +
         Columns<WaveResults>{
             {"branch", "",
              "with `-wave_continue`: the `parameter`, the `points`, and how it came to an `end`", branch_of},
             {"special", "",
              "with `-wave_continue`: its folds and, with `-wave_spectrum` or `-wave_continue2`, changes of "
              "stability",
              [](W w) { return w.special ? list_of(special_table(w), *w.special) : Json(); }},
             {"curves", "",
              "with `-wave_continue2`: each of them followed in that option: `kind`, `points` (as in "
              "`special`), `end`",
              curves_of}};
}

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
  add_scene(file, scene);
  file.attribute("speed", train.speed);
  file.attribute("length", train.length);
  file.attribute("pulses", double(train.pulses));
  file.attribute("period", train.period);
}

void describe(Summary& summary, const Train& train) {
  summary.say(
      fmt::format("train of {} pulse{} on a ring: speed V = {}, length L = {}, period T = {}",
                  train.pulses, train.pulses == 1 ? "" : "s", in_unit(train.speed, 12, "velocity", "speed"),
                  in_unit(train.length, 12, "length", "grid_length"), period_text(train.period, 12)));
  summary.say(
      fmt::format("solved for the {}, error below {:.2g}; psi from {:.10g} to {}; {} mesh intervals",
                  train.length_given ? "speed" : "length", train.error_estimate, train.psi_min,
                  in_unit(train.psi_max, 10, "velocity"), train.intervals()));
}

void describe(Summary& summary, const TrainSpectrum& spectrum) {
  if (std::isnan(spectrum.growth_bound)) return summary.say("stability: " + spectrum.completeness_check);
  const bool none = std::isnan(spectrum.growth_rate);
  const std::string rate =
      none ? ", every other mode at a growth rate below " + in_unit(spectrum.growth_bound, 6, "1/time")
           : fmt::format(", {} {}",
                         spectrum.growth_known ? "largest growth rate" : "a growth rate of at least",
                         in_unit(spectrum.growth_rate, 6, "1/time"));
  summary.say(spectrum.known ? fmt::format("on its ring: {}stable{} (translation mode: {:.2g})",
                                           spectrum.stable ? "" : "not ", rate, spectrum.translation_error)
                             : "on its ring: whether it is stable is not known" +
                                   (none ? "" : rate));
  summary.say(
      !spectrum.infinite_known ? "infinite train: whether it is stable is not known"
      : spectrum.infinite_stable
          ? "infinite train: stable to every wavelength"
          : fmt::format(
                "infinite train: not stable, growth rate {} at wavenumber {}, frequency {}",
                in_unit(spectrum.infinite_growth, 6, "1/time"),
                in_unit(spectrum.infinite_wavenumber, 6, "1/length", "wavenumber"),
                frequency_text(spectrum.infinite_frequency, 6)));
}

void describe(Summary& summary, const std::string& name, const TrainLimit& limit) {
  summary.say(fmt::format(
      "{} at {} = {:.10g}{}",
      limit.kind == "fold" ? "fold"
                           : fmt::format("stability changes ({}, Bloch number {})", limit.kind, limit.bloch),
      name, limit.value, limit.leads.value_or(true) ? "" : ", where other modes grow already"));
}

// With wave_spectrum, the stability of every train of the branch too.
Branch find_branch(const Options& options, WaveResults& results) {
  Pulse::stage("branch in " + results.parameter);
  Branch branch = continue_train(train_family(options, results.parameter), options.real(results.parameter),
                                 options.real("wave_to"), int(options.integer("wave_steps")));
  results.branch_end = branch.end;
  for (const BranchPoint& point : branch.points) results.branch.push_back({point, {}});
  if (!options.boolean("wave_spectrum")) return branch;
  Pulse::stage("stability along the branch");
  for (BranchRow& row : results.branch) {
    row.spectrum = train_spectrum(row.point.train, 4);
    beat("trains");
  }
  return branch;
}

void add_branch(Summary& summary, ResultFile& file, const WaveResults& results) {
  const auto& [name, rows] = std::tie(results.parameter, results.branch);
  add_rows(file, branch_table(name, rows[0].spectrum.has_value()), rows);
  file.attribute("branch_parameter", name);
  file.attribute("branch_end", results.branch_end);
  const auto folds = std::count_if(rows.begin(), rows.end(), [](const BranchRow& r) { return r.point.fold; });
  summary.say(fmt::format("branch in {}: {} points, {} fold{}; {}", name, rows.size(), folds,
                          folds == 1 ? "" : "s", results.branch_end));
}

// Where trains end and where their stability changes, with wave_continue2 followed in that option.
void find_limits(const Options& options, const Branch& branch, WaveResults& results) {
  const auto& [name, name2] = std::tie(results.parameter, results.parameter2);
  std::vector<std::string> notes;
  std::vector<TrainLimit> special;
  if (name2.empty()) {
    special =
        train_limits(train_family(options, name, name), branch, 0, options.boolean("wave_spectrum"), notes);
  } else {
    results.curves = train_limit_curves(train_family(options, name, name2), branch, options.real(name),
                                        options.real("wave_to"), options.real(name2),
                                        options.real("wave_to2"), int(options.integer("wave_steps")), notes);
    for (const TrainLimitCurve& curve : results.curves) special.push_back(curve.points.front());
  }
  for (const std::string& note : notes) warn(note);
  results.special = special;
}

void add_limits(Summary& summary, ResultFile& file, const WaveResults& results) {
  const auto& [name, name2] = std::tie(results.parameter, results.parameter2);
  std::vector<CurvePoint> points;
  for (std::size_t k = 0; k < results.special->size(); ++k) {
    describe(summary, name, (*results.special)[k]);
    if (name2.empty()) continue;
    const TrainLimitCurve& curve = results.curves[k];
    summary.say(fmt::format("  followed in {}: {} points; {}", name2, curve.points.size(), curve.end));
    for (const TrainLimit& limit : curve.points) points.push_back({k, limit});
  }
  if (!name2.empty()) file.attribute("branch_parameter2", name2);
  add_rows(file, curve_table(name, name2), points);
}

std::vector<TableText> tables() {
  const WaveResults none{{}, 1, {}, {}, {}, "the option's value", "that of the second option", {}, {}, {}};
  return {keys(), mode_table(), branch_table(none.parameter, true), special_table(none),
          curve_table(none.parameter, none.parameter2)};
}

int wave(const Options& options) {
  CommandRun run("wave", options, keys_of(keys()));
  Summary& summary = run.summary;
  const TrainRequest request = train_request(options);
  check_branch(options);
  const Scene scene = Scene::from(options, true);
  check_train_scene(scene);
  return run.search("the train", [&] {
    WaveResults results{scene,
                        request.pulses,
                        {},
                        {},
                        {},
                        options.text("wave_continue"),
                        options.text("wave_continue2"),
                        {},
                        {},
                        {}};
    const auto tell = [&] { set_keys(summary, keys(), results); };
    tell();
    results.train = solve_train(scene, request);
    check_unused_after_setup(options);
    tell();
    ResultFile file = run.file();
    add_train(file, scene, *results.train);
    describe(summary, *results.train);
    if (options.boolean("wave_spectrum")) {
      Pulse::stage("stability of the train");
      results.spectrum = train_spectrum(*results.train, int(options.integer("spectrum_count")));
      tell();
      add_rows(file, mode_table(), results.spectrum->modes);
      describe(summary, *results.spectrum);
    }
    if (options.is_set("wave_continue")) {
      const auto tell_branch = [&] {
        tell();
        if (!results.branch.empty()) add_branch(summary, file, results);
      };
      Branch branch;
      keeping_what_is_found([&] { branch = find_branch(options, results); }, tell_branch);
      tell_branch();
      run.end_at_signal(file);
      Pulse::stage("ends of trains and changes of their stability");
      find_limits(options, branch, results);
      tell();
      add_limits(summary, file, results);
    }
    file.write();
    warn_unused_at_end(options);
  });
}

}  // namespace

Command wave_command() {
  return {"wave", "solves for a train of pulses: speed or length, stability, branches", wave, false, tables};
}

TrainRequest train_request(const Options& options) {
  TrainRequest request{options.integer("wave_pulses"), options.real_if_set("wave_length"),
                       options.real_if_set("wave_speed")};
  if (bool(request.length) == bool(request.speed))
    throw UsageError(request.length
                         ? "wave_length and wave_speed are both set: exactly one of the two is needed"
                         : "wave_length or wave_speed is needed: exactly one of the two");
  return request;
}

void check_branch(const Options& options) {
  check_continuation(options, "wave");
  check_continuation(options, "wave", "2");
  for (const char* asked : {"wave_continue", "wave_continue2"})
    if (options.is_set(asked) && options.text(asked) == "model_nu")
      throw UsageError(std::string(asked) +
                       " model_nu: trains are solved for without viscosity between neighbours");
  if (!options.is_set("wave_continue2")) return;
  const std::string name = options.text("wave_continue"), name2 = options.text("wave_continue2");
  if (!options.is_set("wave_continue"))
    throw UsageError("wave_continue2 " + name2 + ": needs wave_continue: limits are found on a branch first");
  if (name == name2) throw UsageError("wave_continue2 " + name2 + ": is wave_continue already");
}

TrainFamily train_family(const Options& options, const std::string& name) {
  return {name, [options, name](double value) {
            const Options here = options.with(name, value);
            return TrainCase{Scene::from(here, true), train_request(here)};
          }};
}

TrainFamily2 train_family(const Options& options, const std::string& name, const std::string& name2) {
  return {name, name2, [options, name, name2](double value, double value2) {
            const Options here =
                name == name2 ? options.with(name, value) : options.with(name, value).with(name2, value2);
            return TrainCase{Scene::from(here, true), train_request(here)};
          }};
}

}  // namespace stickslip
