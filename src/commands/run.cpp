// The command `run`: advances a scene in time and writes frames, probes, series, checkpoints and the summary.

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/json_values.hpp"
#include "base/process.hpp"
#include "base/pulse.hpp"
#include "commands/command.hpp"
#include "commands/quantities.hpp"
#include "commands/run_session.hpp"
#include "output/measures.hpp"
#include "output/series.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/output/reader.hpp"
#include "stickslip/stability/boundary.hpp"
#include "stickslip/study/accuracy.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/study/size.hpp"
#include "study/lyapunov.hpp"
#include "study/step_audit.hpp"

namespace stickslip {

namespace {

// The options to run with: those of the checkpoint where there is a restart.
Options effective_options(const Options& options) {
  if (!options.is_set("restart")) return options;
  const Checkpoint checkpoint = read_checkpoint(options.text("restart"));
  if (checkpoint.header.git != git_revision())
    warn("restart '" + options.text("restart") + "': was written by revision " + checkpoint.header.git +
         " of this program, and this is " + git_revision() + "; the last digits may differ");
  std::map<std::string, std::string> given;
  for (const auto& [name, text] : checkpoint.texts)
    if (name.rfind("given.", 0) == 0) given[name.substr(6)] = text;
  Options resumed = options.resumed_from(given);
  insert_library_options(resumed);
  check_size(resumed, PETSC_COMM_WORLD);
  return resumed;
}

// Where the answer holds no error.
void say_jump(const std::optional<JumpAtEnd>& jump, Summary& summary) {
  if (!jump) return;
  summary.set("jump", Json::object({{"x", jump->x},
                                    {"height", jump->height ? Json(*jump->height) : Json()},
                                    {"from", jump->from},
                                    {"to", jump->to}}));
  summary.say(fmt::format("psi jumps at x = {:.3g}{}; the error is that of psi outside {:.4g} to {:.4g}",
                          jump->x, jump->height ? fmt::format(" by {:.3g}", *jump->height) : "", jump->from,
                          jump->to));
}

// A run for -accuracy: chosen, run, its error estimated; again with stricter settings where that was too
// large.
int run_to_accuracy(const Options& options, Summary& summary) {
  const double wanted = options.real("accuracy");
  AccuracyPlan plan(options, wanted);
  double runs_before = 0;  // of attempts that were not good enough
  for (int attempt = 1;; ++attempt) {
    const Options chosen = plan.options();
    std::optional<LibraryOptionsHeld> held(std::in_place, options, chosen);
    Progress(chosen.text("progress"), "")
        .tell(fmt::format("accuracy: {}; choosing took {} s", plan.what(),
                          number_text(std::round(1e5 * (plan.seconds() + runs_before)) / 1e5)));
    const double begin = largest_processor_seconds();
    Run run(chosen, Provenance::of("run", chosen.all()), plan.measure());
    const int code = run.advance(summary);
    const double seconds = largest_processor_seconds() - begin;
    const bool ended = code == 0 && summary.is_null("stopped_at");
    const Answer end = ended ? run.end() : Answer();
    const double estimate = ended ? plan.estimate(end) : NAN;
    const std::vector<double> value = ended ? plan.value(end) : std::vector<double>();
    summary.set("accuracy", Json::object({{"wanted", wanted},
                                          {"of", chosen.text("accuracy_of")},
                                          {"value", value.empty() ? Json() : Json(value)},
                                          {"chosen", plan.what()},
                                          {"method", plan.setting().method.name()},
                                          {"tolerance", plan.setting().tolerance},
                                          {"order", plan.setting().order},
                                          {"n", plan.setting().n},
                                          {"trials", plan.trials()},
                                          {"attempts", attempt},
                                          {"choosing_seconds", plan.seconds() + runs_before},
                                          {"step_seconds", run.step_seconds()},
                                          {"run_seconds", seconds}}));
    if (!ended) return code;
    summary.set("error_estimate", estimate);
    const bool again = plan.refusal().empty() && estimate > wanted && attempt < 5;
    if (!again) say_jump(plan.jump(), summary);
    if (!plan.refusal().empty())
      throw Failure(fmt::format("{}; best reached {:.2g}", plan.refusal(), estimate));
    if (estimate <= wanted) return 0;
    if (attempt == 5)
      throw Failure(fmt::format("accuracy {} was not reached: the error is about {} with {}",
                                options.text("accuracy"), number_text(estimate), plan.what()));
    held.reset();  // what was chosen is for that run alone
    try {
      plan.refine();
    } catch (const Failure&) {  // the answer stands
      say_jump(plan.jump(), summary);
      throw;
    }
    runs_before += run.step_seconds();
  }
}

const Json& of(const Summary& s, const char* key) { return s.get<Json>(key); }

std::string rounded(const Json& number, int digits = 4) { return rounded_text(number.get<double>(), digits); }

// What a rate means for what grows or decays with it.
std::string course_of(const Json& rate) {
  if (rate == 0) return "neither grow nor decay";
  return fmt::format("{} like exp({} t)", rate > 0 ? "grow" : "decay", rounded(rate, 3));
}

// A key of the summary that is there, with its unit.
std::string measured(const Summary& s, const char* key, const char* dimension, int digits = 4) {
  return in_unit(rounded(of(s, key), digits), dimension, key);
}

// A catalogue's first words.
std::string event_words(const Summary& s) {
  if (of(s, "events") == 0) return "no slip event";
  std::string text =
      fmt::format("{} slip events, the largest of moment {}, up to {} nodes", of(s, "events").dump(),
                  measured(s, "largest_moment", "length^2"), rounded(of(s, "largest_extent")));
  if (!s.is_null("b"))
    text += ", b = " + with_error(of(s, "b").get<double>(), of(s, "b_error").get<double>());
  return text;
}

std::string range_words(const Summary& s, const std::string& over) {
  if (s.is_null("psi_low")) return "";
  const Json& mean = of(s, "psi_loaded_mean");
  const auto size = [&](const char* key) { return std::abs(of(s, key).get<double>()); };
  const bool is_rest = !mean.is_null() && size("psi_low") == 0 && size("psi_high") == 0;  // but for rounding
  return fmt::format("psi {}from {} to {} over the last {}",
                     mean.is_null() ? "" : (is_rest ? "0" : rounded(mean)) + " in the mean, ",
                     rounded(of(s, "psi_low")), measured(s, "psi_high", "velocity"), over);
}

// Whether uniform motion that begins at rest goes on sticking and slipping.
bool sticks_from_rest(const Scene& scene) {
  if (!scene.nodes_alike() || scene.forced() || scene.massless() || !scene.friction.sticks() ||
      !(scene.K0() > 0) || scene.v == 0)
    return false;
  constexpr double tolerance = 1e-8;
  return distance_from_graze(cell_of(scene, scene.n), tolerance).distance < 0;
}

// What the motion is, and what steady sliding beside it would do.
std::string motion_words(const Summary& s, const Scene& scene) {
  const std::string regime = of(s, "regime").get<std::string>();
  const bool events = !s.is_null("events"), undecided = regime == "undecided";
  std::vector<std::string> parts;
  if (events) parts.push_back(event_words(s));
  if (scene.forced()) {
    parts.push_back(range_words(s, scene.forcing_period() > 0 ? "period of the load" : "quarter of the run"));
  } else if (!undecided) {
    parts.push_back(regime);
    if (regime == "stick-slip" && scene.friction.jumps_at_rest() && of(s, "rest_fraction") == 0)
      parts.push_back("though nothing rests");
    if (!s.is_null("period")) parts.push_back("period " + period_text(of(s, "period").get<double>(), 4));
    if (regime != "stuck")
      parts.push_back(range_words(s, s.is_null("period") ? "quarter of the run" : "period"));
  } else if (!events) {
    parts.push_back(regime);
    parts.push_back(range_words(s, "quarter of the run"));
    if (const Json& time = of(s, "time_to_decide"); !time.is_null())
      parts.push_back("a run to t = " + in_unit(rounded(time, 3), "time") + " should decide (-ts_max_time)");
  }
  parts.erase(std::remove(parts.begin(), parts.end(), ""), parts.end());
  std::string text = joined(parts);
  const Json &pulses = of(s, "pulses"), &speed = of(s, "wave_speed");
  if (!pulses.is_null() && pulses != 0) text += ", " + pulses.dump() + (pulses == 1 ? " pulse" : " pulses");
  if (!speed.is_null()) text += ", waves of speed " + measured(s, "wave_speed", "velocity");
  if (const Json& rate = of(s, "growth_rate"); !rate.is_null())
    text += fmt::format("; steady sliding is {}: perturbations {}", stability_word(rate.get<double>()),
                        course_of(rate));
  if (regime == "sliding" && sticks_from_rest(scene)) text += "; from rest it sticks and slips";
  return text;
}

// Which part of steps that are split is implicit.
std::string split_words(const std::string& method, const std::string& implicit) {
  if (method.rfind("arkimex", 0) != 0) return "";
  return implicit == "friction" ? " with friction implicit"
         : implicit == "wave"   ? " with waves implicit"
         : implicit == "both"   ? " with everything implicit"
                                : "";
}

// How it was computed.
std::string work_words(const Summary& s, const Scene& scene) {
  const std::string method = of(s, "method").get<std::string>();
  const Json& plate = of(s, "plate_time");
  std::string text = "t = " + measured(s, "t_end", "time", 6) +
                     (plate.is_null() ? "" : " (the plate's clock: " + rounded(plate, 6) + ")") + " in " +
                     of(s, "steps").dump() + " steps of " + method +
                     split_words(method, of(s, "implicit").get<std::string>()) + " (" +
                     of(s, "rejections").dump() + " rejected), " + of(s, "unknowns").dump() + " unknowns";
  if (const Json& error = of(s, "error_estimate"); !error.is_null())
    text += ", error about " + rounded(error, 2) +
            (scene.friction.jumps_at_rest() && scene.friction.regularised
                 ? ", without what smoothing over friction_eps changes (-friction_stick exact has none)"
                 : "");
  return text;
}

// What observers find, and what -accuracy says.
std::vector<SummaryKey> observed_keys() {
  return {
      {"probes", "", "at each of `out_probes`: `x`, and `psi`, `eta` at `t_end`, interpolated"},
      {"regime", "",
       "where the motion goes. `sliding`: steady sliding, or on the way to it; `stick-slip`: an oscillation "
       "that stays, with rests or without any (`rest_fraction`); `stuck`: permanently at rest; "
       "`decaying`, `growing`: an oscillation on its way down or up; `undecided`: the run was too short to "
       "tell"},
      {"regime_reason", "",
       "why `regime` says nothing: null but under a load (`load_v`, `load_normal`, the sines, "
       "`load_halt`)"},
      {"regime_rate", "1/time", "measured rate at which the size of the motion changes"},
      {"growth_rate", "1/time",
       "of perturbations of the steady sliding nearest, by linear theory: that of `spectrum`"},
      {"growth_rate_reason", "", "why there is none"},
      {"time_to_decide", "time", "a run to this time should decide; null where it is decided"},
      {"amplitude", "length/time", "half of the largest range of psi at any node, over `measured_over`"},
      RestFraction::key(),
      {"wave_speed", "length/time", "speed of what travels, negative to the left; null where nothing does"},
      {"pulses", "1", "fronts of one sign along the whole scene: upward ones in x, downward where v < 0"},
      {"psi_low", "length/time",
       "least psi at up to 128 nodes over the last period, under a sine load over its last period; without "
       "either over the last quarter of the run"},
      {"psi_high", "length/time", "largest psi there and then"},
      {"period", "time",
       "mean time between passages at nodes spread over the scene, where the motion repeats: all of them in "
       "the second half of the run, three or more, agree to a thousandth. With `out_probes`: mean time "
       "between upward passages of psi through v there (downward where v < 0), in the second half of the "
       "run; of several probes the mean. A passage counts after psi was short of v by a hundredth of |v| "
       "(for v = 0 of a 32nd of f0/sqrt(k0 m), gamma in the continuum). Null where a probe has fewer than "
       "two. To the fourth digit of `period_error`"},
      {"period_error", "time",
       "error of `period`, about: how far passages lie beside equal distances, and where steps are chosen by "
       "their error `ts_rtol` of it for each step in a period (with `accuracy` of the fields the time in "
       "which the plate makes up for such an error of the force); null with `accuracy_of` period, whose "
       "error is `error_estimate`"},
      {"measured_over", "time",
       "from when to when amplitude, speed and pulses were measured: the last quarter"},
      {"maxima", "length/time",
       "with `out_maxima`: the last maxima of psi there, in order, minima where v < 0 (of the motion in "
       "the plate's "
       "direction, as for its mirror image)"},
      {"maxima_period", "1", "after how many they repeat, 0: they do not ([Sweeps](sweep.md))"},
      {"maxima_prominence", "length/time",
       "by so much at least psi rises to each of them and falls from it: a thousandth of its range there, or "
       "ten "
       "tolerances of the steps if that is more"},
      {"stopped_at", "", "the option that ended a `stopped` run, and its value"},
      {"error_estimate", "", "with `-accuracy`: of psi and eta at the end, or of what `accuracy_of` names"},
      {"jump", "",
       "with `-accuracy` and data that do not fit one held end: psi jumps at `x` by `height` (behind less "
       "ahead; null once "
       "the jump has met the other end), and the error is that of psi outside `from` to `to` "
       "([Accuracy](accuracy.md#beside-a-jump))"},
      {"events", "1", "slip events that ended, with `out_events` ([Events](events.md))"},
      {"largest_moment", "length^2", "of them: the largest moment"},
      {"largest_extent", "1", "the most nodes that moved in one"},
      {"b", "1",
       "slope of their magnitudes, density ~ exp(-b magnitude), fitted on [M + 2, M + 5], M the most "
       "frequent magnitude, that of single blocks; null with fewer than 20 events there"},
      {"b_error", "1", "its standard error, were they independent"},
      {"recurrence", "time",
       "of slip events: times from the end of one to that of the next, of the whole `system`, and of a "
       "`node` "
       "from one in which it slips to the next, over all nodes; each with `count`, `mean` and `variation`, "
       "standard deviation over mean: 0 where they repeat, 1 where they come at random"},
      {"events_per_s", "1/s", "how many a second of wall clock"},
      {"lyapunov", "1/time",
       "with `lyapunov_count`: Lyapunov exponents, largest first: `value` (null: -infinity, a rest takes the "
       "direction "
       "away) and `error` ([Oscillations](oscillations.md#chaos-lyapunov-exponents-beside-a-run))"},
      {"lyapunov_largest", "1/time", "the first of them"},
      {"lyapunov_largest_error", "1/time", "its error"},
      {"lyapunov_dimension", "1",
       "dimension of Kaplan and Yorke that follows; null where the exponents measured do not reach as far"},
      {"lyapunov_dimension_error", "1", "its error"},
      {"lyapunov_divergence", "1/time",
       "mean divergence, which all exponents together add up to; null where a node came to rest"},
      {"accuracy", "",
       "with `-accuracy`: what was `wanted`, and `of` what; its `value` (psi and eta of a probe, or the "
       "number; null for "
       "fields); what was chosen and spent ([Accuracy](accuracy.md#accuracy-on-request))"}};
}

std::vector<SummaryKey> run_keys() {
  std::vector<SummaryKey> keys = keys_of(work_columns());
  for (const auto& more : {quantity_keys(), observed_keys()})
    keys.insert(keys.end(), more.begin(), more.end());
  for (const OwnObserver& own : own_observers()) keys.insert(keys.end(), own.keys.begin(), own.keys.end());
  return keys;
}

std::vector<TableText> tables() {
  return {run_keys(),
          {"series/", Series::fields()},
          {"events/", Catalogue::columns(true, true)},
          {"events/rupture/", Catalogue::rupture_columns()}};
}

int run_here(const Options& options) {
  CommandRun command("run", options, run_keys());
  Summary& summary = command.summary;
  return command.carry_out([&] {
    if (options.boolean("check")) {
      const bool chosen = options.is_set("accuracy") && !options.is_set("restart");
      const Options all = chosen ? AccuracyPlan(options, options.real("accuracy")).options() : options;
      const LibraryOptionsHeld held(options, all);
      return Run(all, command.provenance).check(summary);
    }
    const int code = options.is_set("accuracy") && !options.is_set("restart")
                         ? run_to_accuracy(options, summary)
                         : Run(options, command.provenance).advance(summary);
    const Scene scene = Scene::from(options, false);
    summary.say(motion_words(summary, scene));
    summary.say(work_words(summary, scene));
    if (!summary.is_null("psi_low"))
      say_beyond_table(options, of(summary, "psi_low").get<double>(), of(summary, "psi_high").get<double>(),
                       summary);
    if (const std::string text = lyapunov_words(summary); !text.empty()) summary.say(text);
    if (!summary.is_null("events") && options.is_set("out_file"))
      summary.say("to see the events: " + script_call("events") + " " + options.text("out_file"));
    return code;
  });
}

// Clusters are run by one rank.
int run(const Options& asked) {
  const Options options = effective_options(asked);
  if (options.is_set("accuracy_of") && !options.is_set("accuracy"))
    throw UsageError("accuracy_of " + options.text("accuracy_of") +
                     ": it says what -accuracy is wanted of, which is not set");
  return on_ranks_of(options, [&] {
    try {
      return run_here(options);
    } catch (const OneRankWorks&) {
    }
    return on_ranks(1, [&] { return run_here(options); });
  });
}

std::vector<OwnObserver>& registered() {
  static std::vector<OwnObserver> all;
  return all;
}

}  // namespace

const std::vector<OwnObserver>& own_observers() { return registered(); }

void register_observer(OwnObserver observer) {
  for (const auto& keys : {run_keys(), common_quantities()})
    for (const SummaryKey& there : keys)
      for (const SummaryKey& key : observer.keys)
        if (key.name == there.name) throw std::logic_error("two keys of a summary are called " + key.name);
  registered().push_back(std::move(observer));
}

Command run_command() { return {"run", "advances the scene in time", run, true, tables}; }

// What a run says of itself at its end (Run of run_session.hpp).

// Why it ended, and the exit code.
int Run::ending(Summary& summary) const {
  const std::string checkpoint = last_checkpoint_.empty() ? "" : "; checkpoint " + last_checkpoint_;
  const int signal = control_->signal();
  const std::string limit = signal                                  ? ""
                            : control_->wall_is_over()              ? "ts_max_wall"
                            : time_report().stop == Stop::max_steps ? "ts_max_steps"
                                                                    : "";
  if (!signal && limit.empty()) return 0;
  const std::string why =
      signal ? signal == SIGINT ? "SIGINT" : "SIGTERM" : limit + " " + options_.text(limit);
  summary.stopped(why + checkpoint);
  if (!signal) summary.set("stopped_at", why);
  const bool at_origin = origin_.resumed && time_report().t == origin_.t;
  const std::string from =
      last_checkpoint_.empty() && at_origin ? options_.text("restart") : last_checkpoint_;
  // The checkpoint holds the limit that has been reached; a clock begins anew.
  const std::string lifted = limit == "ts_max_steps" ? " -ts_max_steps unlimited" : "";
  summary.say(fmt::format("stopped at t = {:.6g} by {}; {}", time_report().t, why,
                          !from.empty() ? "to go on: stickslip run -restart " + shell_word(from) + lifted
                          : file_ ? "there is no checkpoint to go on from (-out_checkpoint_every)"
                                  : "without -out_file there is no checkpoint to go on from"));
  return signal ? 128 + signal : 0;
}

Columns<RunWork> work_columns(bool ran) {
  using W = const RunWork&;
  const Columns<RunWork> of_run = {
      {"t_end", "time", "where the run ended", [](W w) { return w.report.t; }},
      {"steps", "1", "steps accepted", [](W w) { return w.report.steps; }},
      {"plate_time", "time", "with `load_halt`: what the plate's clock shows then", &RunWork::plate_time},
      {"rejections", "1", "steps taken back for their error", &RunWork::rejections},
      {"rhs_evaluations", "1", "evaluations of the right-hand side, or of a part of it where steps are split",
       &RunWork::rhs_evaluations},
      {"clusters", "1",
       "where only what slides is advanced: most clusters at once, whose steps are counted then",
       &RunWork::clusters},
      {"clusters_reason", "",
       "where friction sticks exactly: null, or why each step is one of the whole medium",
       [](W w) { return w.no_clusters.empty() ? Json() : Json(w.no_clusters); }},
      {"node_steps", "1", "then: steps, each times the nodes of its cluster", &RunWork::node_steps}};
  return (ran ? of_run : Columns<RunWork>()) +
         Columns<RunWork>{
             {"method", "", "type and tableau, `rk:5dp`", [](W w) { return w.report.method; }},
             {"implicit", "", "what is solved for: `none`, `friction`, `wave`, `both`",
              [](W w) { return to_string(w.report.implicit); }},
             {"unknowns", "1", "numbers advanced in time", &RunWork::unknowns},
             {"reduced", "", "null, or the smaller problem that was solved for the scene, and why",
              &RunWork::reduced}};
}

RunWork Run::work() const {
  const TimeReport& r = time_report();
  RunWork work{r, rejections(), rhs_evaluations(), problem_.model.unknowns(), problem_.what};
  work.no_clusters = no_clusters_;
  if (halts(scene_)) work.plate_time = plate_.at(r.t);
  if (clusters_) {
    work.clusters = clusters_->most_at_once();
    work.node_steps = clusters_->node_steps();
  }
  return work;
}

void Run::report(Summary& summary, bool complete) {
  const TimeReport& r = time_report();
  set_keys(summary, work_columns(), work());
  if (file_ && file_->frames() > 0) summary.wrote(options_.text("out_file"));
  summary.wrote(last_checkpoint_);
  if (options_.is_set("snes_mf") && rejections() > std::int64_t(r.steps) / 4)
    warn(
        fmt::format("-snes_mf: {} steps were taken back beside {} accepted: without a matrix there is no "
                    "preconditioner, and GMRES does not come to the end of Newton's linear equations; "
                    "-snes_fd takes differences, too, and solves directly",
                    rejections(), r.steps));
  if (complete) {
    problem_.model.set_time(r.t);
    problem_.model.set_held(problem_.u);
    if (CarriedFrame* next = CarriedFrame::innermost()) next->keep(problem_.model, scene_, problem_.u, r.t);
    std::optional<StepAudit::Verdict> verdict;  // of every step
    if (!clusters_) verdict = step_audit_->verdict(problem_.u);
    const NearestGrowth near = nearest_growth(problem_.model, verdict ? *verdict : sound_, rhs_evaluations());
    regime_->know(near.growth, near.taken, near.why_not, near.beyond);
    for (const auto& observer : observers_) observer->summarise(summary, problem_.u);
    warn_of_answer(verdict, r.t);
  } else {
    for (const auto& observer : observers_) observer->summarise(summary, nullptr);
  }
}

// What in the answer cannot be believed.
void Run::warn_of_answer(const std::optional<StepAudit::Verdict>& verdict, double duration) {
  const Measured& m = regime_->result(problem_.u);
  if (!problem_.what.empty()) {
    const double psi_mean = statistics(problem_.model, problem_.u).psi_mean;
    std::string broken;
    if (rank_in(PETSC_COMM_WORLD) == 0)
      broken = broken_symmetry(scene_, problem_.model.scene(), m, psi_mean, duration);
    broadcast(broken);
    if (!broken.empty()) warn(broken);
  }
  if (verdict) step_audit_->warn_of(*verdict, m.motion);
  // A front of four or more nodes changes by at most a third of its height from node to node.
  if (scene_.form == Form::continuum && m.steepest > 0.34)
    warn("a front is not resolved: psi changes by " + std::to_string(std::lround(100 * m.steepest)) +
         " % of its range between two neighbouring nodes; wave speeds and heights depend on the grid (raise "
         "grid_n)");
}

}  // namespace stickslip
