// A run in which only what slides is advanced (time/clusters.hpp): with stick_clusters.
#include "base/broadcast.hpp"
#include "base/progress.hpp"
#include "commands/run_session.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

bool Run::takes_clusters() const { return options_.text("stick_clusters") == "on"; }

// Behind the integrator, which knows the method that the options mean.
void Run::set_up_clusters() {
  const auto refuse = [](const std::string& why) {
    throw UsageError("stick_clusters on: " + why + "; leave it off");
  };
  if (const std::string why = Clusters::refusal(problem_.model.scene()); !why.empty()) refuse(why);
  if (const Method& method = integrator_->method(); method.name() != "rk:5dp" || !integrator_->adaptive())
    refuse("clusters take adaptive steps of rk:5dp, and the method is " + method.name() +
           (integrator_->adaptive() ? "" : " with fixed steps"));
  if (ranks_in(PETSC_COMM_WORLD) > 1) refuse("clusters are for one rank");
  for (const auto& given : options_.library())
    if (given.first.rfind("ts_adapt_", 0) == 0 || given.first.rfind("ts_monitor", 0) == 0)
      refuse("each cluster has its own steps, of which -" + given.first + " knows nothing");
  for (const char* name : {"restart", "out_checkpoint_every"})
    if (options_.is_set(name)) refuse(std::string("there are no checkpoints of clusters (") + name + ")");
  for (const char* name : {"accuracy", "out_maxima"})
    if (options_.is_set(name)) refuse(std::string(name) + " looks at every step of the whole medium");
  if (options_.integer("lyapunov_count") > 0) refuse("lyapunov_count follows deviations of the whole medium");
  clusters_.emplace();
  clusters_->report.method = integrator_->report().method;
}

// From where to where and how exactly, while the integrator is there; without observers.
ClusterPlan Run::cluster_plan() {
  ClusterPlan plan;
  plan.span = {origin_.t, options_.real("ts_max_time"), control_->most_steps()};
  SS_TRY(TSGetTolerances(integrator_->ts(), &plan.atol, nullptr, &plan.rtol, nullptr));
  plan.plate = &plate_;
  plan.next_time = [](double) { return std::numeric_limits<double>::infinity(); };
  return plan;
}

void Run::advance_clusters(Progress& progress) {
  ClusterPlan plan = cluster_plan();
  const double t_end = plan.span.end;
  integrator_.reset();  // with all its vectors
  for (const auto& observer : observers_) plan.observers.push_back(observer.get());
  plan.next_time = [announced = this->plan()](double t) { return announced.next_time(t); };
  if (catalogue_) {
    catalogue_->take_events();
    plan.ruptures = options_.boolean("out_rupture");
    plan.event = [this](const SlipEvent& event) { catalogue_->record(event); };
  }
  plan.go_on = [&](std::int64_t steps, double t) {
    if (progress.due()) {
      const double part = (t - origin_.t) / (t_end - origin_.t);
      progress.show(fmt::format("t = {:.6g} of {:.6g} ({:.0f} %), {} steps of clusters{}", t, t_end,
                                100 * part, steps, progress.left(part)));
    }
    return !control_->after(steps, t).stop;
  };
  simulate_clusters(problem_.model, problem_.u, plan, *clusters_);
}

}  // namespace stickslip
