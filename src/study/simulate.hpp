// One run: an integrator advances u, and observers see every step of it.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "output/catalogue.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/study/trial.hpp"
#include "stickslip/time/time.hpp"
#include "time/clusters.hpp"

namespace stickslip {

// How far a run goes, and what went before it.
struct TimeSpan {
  double begin, end;
  std::int64_t most_steps = std::numeric_limits<std::int64_t>::max();  // in all
  std::int64_t rejections = 0;                                         // before it
  double* watching = nullptr;  // if given, takes the processor seconds of this rank for all but the steps
};

// Advances u. The observers see each step in this order, as their contract says; then `asked`, if given, says
// whether to go on. Throws what Integrator::advance, an observer or `asked` throws; of a solution that is not
// finite with the limit that its steps are beyond. Collective.
void simulate(Integrator& integrator, Vec u, const TimeSpan& span, const std::vector<Observer*>& observers,
              const Integrator::Observer& asked = {});

// The velocity above which a node moves, for events that option `asked_by` asks for. Throws UsageError.
double event_velocity(const Options& options, const Scene& scene, const std::string& asked_by);

// A run whose failure is a result.
struct Experiment {
  const Model& model;
  MethodSpec method;
  std::string prefix;  // of PETSc's options
  TimeSpan span;
  // Who watches it, of the integrator that is about to go; after each step, whether it goes on (where it does
  // not, and has no answer, it is failed here); what is to be measured where it came to an end.
  std::function<std::vector<Observer*>(Integrator&)> watch = {};
  std::function<bool(const Integrator::Step&, Outcome&)> goes_on = {};
  std::function<void(const Integrator&)> at_end = {};
};

// Carries it out from u, which becomes the state reached; warnings are kept in the outcome and not printed.
// Throws UsageError, and on several ranks what not all of them have met. Collective over the model's ranks.
void carry_out(const Experiment& experiment, Vec u, Outcome& outcome);

// One run of friction that sticks in which only what slides is advanced (time/clusters.hpp): observers as
// their contract says, and events as they end.
struct ClusterPlan {
  TimeSpan span;
  std::vector<Observer*> observers;
  std::function<double(double t)> next_time;  // the first time later than t
  // Takes events as they end, where they are wanted, with what the plate's clock shows then.
  std::function<void(const SlipEvent&, double plate_time)> event;
  // Asked after so many steps and at the end, with the steps so far and the time: whether to go on.
  std::int64_t ask_every = 64;
  std::function<bool(std::int64_t steps, double t)> go_on;
};

// For one rank.
class ClusterRun {
 public:
  struct Wanted {
    bool events = false, ruptures = false;
  };
  // The plate, whose clock it keeps, must outlive it.
  ClusterRun(const Model& model, Plate& plate, const Tolerances& tolerances, Wanted wanted);
  ~ClusterRun();
  void limit_steps(double longest) { clusters_.limit_steps(longest); }

  // Advances u, from plan.span.begin or from where the checkpoint was; `report` is up to date whenever an
  // observer or go_on is called, and after a Failure.
  void advance(Vec u, const ClusterPlan& plan);
  // Of what a checkpoint holds, asked for within go_on, u is the state at the time reached.
  void archive(Archive& a);
  void solution(Vec u) const { clusters_.solution(clusters_.reached(), u); }

  TimeReport report;
  std::int64_t node_steps() const { return clusters_.node_steps(); }
  std::int64_t most_at_once() const { return clusters_.most_at_once(); }

 private:
  class Told;
  void update(double t);
  void show(const ClusterPlan& plan, Vec u, double t);
  void finish(double t, bool is_over);

  const Model& model_;
  Clusters clusters_;
  std::unique_ptr<Told> told_;
  bool resumed_ = false;
  double shown_ = 0;  // when the observers last saw u
};

}  // namespace stickslip
