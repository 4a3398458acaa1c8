#include "study/simulate.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/study/trial.hpp"
#include "stickslip/time/stick.hpp"
#include "study/step_forecast.hpp"

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

}  // namespace stickslip
