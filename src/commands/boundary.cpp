// The command `boundary`: where steady sliding loses stability, and where the stick-slip beside it ends, in
// one option or two.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "commands/command.hpp"
#include "commands/problems.hpp"
#include "options/values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/regime.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/stick_slip_end.hpp"
#include "stickslip/study/verify.hpp"
#include "study/forced_boundary.hpp"

namespace stickslip {

namespace {

// An axis from the options boundary_parameter, _from, _to, _log (suffix "" or "2").
Axis axis_from(const Options& options, const std::string& suffix) {
  const std::string parameter = "boundary_parameter" + suffix;
  Axis axis;
  axis.name = real_option("-" + parameter, options.text(parameter),
                          "the boundary is sought in a real option, such as model_v")
                  .name;
  for (const char* end : {"boundary_from", "boundary_to"})
    if (!options.is_set(end + suffix))
      throw UsageError("-" + std::string(end) + suffix + " is needed: the range of " + axis.name);
  axis.from = options.real("boundary_from" + suffix);
  axis.to = options.real("boundary_to" + suffix);
  axis.logarithmic = options.boolean("boundary_log" + suffix);
  if (axis.from == axis.to)
    throw UsageError("-boundary_to" + suffix + " " + options.text("boundary_to" + suffix) +
                     ": the range of " + axis.name + " is empty");
  if (axis.logarithmic && !(axis.from > 0 && axis.to > 0))
    throw UsageError("-boundary_log" + suffix + " true: needs positive ends of the range of " + axis.name);
  return axis;
}

std::vector<Axis> axes_from(const Options& options) {
  if (!options.is_set("boundary_parameter"))
    throw UsageError("-boundary_parameter is needed: a real option to vary, such as model_v");
  std::vector<Axis> axes{axis_from(options, "")};
  for (const std::string& name : options.words("boundary_same"))
    axes[0].same.push_back(real_option("-boundary_same", name, "what goes along is a real option too").name);
  if (options.is_set("boundary_parameter2")) {
    axes.push_back(axis_from(options, "2"));
    if (axes[0].name == axes[1].name)
      throw UsageError("-boundary_parameter2 " + axes[1].name + ": is boundary_parameter already");
  } else {
    for (const char* name : {"boundary_from2", "boundary_to2"})
      if (options.is_set(name)) throw UsageError("-" + std::string(name) + ": without boundary_parameter2");
  }
  return axes;
}

// A method that damps, with steps so long that it makes a growing mode decay: backward Euler does when
// dt > 2 Re(lambda)/|lambda|^2. The checks use a method of their own; the user's runs would not.
void warn_of_damping(const Options& options, const std::vector<Verified>& verified,
                     const std::vector<Crossing>& points) {
  const auto given = [&](const char* name) {
    return options.is_set(name) ? options.text(name) : std::string();
  };
  const std::string type = given("ts_type"), dt_text = given("ts_dt");
  const bool damps =
      type == "beuler" || type == "bdf" || (type == "theta" && given("ts_theta_theta") != "0.5");
  if (!damps || dt_text.empty() || points.empty()) return;
  const double dt = std::strtod(dt_text.c_str(), nullptr);
  const double frequency = points.front().frequency;
  for (const Verified& v : verified) {
    const double limit = 2 * v.growth / (v.growth * v.growth + frequency * frequency);
    if (v.growth > 0 && dt > limit) {
      warn("-ts_type " + type + " with -ts_dt " + dt_text + " would hide the instability at " +
           number_text(v.value) + ": it damps a mode that grows when the step is above " +
           number_text(limit) + "; the checks here use a method of their own");
      return;
    }
  }
}

// Checks of some points by time integration, and what they say that the points do not.
void verify(GrowthRate& growth, StickSlipEnd& end, const Options& options, FoundBoundary& found) {
  const PetscInt checks = options.integer("boundary_verify");
  if (checks == 0) return;
  const auto shown = [&](std::size_t number, std::size_t all) {
    Pulse::stage("check " + std::to_string(number + 1) + " of " + std::to_string(all) + " in time");
    beat("checks");
  };
  found.verified = verify_boundary(growth, options, found.sliding, checks, shown);
  warn_of_damping(options, found.verified, found.sliding);
  const auto at = [&](const Verified& v) { return growth.axes()[0].name + " " + number_text(v.value); };
  const auto ended = [](const std::string& motion) {
    return motion == to_string(Motion::undecided) ? " is undecided in its time or a million steps"
                                                  : " ends in " + motion;
  };
  for (const Verified& v : found.verified)
    if (v.from_sliding != v.expected)
      warn("time integration from slightly perturbed sliding at " + at(v) + ended(v.from_sliding) +
           " where the growth rate " + number_text(v.growth) + " says " + v.expected);
  if (found.cell) return;  // a flip or a torus changes no word of a run
  for (const Verified& v : verify_end(growth, end, options, found.stick_slip, checks, shown)) {
    if (v.from_stick_slip != v.expected)
      warn("time integration of uniform motion from the cycle at " + at(v) + ended(v.from_stick_slip) +
           " where the end of stick-slip says " + v.expected);
    found.verified.push_back(v);
  }
}

std::string at_ends(GrowthRate& growth) {
  const Axis& axis = growth.axes()[0];
  return "growth rate " + number_text(growth(0)) + " at " + axis.name + " " + number_text(axis.from) + ", " +
         number_text(growth(1)) + " at " + number_text(axis.to);
}
// Where beside the range, on either side, the growth rate is 0 or its sign another one than in it; towards a
// value of 0 by halves.
std::string change_beyond(GrowthRate& growth, double rate) {
  const Axis& axis = growth.axes()[0];
  const auto changed = [&](double x) {
    try {
      return growth(x) * rate <= 0;
    } catch (const Error&) {  // no value that the option takes
      return false;
    }
  };
  std::string text;
  double reach[2];
  for (const int side : {0, 1}) {
    double last = side;
    for (const double away : {.125, .25, .5, 1., 2., 4.}) {
      double x = side == 0 ? -away : 1 + away;
      const double value = axis.value(last);
      if (axis.value(x) * value <= 0) x = (value / 2 - axis.from) / (axis.to - axis.from);
      if (changed(x)) {
        const auto [low, high] = std::minmax({axis.value(x), value});
        text += fmt::format("{} {} {}, between {} and {}", text.empty() ? "; it changes" : ", and",
                            (axis.from < axis.to) == (side == 0) ? "below" : "above",
                            number_text(axis.value(side)), number_text(low), number_text(high));
        break;
      }
      last = x;
    }
    reach[side] = axis.value(last);
  }
  if (!text.empty()) return text;
  return "; no change was seen from " + number_text(reach[0]) + " to " + number_text(reach[1]) + " either";
}

[[noreturn]] void fail_without_points(GrowthRate& growth, const Samples& samples) {
  const Axis& axis = growth.axes()[0];
  if (growth.axes().size() == 1) {
    const double first = growth(0), last = growth(1);
    const bool changes = first * last < 0;
    std::string why = ": " + at_ends(growth);
    if (first * last > 0 && first != last)
      why = std::string(": sliding is ") + stability_word(first) + " throughout" + why +
            change_beyond(growth, first);
    throw Failure("no boundary " + std::string(changes ? "that the grid resolves (grid_n) " : "") +
                  "between " + axis.name + " " + number_text(axis.from) + " and " + number_text(axis.to) +
                  why);
  }
  const auto [low, high] = std::minmax_element(samples.growth.begin(), samples.growth.end());
  throw Failure("no boundary in the box: the growth rate stays between " + number_text(*low) + " and " +
                number_text(*high));
}

// Throws Failure where sliding has no point.
void find_sliding(const Options& options, GrowthRate& growth, FoundBoundary& found) {
  const bool two = growth.axes().size() > 1;
  if (!two && !growth.enters())
    throw Failure(
        "-boundary_parameter " + growth.axes()[0].name + ": does not enter " +
        (options.text("boundary_of") == "sliding" ? "this scene: " : "the growth rate of sliding: ") +
        at_ends(growth));
  found.sliding = two ? boundary_curve(growth, options.integer("boundary_points"), found.findings)
                      : boundary_points(growth, found.findings);
  if (std::any_of(found.sliding.begin(), found.sliding.end(),
                  [](const Crossing& c) { return c.complete && !*c.complete; }))
    warn(
        "modes that were not followed grow already on the boundary found (points with `complete` false): "
        "it lies further on the stable side there");
  if (!found.sliding.empty()) return;
  for (const std::string& note : found.findings.notes) warn(note);  // where it is 0, or jumps
  found.findings.notes.clear();
  fail_without_points(growth, found.findings.samples);
}

// Several nodes, or the whole scene, whose own cycle is asked about.
bool of_cell(const Options& options) { return options.integer("cycle_cell") != 1; }

CellMotion cell_motion(const Options& options, const std::vector<Axis>& axes) {
  if (!of_cell(options)) return {};
  const auto at = [options, axes](double value, double value2) {
    return options_with(options, axes, value, value2);
  };
  return {[at](double value, double value2) { return cell_of_options(at(value, value2)); },
          [at](double value, double value2) {
            const Options there = at(value, value2);
            return start_of_cell(there, cell_of_options(there));
          }};
}

void find_stick_slip(const Options& options, StickSlipEnd& end, bool two, FoundBoundary& found) {
  std::vector<std::string>& notes = found.findings.notes;
  found.cell = of_cell(options);
  found.stick_slip = two ? end.curve(options.integer("boundary_points"), notes) : end.points(notes);
  found.distances = end.samples();
}

void find_medium(const Options& options, const std::vector<Axis>& axes, FoundBoundary& found) {
  MediumLines lines(scene_of(options, axes), axes, options.integer("wave_pulses"),
                    [] { beat("oscillations and branches of trains"); });
  found.waves = lines.waves(options.integer("boundary_points"), found.findings.notes);
  found.wave_growth = lines.growth();
  found.trains = lines.trains(options.integer("boundary_points"), found.findings.notes);
  found.train_samples = lines.samples();
}

// Whose end is asked for: sliding's, stick-slip's. Stick-slip's is left out where it was not asked for by
// name and the scene has none of the kind that is solved for.
struct Asked {
  bool sliding, stick_slip, medium = false;  // medium: waves on the uniform oscillation, and trains
  std::string refusal = {};                  // why stick-slip is left out, and what would tell
};
Asked asked_for(const Options& options, const Scene& scene) {
  const std::string of = options.text("boundary_of");
  if (of == "sliding") return {true, false};
  if (of == "all") {
    const std::string refusal = of_cell(options)                         ? "cycle_cell is one node's for it"
                                : !options.is_set("boundary_parameter2") ? "boundary_parameter2 is needed"
                                                                         : MediumLines::refusal(scene);
    if (!refusal.empty()) throw UsageError("-boundary_of all: " + refusal);
    return {true, true, true};
  }
  if (of_cell(options)) {
    check_cycle_options(options, cell_of_options(options));
    return {of == "both", true};
  }
  const std::string refusal = StickSlipEnd::refusal(scene);
  if (!refusal.empty() && options.is_set("boundary_of"))
    throw UsageError("-boundary_of " + of + ": needs uniform motion: " + refusal);
  if (refusal.empty()) return {of == "both", true};
  return {true, false, false,
          "stick-slip is left out, as " + refusal + "; -cycle_cell asks about that of a cell"};
}

// Under a load that repeats: the end of its slide alone.
void check_forced(const Options& options, const Scene& scene) {
  const std::string of = options.text("boundary_of");
  if (options.is_set("boundary_of") && of != "sliding")
    throw UsageError("-boundary_of " + of + ": under a load the end of sliding alone is looked for");
  if (options.integer("boundary_verify") > 0)
    throw UsageError(
        "-boundary_verify: checks steady sliding, and under a load nothing is steady; leave it off");
  if (scene.massless())
    throw UsageError("-model_m 0: the slide under a load is solved for with mass; `run` takes 0");
  if (springless(scene))
    throw UsageError("model_k0 0: nothing pulls the slide back to the load's motion");
  if (!scene.nodes_alike() || scene.any_held()) check_smooth_cell(scene);
}

void find_forced(CommandRun& run, const GrowthRate& scenes) {
  const Options& options = run.options;
  const std::vector<Axis>& axes = scenes.axes();
  const bool two = axes.size() > 1;
  Pulse::stage("end of sliding under the load");
  ForcedBoundary growth(scene_of(options, axes), axes);
  growth.watch([] { beat("slides"); });
  check_unused_after_setup(options);
  FoundBoundary found;
  found.axes = axes;
  const auto tell = [&] {
    found.evaluations = growth.evaluations();
    set_keys(run.summary, boundary_keys(), found);
  };
  keeping_what_is_found(
      [&] {
        found.sliding = two ? growth.curve(options.integer("boundary_points"), found.findings)
                            : growth.points(found.findings);
      },
      tell);
  tell();
  for (const std::string& note : found.findings.notes) warn(note);
  if (found.sliding.empty()) {
    const double middle = growth(0.5, 0.5);
    throw Failure("no boundary of sliding under the load: in the middle of the range " +
                  (std::isnan(middle) ? "there is none, " + growth.why_not()
                                      : "its growth rate is " + number_text(middle)));
  }
  write_file(run, scenes, found);
  if (options.text("summary") != "-") print_points(axes, found.sliding);
  if (!two)
    describe_sliding(run.summary, "sliding under the load is", [&](double x) { return growth(x); }, found);
}

// What a search that a signal ended has found.
std::string count_text(const FoundBoundary& found) {
  std::string text = fmt::format("{} points where sliding ends, {} where stick-slip ends",
                                 found.sliding.size(), found.stick_slip.size());
  if (!found.waves.empty()) text += fmt::format(", {} lines of waves", found.waves.size());
  return text;
}

bool lives_everywhere(const FoundBoundary& found) {
  return found.axes.size() == 1 && !found.distances.empty() &&
         std::all_of(found.distances.begin(), found.distances.end(), [](double f) { return f < 0; });
}

void find_boundary(CommandRun& run, GrowthRate& growth, const Asked& asked) {
  const Options& options = run.options;
  Summary& summary = run.summary;
  const bool two = growth.axes().size() > 1;
  const std::vector<Axis>& axes = growth.axes();
  const std::unique_ptr<StickSlipEnd> found_end =
      StickSlipEnd::of(scene_of(options, axes), axes, cell_motion(options, axes));
  StickSlipEnd& end = *found_end;
  growth.watch([] { beat("growth rates"); });
  end.watch([] { beat("stick-slip motions"); });
  FoundBoundary found;
  found.axes = axes;
  const auto tell = [&] {  // as far as it is known: what a signal or a failure leaves
    found.evaluations = growth.evaluations() + end.evaluations();
    set_keys(summary, boundary_keys(), found);
  };
  std::string no_sliding;
  const auto search = [&] {
    Pulse::stage("end of sliding");
    try {
      if (asked.sliding) find_sliding(options, growth, found);
    } catch (const Failure& failure) {
      if (!asked.stick_slip && asked.refusal.empty()) throw;
      no_sliding = failure.what();
    }
    check_unused_after_setup(options);
    if (asked.sliding) tell();
    Pulse::stage("end of stick-slip");
    if (asked.stick_slip) find_stick_slip(options, end, two, found);
    if (asked.medium) {
      tell();
      find_medium(options, axes, found);
    }
    tell();
  };
  keeping_what_is_found(search, [&] {
    tell();
    summary.say(count_text(found));
  });
  const std::vector<Crossing> points = found.points();
  for (const std::string& note : found.findings.notes) warn(note);
  if (points.empty()) {
    const std::string what =
        !end.unfinished().empty() ? end.unfinished()
        : !asked.refusal.empty() ? asked.refusal
        : !found.cell && lives_everywhere(found)
            ? fmt::format("uniform motion can stick and slip at every {} from {} to {}: stick-slip does not "
                          "end in this range",
                          axes[0].name, number_text(axes[0].from), number_text(axes[0].to))
        : !found.cell && end.lives_nowhere()
            ? "uniform motion sticks and slips nowhere between the bounds of the axes: in their middle it " +
                  end.fate(0.5, 0.5)
            : std::string(found.cell ? "the cell's" : "uniform") +
                  " stick-slip does not end between the bounds of the axes, unless at a Hopf point of "
                  "sliding";
    throw Failure(no_sliding + (no_sliding.empty() ? "" : "; ") + what);
  }
  if (!no_sliding.empty()) summary.say(no_sliding);
  if (!asked.refusal.empty()) summary.say(asked.refusal);
  keeping_what_is_found([&] { verify(growth, end, options, found); },
                        [&] { describe(summary, growth, found); });
  found.checked = options.integer("boundary_verify") > 0;
  set_keys(summary, boundary_keys(), found);
  write_file(run, growth, found);
  const bool is_table = growth.axes().size() > 1;
  if (options.text("summary") != "-" && !(is_table && run.has_file())) print_points(growth.axes(), points);
  describe(summary, growth, found);
}

int boundary(const Options& options) {
  CommandRun run("boundary", options, keys_of(boundary_keys()));
  const std::vector<Axis> axes = axes_from(options);
  const auto varied = [&](const std::vector<Axis>& along) {
    return GrowthRate(PETSC_COMM_WORLD, scene_of(options, along), along,
                      options.text("spectrum_refine") != "off");
  };
  std::optional<GrowthRate> growth;
  std::string foreign;
  try {
    growth.emplace(varied(axes));
  } catch (const ForeignOption& error) {  // unless the scene itself is at fault
    foreign = error.what();
    growth.emplace(varied({}));
  }
  const bool forced = growth->scene(0.5, 0.5).forced();
  if (forced) check_forced(options, growth->scene(0.5, 0.5));
  const Asked asked = forced ? Asked{true, false} : asked_for(options, growth->scene(0.5, 0.5));
  return run.search("", [&] {
    if (!foreign.empty())
      throw Failure("-boundary_parameter " + axes[0].name + ": does not enter this scene (" + foreign +
                    "): growth rate " + number_text((*growth)(0)) + " at both ends");
    if (forced)
      find_forced(run, *growth);
    else
      find_boundary(run, *growth, asked);
  });
}

}  // namespace

Command boundary_command() {
  return {"boundary",
          "where sliding loses stability, and where stick-slip ends, in one option or traced in two",
          boundary, true, boundary_tables};
}

}  // namespace stickslip
