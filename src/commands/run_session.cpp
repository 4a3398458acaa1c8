#include "commands/run_session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "commands/quantities.hpp"
#include "output/measures.hpp"
#include "output/series.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/size.hpp"
#include "stickslip/time/stick.hpp"
#include "study/lyapunov.hpp"
#include "study/simulate.hpp"
#include "study/step_audit.hpp"

namespace stickslip {

namespace {

// Whether rank 0 sees this file. Collective.
bool exists(const std::string& path) {
  bool there = access(path.c_str(), F_OK) == 0;
  broadcast(there);
  return there;
}

std::optional<Checkpoint> asked_for(const Options& options) {
  if (!options.is_set("restart")) return std::nullopt;
  return read_checkpoint(options.text("restart"));
}

UsageError not_whole(const Options& options, const std::string& why) {
  return UsageError("restart '" + options.text("restart") + "': is not a whole checkpoint: " + why);
}

// The grid that a checkpoint goes on with, whatever its start would now be reduced to.
std::optional<PetscInt> nodes_of(const std::optional<Checkpoint>& checkpoint, const Scene& scene,
                                 const Options& options) {
  if (!checkpoint) return std::nullopt;
  const auto nodes = checkpoint->numbers.find("nodes");
  if (nodes == checkpoint->numbers.end() || !(nodes->second >= 1 && nodes->second <= scene.n) ||
      std::fmod(scene.n, nodes->second) != 0)
    throw not_whole(options, "its nodes do not fit");
  return static_cast<PetscInt>(nodes->second);
}

Problem problem_for(const Scene& scene, const Options& options, const std::optional<Checkpoint>& checkpoint) {
  // A catalogue is that of all nodes, and deviations need not be alike where the nodes are.
  const bool whole = options.boolean("out_events") || options.integer("lyapunov_count") > 0;
  if (halts(scene) && options.integer("lyapunov_count") > 0)
    throw UsageError(
        "lyapunov_count: exponents are of a motion that is driven all the time; leave load_halt off");
  if (options.is_set("ts_max_plate") && !options.is_set("ts_max_time"))
    throw UsageError(
        "-ts_max_plate " + options.text("ts_max_plate") +
        ": it needs ts_max_time too, by which the run's own clock stops it at the latest and over "
        "which its frames are spread");
  if (options.is_set("ts_max_plate") && options.is_set("accuracy"))
    throw UsageError("-ts_max_plate: -accuracy is that of fields at ts_max_time, which must be the end");
  return problem_of(scene, whole ? options.with("scene_reduce", "off") : options,
                    nodes_of(checkpoint, scene, options));
}

// What PETSc's solvers keep from one step to the next is not in a checkpoint; what the methods keep they
// forget there.
void warn_of_memory(const Options& options) {
  for (const auto& [name, text] : options.library()) {
    static const std::set<std::string> always = {
        "snes_lag_jacobian_persists", "snes_lag_preconditioner_persists", "ksp_initial_guess_nonzero",
        "ksp_guess_type", "ksp_reuse_preconditioner"};
    const bool lags = (name == "snes_lag_jacobian" || name == "snes_lag_preconditioner") && text[0] == '-';
    const bool solver = name == "snes_type" && text != "newtonls" && text != "newtontr" && text != "ksponly";
    if (always.count(name) || lags || solver)
      warn("-" + name + (text.empty() ? "" : " " + text) +
           " keeps what the solver learnt in earlier steps, which is in no checkpoint: a continued run "
           "agrees with an uninterrupted one to the solver's tolerances, not to the last bit");
  }
}

// What PETSc would print on this rank goes nowhere.
void silence_library() {
  static std::FILE* const nowhere = std::fopen("/dev/null", "w");
  PETSC_STDOUT = nowhere;
}

}  // namespace

Run::Run(const Options& options, const Provenance& provenance, const MeasureMaker& measure)
    : Run(options, provenance, measure, asked_for(options)) {}

Run::Run(const Options& options, const Provenance& provenance, const MeasureMaker& measure,
         std::optional<Checkpoint> checkpoint)
    : options_(options), provenance_(provenance), scene_(Scene::from(options, false)),
      problem_(problem_for(scene_, options, checkpoint)), timed_(options.is_set("accuracy")) {
  control_.emplace(options, checkpoint ? checkpoint->step : 0);  // from here on signals are heard
  check_size_of_run(options, problem_.model, problem_.u);
  make_observers(measure, checkpoint);
  // Every rank solves alike, and one of them prints for -ts_monitor.
  if (problem_.model.comm() == PETSC_COMM_SELF && rank_in(PETSC_COMM_WORLD) != 0) silence_library();
  if (checkpoint) restore(*checkpoint);
  const double begin = spent();
  make_integrator(checkpoint);
  step_seconds_ = spent() - begin;
  if (!options.boolean("check")) open_file();
}

Answer Run::end() const {
  return {fields_of(problem_.model, problem_.u, scene_.n),
          measure_ ? measure_->values() : std::vector<double>()};
}

void Run::make_observers(const MeasureMaker& measure, const std::optional<Checkpoint>& checkpoint) {
  const Model& model = problem_.model;
  if (options_.boolean("out_displacement") && options_.is_set("out_file")) make_displacement(checkpoint);
  auto regime = std::make_unique<Regime>(model, options_.real("ts_max_time"), steady_velocity(model.scene()));
  regime_ = regime.get();
  observers_.push_back(std::move(regime));
  observers_.push_back(std::make_unique<RestFraction>(model, options_.real("ts_max_time")));
  for (auto& quantity : make_quantities(model)) observers_.push_back(std::move(quantity));
  for (const OwnObserver& own : own_observers()) observers_.push_back(own.make(model));
  if (options_.boolean("out_events")) {
    auto catalogue = std::make_unique<Catalogue>(model, event_velocity(options_, scene_, "out_events"),
                                                 options_.boolean("out_rupture"), plate_);
    catalogue_ = catalogue.get();
    observers_.push_back(std::move(catalogue));
  }
  if (options_.integer("lyapunov_count") > 0) {
    auto exponents = std::make_unique<LyapunovExponents>(model, options_);
    exponents_ = exponents.get();
    observers_.push_back(std::move(exponents));
  }
  const std::vector<double> probes = options_.reals("out_probes");
  observers_.push_back(std::make_unique<ProbeRows>(model, scene_, probes));
  if (!probes.empty()) {
    auto period = std::make_unique<Period>(model, scene_, probes, options_.real("ts_max_time"), false);
    period_ = period.get();
    observers_.push_back(std::move(period));
  }
  if (measure) {  // after the others, so that its number stands
    auto made = measure(model, scene_);
    measure_ = made.get();
    observers_.push_back(std::move(made));
  }
  if (options_.is_set("out_maxima")) {
    auto maxima =
        std::make_unique<Maxima>(model, scene_, options_.real("out_maxima"), options_.real("ts_max_time"));
    maxima_ = maxima.get();
    observers_.push_back(std::move(maxima));
  }
  if (!options_.is_set("out_file")) return;
  if (options_.boolean("out_series"))
    observers_.push_back(std::make_unique<Series>(model, scene_, displacement_.get(), plate_,
                                                  options_.integer("out_series_every")));
  // after the rows of the same moment
  observers_.push_back(std::make_unique<Frames>(model, scene_, options_, displacement_.get(), plate_));
}

// A run goes on as it began.
void Run::make_displacement(const std::optional<Checkpoint>& checkpoint) {
  displacement_ = std::make_unique<Displacement>(problem_.model, plate_);
  const double t_end = options_.real("ts_max_time");
  counts_displacement_ = Displacement::floats(problem_.model.scene()) ||
                         (checkpoint ? Travel::is_in(*checkpoint)
                                     : displacement_->count_is_better(problem_.u, t_end));
  if (counts_displacement_)
    observers_.push_back(std::make_unique<Travel>(problem_.model, *displacement_));
}

void Run::archive(Archive a, Origin& at, Vec state) {
  PetscInt nodes = problem_.model.scene().n;
  double t_end = options_.real("ts_max_time");
  a("state", state);
  a("rejections", at.rejections);
  a("rhs_evaluations", at.evaluations);
  a("nodes", nodes);
  a("t_end", t_end);
  a("longest_step", longest_step_);
  if (halts(scene_)) a("plate", plate_.t, plate_.time, plate_.goes);
  for (const auto& observer : observers_)
    if (observer.get() != measure_) observer->archive(a);
}

void Run::restore(const Checkpoint& checkpoint) {
  origin_ = {true, checkpoint.t, checkpoint.dt, checkpoint.step};
  try {
    archive(Archive::from(checkpoint, NodeRange::of(problem_.model)), origin_, problem_.u);
  } catch (const std::exception& e) {
    throw not_whole(options_, e.what());
  }
  const std::vector<double> state = local_values(problem_.u);
  const bool finite =
      std::all_of(state.begin(), state.end(), [](double value) { return std::isfinite(value); });
  if (on_any_rank(PETSC_COMM_WORLD, !finite)) throw not_whole(options_, "its state is not finite");
  const double t_end = options_.real("ts_max_time");
  if (origin_.t > t_end)
    throw UsageError("ts_max_time " + options_.text("ts_max_time") + " lies before the time " +
                     number_text(origin_.t) + " of checkpoint '" + options_.text("restart") + "'");
  const double plate_end = options_.is_set("ts_max_plate") ? options_.real("ts_max_plate") : HUGE_VAL;
  const std::string reached = origin_.t == t_end                               ? "ts_max_time"
                              : halts(scene_) && plate_.at(origin_.t) >= plate_end ? "ts_max_plate"
                              : origin_.step >= control_->most_steps()          ? "ts_max_steps"
                                                                                : "";
  if (!reached.empty())
    warn(fmt::format("restart '{}': this run is at its end already, {} {}; nothing is left to do",
                     options_.text("restart"), reached, options_.text(reached)));
}

void Run::limit_steps() {
  if (!origin_.resumed) {
    const double duration = options_.real("ts_max_time");
    longest_step_ = StepAudit::longest_near_sliding(problem_.model, *integrator_, problem_.u, duration);
  }
  if (!std::isfinite(longest_step_) || options_.is_set("ts_adapt_dt_max")) return;
  if (clusters_) return clusters_->limit_steps(longest_step_);
  TSAdapt adapt;
  double least, most;
  SS_TRY(TSGetAdapt(integrator_->ts(), &adapt));
  SS_TRY(TSAdaptGetStepLimits(adapt, &least, &most));
  if (!(longest_step_ > least && longest_step_ < most)) return;
  longest_anywhere_ = most;
  const bool holds = !origin_.resumed || limit_holds(problem_.u);
  SS_TRY(TSAdaptSetStepLimits(adapt, least, holds ? longest_step_ : most));
}

// What dies away in a massless chain does so the more slowly the more slowly blocks slide: a limit that was
// found for sliding says nothing of a hold.
bool Run::limit_holds(Vec u) const {
  return !problem_.model.scene().massless() || StepAudit::is_near_sliding(problem_.model, u);
}

void Run::follow_limit(Vec u) {
  if (longest_anywhere_ == 0 || !problem_.model.scene().massless()) return;
  TSAdapt adapt;
  double least, most;
  SS_TRY(TSGetAdapt(integrator_->ts(), &adapt));
  SS_TRY(TSAdaptGetStepLimits(adapt, &least, &most));
  SS_TRY(TSAdaptSetStepLimits(adapt, least, limit_holds(u) ? longest_step_ : longest_anywhere_));
}

// By which an error of the force as large as `accuracy` allows delays a passage: it takes the plate that long
// to make up for it. 0: without that option, or where it is of something else.
double Run::delay_of_passages() const {
  if (!options_.is_set("accuracy") || options_.text("accuracy_of") != "fields") return 0;
  const Scene& scene = problem_.model.scene();
  const SceneScales scales = scales_of(scene);
  const double loading =
      springless(scene) ? scales.least.eta * scales.rate : scene.averaged().K0() * scales.velocity;
  return options_.real("accuracy") / loading;
}

void Run::make_integrator(const std::optional<Checkpoint>& checkpoint) {
  integrator_ = std::make_unique<Integrator>(problem_.model, MethodSpec::from(options_), problem_.u);
  if (options_.is_set("ts_max_plate")) plate_.end = options_.real("ts_max_plate");
  integrator_->drive_by(plate_);
  if (origin_.resumed) integrator_->continue_from(origin_.step, origin_.dt);
  choose_clusters(checkpoint);
  limit_steps();
  if (integrator_->adaptive()) {
    const Tolerances& of_psi = integrator_->tolerances();
    const double delay = delay_of_passages();
    const double v = std::abs(problem_.model.scene().v);
    regime_->errors_up_to(of_psi.relative[0], of_psi.absolute[0] + of_psi.relative[0] * v, delay);
    if (period_) period_->errors_up_to({of_psi.relative[0], delay});
    if (maxima_) maxima_->errors_up_to(of_psi.absolute[0], of_psi.relative[0]);
    if (exponents_) exponents_->errors_up_to(of_psi.absolute[0]);
  }
  const bool is_explicit = integrator_->report().implicit == Implicit::none;
  check_unused_after_setup(options_, is_explicit ? "ts" : "ts snes ksp pc");
  std::vector<std::string> idle = options_.idle();
  if (is_explicit)
    for (const std::string& name : options_of_solvers(options_))
      idle.push_back("-" + name + " (" + integrator_->report().method + " solves no equations)");
  if (!idle.empty()) warn("without effect here: " + joined(idle));
  if (origin_.resumed || options_.is_set("out_checkpoint_every")) warn_of_memory(options_);
}

ObservationPlan Run::plan() {
  ObservationPlan plan;
  plan.after = origin_.resumed ? origin_.t : -1;
  if (options_.is_set("out_file")) plan.layout = run_layout(scene_);
  plan.by_clusters = plan.layout.tells_rows_later = clusters_ != nullptr;
  if (!problem_.what.empty()) plan.layout.texts["reduced"] = problem_.what;
  for (const auto& observer : observers_) observer->plan(plan);
  return plan;
}

void Run::open_file() {
  ObservationPlan plan = this->plan();
  const bool with_file = options_.is_set("out_file");
  integrator_->set_output_times([plan](double t) { return plan.next_time(t); });
  if (with_file) {
    std::optional<RunFile::Resume> resume;
    if (origin_.resumed && exists(options_.text("out_file")))
      resume = RunFile::Resume{options_.text("out_file"), origin_.t};
    file_ = std::make_unique<RunFile>(PETSC_COMM_WORLD, options_.text("out_file"), provenance_, plan.layout,
                                      resume);
  } else if (control_->wants_checkpoints()) {
    warn("out_checkpoint_every without out_file: no checkpoints are written");
  }
  for (const auto& observer : observers_) observer->start(file_.get());
}

int Run::check(Summary& summary) {
  const RunLayout layout = plan().layout;
  const double t_end = options_.real("ts_max_time"), begin = MPI_Wtime();
  double t = origin_.t, seconds = 0;
  std::int64_t steps = 0;
  const auto has_time = [&] {
    seconds = largest_over(PETSC_COMM_WORLD, MPI_Wtime() - begin);
    return seconds <= 1;
  };
  if (clusters_) {
    ClusterPlan plan = cluster_plan();
    plan.go_on = [&](std::int64_t, double) { return has_time(); };
    clusters_->advance(problem_.u, plan);
    t = clusters_->report.t;
    steps = clusters_->report.steps;
    has_time();
  } else {
    simulate(*integrator_, problem_.u, {origin_.t, t_end, control_->most_steps()}, {},
             [&](const Integrator::Step& step) {
               t = step.t;
               steps = step.index - origin_.step;
               return has_time() ? Integrator::Verdict::go_on : Integrator::Verdict::stop;
             });
  }
  const TimeReport& r = time_report();
  summary.set("status", "done");  // and no file was written
  set_keys(summary, work_columns(false), work());
  summary.say(fmt::format("checked: {} nodes, {} unknowns solved for{}; {}, implicit: {}", scene_.n,
                          problem_.model.unknowns(), problem_.what.empty() ? "" : " (" + problem_.what + ")",
                          r.method, to_string(r.implicit)));
  if (layout.frames > 0)
    summary.say(fmt::format("{} frames, {:.3g} MB in {}", layout.frames,
                            8e-6 * double(layout.frames) * (1 + double(layout.fields.size()) * scene_.n),
                            options_.text("out_file")));
  const double bytes = bytes_a_node(options_, problem_.model, problem_.u);
  summary.say(fmt::format("{:.3g} MB of memory beside the program's own, {:.4g} bytes a node",
                          1e-6 * bytes * problem_.model.scene().n, bytes));
  const double rest = t > origin_.t ? (t_end - t) / (t - origin_.t) : 0;
  summary.say(fmt::format("{} steps reach t = {:.6g} in {:.2g} s{}", steps, t, seconds,
                          rest > 0
                              ? fmt::format("; at that rate the whole run takes {:.2g} steps and {:.2g} s",
                                            double(steps) * (1 + rest), seconds * (1 + rest))
                              : ", which is the whole run without its output"));
  return 0;
}

// Clusters count on from those of their checkpoint.
std::int64_t Run::rejections() const {
  return clusters_ ? clusters_->report.rejections : origin_.rejections + integrator_->report().rejections;
}
long Run::rhs_evaluations() const {
  return clusters_ ? clusters_->report.rhs_evaluations
                   : origin_.evaluations + integrator_->report().rhs_evaluations;
}

int Run::advance(Summary& summary) {
  Progress progress(options_.text("progress"), "");
  if (!problem_.what.empty()) progress.tell("scene_reduce: " + problem_.what);
  try {
    if (clusters_)
      advance_clusters(progress);
    else
      advance_whole(progress);
  } catch (const RankFailure&) {
    throw;  // the others may not know of it, and closing the file takes all; it can be read as it is
  } catch (...) {
    if (file_) file_->close();
    report(summary, false);
    throw;
  }
  if (file_) file_->close();
  report(summary, true);
  return ending(summary);
}

// Every step is one of the whole medium.
void Run::advance_whole(Progress& progress) {
  const double t_end = options_.real("ts_max_time");
  step_audit_ = std::make_unique<StepAudit>(problem_.model, options_, *integrator_, origin_.t, t_end);
  warn_of_steps(problem_.model, *integrator_, problem_.u, t_end - origin_.t);
  const double begin = spent();
  double watching = 0;
  std::vector<Observer*> observers = {step_audit_.get()};
  for (const auto& observer : observers_) observers.push_back(observer.get());
  const TimeSpan span{origin_.t, t_end, control_->most_steps(), origin_.rejections,
                      timed_ ? &watching : nullptr};
  simulate(*integrator_, problem_.u, span, observers, [&](const Integrator::Step& step) {
    const Integrator::Verdict verdict = after(step);
    if (progress.due()) {
      const double part = (step.t - origin_.t) / (t_end - origin_.t);
      progress.show(fmt::format("t = {:.6g} of {:.6g} ({:.0f} %), step {}, dt {:.2g}{}", step.t, t_end,
                                100 * part, step.index, step.next_dt, progress.left(part)));
    }
    return verdict;
  });
  step_seconds_ += spent() - begin - watching;
}

Integrator::Verdict Run::after(const Integrator::Step& step) {
  follow_limit(step.u);
  const RunControl::Decision decision = control_->after(step.index, step.t, plate_ends_at(step.t));
  if (file_ && decision.checkpoint) write_checkpoint_at(step.index, step.t, step.next_dt, step.u);
  if (decision.stop) return Integrator::Verdict::stop;
  return file_ && decision.restart ? Integrator::Verdict::restart : Integrator::Verdict::go_on;
}

void Run::write_checkpoint_at(std::int64_t step, double t, double next_dt, Vec u) {
  control_->checkpoint_written();
  file_->flush();
  Checkpoint c;
  c.t = t;
  c.dt = next_dt;
  c.step = step;
  for (const auto& [name, text] : options_.given()) c.texts["given." + name] = text;
  const NodeRange nodes = NodeRange::of(problem_.model);
  // Also those of dense output within this step, which no report holds yet.
  const long evaluations =
      clusters_ ? rhs_evaluations() : origin_.evaluations + problem_.model.rhs_evaluations();
  Origin reached = {true, t, next_dt, step, rejections(), evaluations};
  Archive to = Archive::to(c, nodes);
  archive(to, reached, u);
  if (clusters_) clusters_->archive(to);
  last_checkpoint_ =
      write_checkpoint(options_.text("out_file"), options_.integer("out_checkpoint_keep"), provenance_, c,
                       NodeRange::of(problem_.model));
}

}  // namespace stickslip
