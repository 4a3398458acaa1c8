#include "study/simulate.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/output/run_file.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/study/start.hpp"
#include "stickslip/study/trial.hpp"
#include "stickslip/time/stick.hpp"
#include "study/step_audit.hpp"

namespace stickslip {

double event_velocity(const Options& options, const Scene& scene, const std::string& asked_by) {
  const bool sticks = Stick::applies_to(scene);
  if (scene.massless())
    throw UsageError(asked_by +
                     ": the sizes of events are measured with psi_t, which a chain without mass (model_m 0) "
                     "does not have; take a small model_m, or out_frames");
  if (options.is_set("out_events_velocity")) return options.real("out_events_velocity");
  if (scene.v == 0 && !sticks)
    throw UsageError(asked_by + ": with model_v 0 it needs out_events_velocity, above which a node moves");
  return sticks ? 0 : 2 * std::abs(scene.v);
}

void simulate(Integrator& integrator, Vec u, const TimeSpan& span, const std::vector<Observer*>& observers,
              const Integrator::Observer& asked) {
  const LogStage stepping("time stepping");
  const auto after = [&](const Integrator::Step& step) {
    beat("steps");
    const double begin = span.watching ? processor_seconds() : 0;
    const ObservedStep seen{
        step.index,      step.t_before, step.t, step.u, span.rejections + integrator.report().rejections,
        step.interpolate};
    // what goes on here saw it as its end, and of a step that took no time nobody is to be told but `asked`
    const bool takes_no_time = step.t == step.t_before && step.index > 0;
    if (!takes_no_time)
      for (Observer* observer : observers) observer->step(seen);
    const auto verdict = asked ? asked(step) : Integrator::Verdict::go_on;
    if (span.watching) *span.watching += processor_seconds() - begin;
    return verdict;
  };
  try {
    integrator.advance(u, span.begin, span.end, after, span.most_steps);
  } catch (const NotFinite& e) {
    throw NotFinite(e.what() + limit_in_words(integrator, span.end - span.begin));
  }
}

void carry_out(const Experiment& experiment, Vec u, Outcome& outcome) {
  const WarningsKept kept(outcome.warnings);
  const double begin = processor_seconds();
  if (!experiment.method.type.empty()) outcome.report.method = experiment.method.name();
  std::optional<Integrator> integrator;
  const auto run = [&] {
    integrator.emplace(experiment.model, experiment.method, u, experiment.prefix);
    const auto observers = experiment.watch ? experiment.watch(*integrator) : std::vector<Observer*>();
    simulate(*integrator, u, experiment.span, observers, [&](const Integrator::Step& step) {
      outcome.report = integrator->report();
      const bool on = !experiment.goes_on || experiment.goes_on(step, outcome);
      return on ? Integrator::Verdict::go_on : Integrator::Verdict::stop;
    });
    if (experiment.at_end) experiment.at_end(*integrator);
  };
  const auto fail = [&](Fault fault, const Error& e) {
    if (!e.collective() && ranks_in(experiment.model.comm()) > 1) throw;
    outcome.fail(fault, e.what());
  };
  try {
    run();
  } catch (const UsageError&) {
    throw;
  } catch (const NotFinite& e) {
    fail(Fault::not_finite, e);
  } catch (const NotSolved& e) {
    fail(Fault::not_solved, e);
  } catch (const Error& e) {
    fail(Fault::failed, e);
  }
  outcome.seconds = largest_over(experiment.model.comm(), processor_seconds() - begin);
  if (integrator) outcome.report = integrator->report();
}

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

// What clusters do, for the observers and the catalogue. The catalogue gets an event once all clusters are
// beyond its end: so a checkpoint knows the rows before its time, and not those at its time, as with steps of
// the whole medium.
class ClusterRun::Told : public Clusters::Watcher {
 public:
  Told(const Scene& scene, Wanted wanted, const Clusters& clusters, const Plate& plate)
      : halts_(halts(scene)), clusters_(clusters), plate_(plate) {
    if (wanted.events) events_.emplace(scene, wanted.ruptures);
  }

  void step(const MovedNodes& nodes) override {
    if (events_) events_->step(nodes);
    for (Observer* observer : observers) observer->moved(nodes, clusters_);
  }
  void change(double t, const std::vector<PetscInt>& starts, const std::vector<PetscInt>& stops) override {
    for (Observer* observer : observers) observer->changed(t, clusters_);
    if (!events_) return;
    take_until(t);
    events_->change(t, starts, stops, [&](PetscInt i) {
      double u[3];  // what rests beside another cluster goes on with that
      clusters_.node(i, t, u);
      return u[1];
    });
    for (SlipEvent& event : events_->ended()) ended_.push_back({std::move(event), plate_.at(t)});
  }
  void tell_until(double t) {
    take_until(t);
    for (Observer* observer : observers) observer->told_until(t);
  }
  // Of steps under way where the run ends, which events do not end in.
  void step_no_further() { events_.reset(); }
  void archive(Archive& a) {
    if (!events_) return;
    events_->archive(a);
    a.list("events.ended_in_clusters", [&](NumberList& x) {
      x.rest(ended_, [&](Ended& ended) {
        SlipEvent& e = ended.event;
        std::size_t ruptures = e.rupture.size();
        x(e.begin, e.end, e.first, e.left, e.count, e.direction, e.slip, e.moment, e.stress_drop,
          e.strain_energy, e.friction_work, e.radiated, e.kinetic, ruptures);
        if (halts_) x(ended.plate_time);
        e.rupture.resize(ruptures);
        x(e.rupture);
      });
    });
  }

  std::function<void(const SlipEvent&, double plate_time)> take;
  std::vector<Observer*> observers;

 private:
  struct Ended {
    SlipEvent event = {};
    double plate_time = 0;
  };
  void take_until(double t) {
    const auto later =
        std::find_if(ended_.begin(), ended_.end(), [&](const Ended& e) { return e.event.end >= t; });
    for (auto one = ended_.begin(); one != later && take; ++one) take(one->event, one->plate_time);
    ended_.erase(ended_.begin(), later);
  }

  std::optional<ClusterEvents> events_;
  const bool halts_;
  std::vector<Ended> ended_;  // in order of their ends
  const Clusters& clusters_;
  const Plate& plate_;
};

ClusterRun::ClusterRun(const Model& model, Plate& plate, const Tolerances& tolerances, Wanted wanted)
    : model_(model), clusters_(model, plate, tolerances) {
  told_ = std::make_unique<Told>(model.scene(), wanted, clusters_, plate);
}
ClusterRun::~ClusterRun() = default;

void ClusterRun::archive(Archive& a) {
  clusters_.archive(a);
  a("clusters.shown", shown_);
  told_->archive(a);
  resumed_ = a.restores();
}

void ClusterRun::update(double t) {
  report.t = t;
  report.steps = clusters_.steps();
  report.rejections = clusters_.rejections();
  report.rhs_evaluations = clusters_.evaluations();
}

void ClusterRun::show(const ClusterPlan& plan, Vec u, double t) {
  update(t);
  model_.begin_load(std::nextafter(t, plan.span.begin));  // at a corner the piece before it
  const VecHandle at = model_.create_vector();
  SS_TRY(VecCopy(u, at));
  const std::function<void(double, Vec)> copy = [&](double, Vec into) { SS_TRY(VecCopy(at, into)); };
  for (Observer* observer : plan.observers)
    observer->step({report.steps, shown_, t, u, report.rejections, copy});
  shown_ = t;
}

// Tells what clusters have done of steps that go on beyond the end; rows at the time of the end only where
// the run is over, as one that goes on further has none there.
void ClusterRun::finish(double t, bool is_over) {
  told_->step_no_further();
  clusters_.show_until(t);
  told_->tell_until(is_over ? infinity : t);
}

void ClusterRun::advance(Vec u, const ClusterPlan& plan) {
  const LogStage stepping("time stepping");
  const TimeSpan& span = plan.span;
  told_->take = plan.event;
  told_->observers = plan.observers;
  clusters_.watch(told_.get());
  if (!resumed_) {
    shown_ = span.begin;
    clusters_.start(u, span.begin);
    show(plan, u, span.begin);
  }
  bool stops = false;
  std::int64_t asked = clusters_.steps();
  const auto ask = [&](double t) {
    beat("steps");
    update(t);
    told_->tell_until(t);
    stops = !plan.go_on(report.steps, t);
  };
  const auto go_on = [&](std::int64_t steps, double t) {
    if (steps < asked + plan.ask_every) return true;
    asked = steps;
    ask(t);
    return !stops;
  };
  for (double t = span.begin; t < span.end;) {
    const double wanted = std::min(plan.next_time(t), span.end),
                 reached = clusters_.advance(wanted, span.most_steps, go_on);
    update(reached);
    const bool over = clusters_.plate_is_over();
    if (reached < wanted && !over) {
      if (!stops) ask(reached);  // after the last step
      clusters_.solution(reached, u);
      show(plan, u, reached);
      finish(reached, false);
      report.stop = stops ? Stop::asked : Stop::max_steps;
      return;
    }
    clusters_.solution(reached, u);
    if (reached > shown_) show(plan, u, reached);
    t = reached;
    if (over) break;
  }
  ask(clusters_.plate_is_over() ? report.t : span.end);
  finish(report.t, true);
  report.stop = clusters_.plate_is_over() ? Stop::max_plate : Stop::end_time;
}

std::int64_t most_steps(const Options& options) {
  return options.is_set("ts_max_steps") ? static_cast<std::int64_t>(options.real("ts_max_steps"))
                                        : std::numeric_limits<std::int64_t>::max();
}

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

double largest_processor_seconds() { return largest_over(PETSC_COMM_WORLD, processor_seconds()); }

Options options_for(const Options& options, const Setting& setting) {
  Options result = options.with("grid_n", std::to_string(setting.n));
  if (options.text("model_form") != "chain")
    result = result.with("grid_order", std::to_string(setting.order));
  if (setting.eps > 0)
    result = result.with("friction_stick", "regularised").with("friction_eps", number_text(setting.eps));
  return result;
}

Scene on_grid(Scene scene, PetscInt n, int order) {
  scene.n = n;
  scene.order = order;
  return scene;
}

// How a run of the setting is to be advanced.
MethodSpec spec_of(const Options& options, const Setting& setting) {
  MethodSpec spec = setting.method;
  // the user's own imex_implicit is for methods that split and say nothing themselves
  if (spec.can().splits && spec.implicit == "auto") spec.implicit = options.text("imex_implicit");
  if (spec.can().has_estimate)
    spec.tolerance = setting.tolerance;
  else
    spec.step = setting.step;
  spec.fused = options.boolean("rk_fused");
  return spec;
}

void check_settings(const Options& options, const std::vector<Setting>& settings) {
  std::set<std::tuple<std::string, std::string, double>> methods_seen;
  std::set<std::pair<PetscInt, int>> grids_seen;
  for (const Setting& s : settings) {
    const bool new_grid = grids_seen.emplace(s.n, s.order).second;
    const bool new_method = methods_seen.emplace(s.method.name(), s.method.implicit, s.eps).second;
    if (!new_grid && !new_method) continue;
    const Options here = options_for(options, s);
    std::vector<std::string> unheard;
    std::optional<WarningsKept> kept;
    if (!new_grid) kept.emplace(unheard);
    const Model model(PETSC_COMM_WORLD, Scene::from(here, false));
    VecHandle u = model.create_vector();
    set_start(model, here, u);
    if (!kept) kept.emplace(unheard);
    const Integrator integrator(model, spec_of(here, s), u);
  }
}

Trial run_trial(const Options& asked, const Setting& setting, const std::string& prefix, double limit,
                const MeasureMaker& measure) {
  const Options options = options_for(asked, setting);
  Trial trial;
  const Scene whole = Scene::from(options, false);
  const Problem problem = [&] {
    const WarningsKept kept(trial.warnings);
    return problem_of(whole, options, std::nullopt);
  }();
  const Model& model = problem.model;
  const double t_end = options.real("ts_max_time");
  const std::int64_t allowed =
      prefix.empty() ? most_steps(options) : std::numeric_limits<std::int64_t>::max();
  std::unique_ptr<Measure> measured;
  ObservationPlan plan;
  const double begin = processor_seconds();
  Experiment run{model, spec_of(options, setting), prefix, {0, t_end, allowed}};
  run.watch = [&](Integrator& integrator) {
    std::vector<Observer*> observers;
    if (measure) {
      measured = measure(model, whole);
      measured->plan(plan);
      integrator.set_output_times([&plan](double t) { return plan.next_time(t); });
      observers = {measured.get()};
    }
    warn_of_steps(model, integrator, problem.u, t_end);
    return observers;
  };
  run.goes_on = [&](const Integrator::Step& step, Outcome& outcome) {
    if (step.index + outcome.report.rejections >= setting.most_attempts)
      outcome.fail(Fault::too_many_steps, fmt::format("stopped after {} steps", step.index));
    if (step.index % 8 != 0 || step.index == 0 || !outcome.is_answer()) return outcome.is_answer();
    const double now = largest_over(PETSC_COMM_WORLD, processor_seconds() - begin);
    // no need to wait for the end of what cannot get there
    const bool hopeless = now > 0.25 * limit && now * t_end > 4 * limit * step.t;
    if (now > limit || hopeless)
      outcome.fail(Fault::too_slow, "stopped: it would take more than " + number_text(limit) + " s");
    return outcome.is_answer();
  };
  run.at_end = [&](const Integrator&) {
    if (measured) trial.measured = measured->values();
  };
  carry_out(run, problem.u, trial);
  if (trial.is_answer() && trial.report.t < t_end)
    trial.fail(Fault::too_many_steps,
               "stopped at ts_max_steps " + options.text("ts_max_steps") + ", before ts_max_time");
  if (!trial.is_answer()) return trial;

  model.set_held(problem.u);
  trial.end = fields_of(model, problem.u, whole.n);
  return trial;
}

Fields fields_with_friction(const Scene& scene, std::vector<double> psi, std::vector<double> eta,
                            std::vector<double> state) {
  Fields fields{std::move(psi), std::move(eta), {}, {}};
  if (scene.nodes_alike() || scene.form == Form::chain) return fields;
  const FrictionAt friction(scene, positions(scene, 0, scene.n));
  for (std::size_t i = 0; i < fields.psi.size(); ++i)
    fields.friction.push_back(friction.force(i, fields.psi[i], state.empty() ? 0 : state[i]));
  fields.state = std::move(state);
  return fields;
}

Fields fields_of(const Model& model, Vec u, PetscInt n) {
  Gather gather(u, model.dof());
  std::vector<std::vector<double>> whole(model.dof());
  const auto& components = gather.components(u);
  for (std::size_t c = 0; c < whole.size(); ++c) {
    if (!components.empty() && !components[c].empty())
      for (PetscInt i = 0; i < n; ++i) whole[c].push_back(components[c][i % model.scene().n]);
    broadcast(whole[c]);
  }
  return fields_with_friction(model.scene(), whole[0], whole[1],
                              whole.size() > 2 ? whole[2] : std::vector<double>());
}

bool has_grid_limit(const Options& options, const Scene& scene) {
  const bool noise_of_nodes = options.real("init_noise") != 0 && options.real("init_noise_length") == 0;
  return scene.form == Form::continuum && !noise_of_nodes && options.text("init_type") != "file" &&
         options.text("init_type") != "text";
}

std::vector<int> possible_orders(const Scene& scene) {
  if (scene.form == Form::chain || scene.medium.links_differ()) return {2};
  if (scene.left == End::velocity || scene.right == End::velocity) return {2, 4, 6};
  return {2, 4, 6, 8};
}

Point combined(const Fields& fields, const Combination& row, const FrictionAt& here, std::size_t place) {
  const bool between = !fields.friction.empty() && row.size() > 1;
  Point sum{0, 0};
  for (const auto& [index, weight] : row) {
    const double state = fields.state.empty() ? 0 : fields.state[index];
    const double excess = between ? here.force(place, fields.psi[index], state) - fields.friction[index] : 0;
    sum.psi += weight * fields.psi[index];
    sum.eta += weight * (fields.eta[index] + excess);
  }
  return sum;
}

Fields at_points(const Fields& fields, const Scene& scene, const std::vector<double>& x) {
  const FrictionAt friction = fields.friction.empty() ? FrictionAt() : FrictionAt(scene, x);
  const NodesAround around(scene);
  Fields result;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Point point = combined(fields, around.at(x[i]), friction, i);
    result.psi.push_back(point.psi);
    result.eta.push_back(point.eta);
  }
  return result;
}

Fields resample(const Fields& fields, const Scene& from, const Scene& to) {
  if (from.n == to.n) return fields;
  return at_points(fields, from, positions(to, 0, to.n));
}

double distance(const Fields& a, const Fields& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.psi.size(); ++i)
    largest = std::max({largest, std::abs(a.psi[i] - b.psi[i]), std::abs(a.eta[i] - b.eta[i])});
  return largest;
}

}  // namespace stickslip
