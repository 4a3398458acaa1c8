// A run in which only what slides is advanced (time/clusters.hpp): with stick_clusters.
#include "base/broadcast.hpp"
#include "base/progress.hpp"
#include "commands/run_session.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

bool Run::takes_clusters() const { return options_.text("stick_clusters") == "on"; }

// Behind the integrator, which knows the method that the options mean.
void Run::set_up_clusters(const std::optional<Checkpoint>& checkpoint) {
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
      refuse("each cluster has its own steps, to which -" + given.first + " does not apply");
  for (const char* name : {"accuracy", "out_maxima"})
    if (options_.is_set(name)) refuse(std::string(name) + " looks at every step of the whole medium");
  if (options_.integer("lyapunov_count") > 0) refuse("lyapunov_count follows deviations of the whole medium");
  double absolute, relative;
  SS_TRY(TSGetTolerances(integrator_->ts(), &absolute, nullptr, &relative, nullptr));
  clusters_ = std::make_unique<ClusterRun>(
      problem_.model, plate_, absolute, relative,
      ClusterRun::Wanted{catalogue_ != nullptr, options_.boolean("out_rupture")});
  clusters_->report.method = integrator_->report().method;
  if (!checkpoint) return;
  try {
    Archive from = Archive::from(*checkpoint, NodeRange::of(problem_.model));
    clusters_->archive(from);
  } catch (const std::runtime_error& e) {
    throw UsageError("restart '" + options_.text("restart") + "': is not a whole checkpoint: " + e.what());
  }
}

// From where to where, without observers.
ClusterPlan Run::cluster_plan() const {
  ClusterPlan plan;
  plan.span = {origin_.t, options_.real("ts_max_time"), control_->most_steps()};
  plan.next_time = [](double) { return std::numeric_limits<double>::infinity(); };
  return plan;
}

bool Run::goes_on(std::int64_t steps, double t) {
  const RunControl::Decision decision = control_->after(steps, t, plate_ends_at(t));
  if (file_ && decision.checkpoint) {
    clusters_->solution(problem_.u);
    write_checkpoint_at(steps, t, 1, problem_.u);  // each cluster's own next step stands with it
  }
  return !decision.stop;
}

void Run::advance_clusters(Progress& progress) {
  ClusterPlan plan = cluster_plan();
  const double t_end = plan.span.end;
  integrator_.reset();  // with all its vectors
  for (const auto& observer : observers_) plan.observers.push_back(observer.get());
  plan.next_time = [announced = this->plan()](double t) { return announced.next_time(t); };
  if (catalogue_)
    plan.event = [this](const SlipEvent& event, double shown) { catalogue_->record(event, shown); };
  if (control_->checkpoints_by_steps()) plan.ask_every = 1;
  plan.go_on = [&](std::int64_t steps, double t) {
    if (progress.due()) {
      const double part = (t - origin_.t) / (t_end - origin_.t);
      progress.show(fmt::format("t = {:.6g} of {:.6g} ({:.0f} %), {} steps of clusters{}", t, t_end,
                                100 * part, steps, progress.left(part)));
    }
    return goes_on(steps, t);
  };
  clusters_->advance(problem_.u, plan);
}

}  // namespace stickslip
