// A run in which only what slides is advanced (time/clusters.hpp): with stick_clusters.
#include <fmt/format.h>

#include "base/pulse.hpp"
#include "commands/command.hpp"
#include "commands/run_session.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/time/stick.hpp"

namespace stickslip {

namespace {

constexpr PetscInt fewest = 64;  // nodes from which on auto takes clusters
constexpr double loose = 1e-3;   // tolerances from here on: whole steps are looked after (step_audit.hpp)

}  // namespace

// Why clusters cannot be taken; "" where they can.
std::string Run::no_clusters() const {
  if (const std::string why = Clusters::refusal(problem_.model.scene()); !why.empty()) return why;
  if (const Method& method = integrator_->method(); method.name() != "rk:5dp" || !integrator_->adaptive())
    return "clusters take adaptive steps of rk:5dp, and the method is " + method.name() +
           (integrator_->adaptive() ? "" : " with fixed steps");
  if (ranks_in(PETSC_COMM_WORLD) > 1 && !may_rest())
    return "clusters are for one rank, and a point of this sweep has several (sweep_group_ranks)";
  for (const auto& given : options_.library())
    if (given.first.rfind("ts_adapt_", 0) == 0 || given.first.rfind("ts_monitor", 0) == 0)
      return "each cluster has its own steps, to which -" + given.first + " does not apply";
  if (!options_.boolean("rk_fused")) return "rk_fused false asks for the library's own steps";
  for (const char* name : {"accuracy", "out_maxima"})
    if (options_.is_set(name)) return std::string(name) + " looks at every step of the whole medium";
  if (options_.integer("lyapunov_count") > 0) return "lyapunov_count follows deviations of the whole medium";
  if (counts_displacement_)
    return "out_displacement on springs that are weak, or with model_k0 0 and no held end, is counted from "
           "the start over every step of the whole medium";
  if (catalogue_ && options_.is_set("out_events_velocity") && options_.real("out_events_velocity") > 0)
    return "events are of nodes that slide at all, and out_events_velocity asks for other ones";
  return "";
}

// Why auto does without them.
std::string Run::no_gain_of_clusters() const {
  const PetscInt n = problem_.model.scene().n;
  if (n < fewest) return "with " + std::to_string(n) + " nodes nothing is gained";
  if (integrator_->tolerances().largest() >= loose)
    return "steps of these tolerances are looked after as a whole";
  return "";
}

// Behind the integrator, which knows the method that the options mean. A run goes on from a checkpoint as it
// began.
void Run::choose_clusters(const std::optional<Checkpoint>& checkpoint) {
  const std::string choice = options_.text("stick_clusters");
  const bool is_of_clusters = checkpoint && checkpoint->arrays.count("clusters.reached") > 0;
  no_clusters_ = no_clusters();
  if (is_of_clusters && !no_clusters_.empty())
    throw UsageError("restart '" + options_.text("restart") +
                     "': its clusters (stick_clusters) cannot go on here: " + no_clusters_);
  if (choice == "on" && !no_clusters_.empty())
    throw UsageError("stick_clusters on: " + no_clusters_ + "; leave it off");
  if (choice == "off") no_clusters_ = "stick_clusters off";
  if (choice == "auto" && no_clusters_.empty()) no_clusters_ = no_gain_of_clusters();
  if (choice == "auto" && checkpoint && no_clusters_.empty() && !is_of_clusters)
    no_clusters_ = "the run began by steps of the whole medium";
  if (no_clusters_.empty() && ranks_in(PETSC_COMM_WORLD) > 1) throw OneRankWorks();
  if (no_clusters_.empty()) set_up_clusters(checkpoint);
  if (!Stick::applies_to(problem_.model.scene())) no_clusters_.clear();  // nobody would ask
}

void Run::set_up_clusters(const std::optional<Checkpoint>& checkpoint) {
  if (catalogue_) catalogue_->take_events();
  clusters_ = std::make_unique<ClusterRun>(
      problem_.model, plate_, integrator_->tolerances(),
      ClusterRun::Wanted{catalogue_ != nullptr, options_.boolean("out_rupture")});
  clusters_->report.method = integrator_->report().method;
  const double t_end = options_.real("ts_max_time");
  sound_ = StepAudit(problem_.model, options_, *integrator_, origin_.t, t_end).verdict(problem_.u);
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
