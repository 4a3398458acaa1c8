#include "study/simulate_clusters.hpp"

#include <algorithm>

#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

constexpr std::int64_t seldom = 64;  // steps of clusters from one question to the next

// What clusters do, for the catalogue.
class Told : public Clusters::Watcher {
 public:
  Told(const Scene& scene, const ClusterPlan& plan) : events_(scene, plan.ruptures), take_(plan.event) {}
  void know(const Clusters& clusters) { clusters_ = &clusters; }

  void step(const MovedNodes& nodes) override { events_.step(nodes); }
  void change(double t, const std::vector<PetscInt>& starts, const std::vector<PetscInt>& stops) override {
    events_.change(t, starts, stops, [&](PetscInt i) { return clusters_->eta_at_rest(i, t); });
    for (const SlipEvent& event : events_.ended()) take_(event);
  }

 private:
  ClusterEvents events_;
  const std::function<void(const SlipEvent&)>& take_;
  const Clusters* clusters_ = nullptr;  // known before anything stops
};

}  // namespace

void simulate_clusters(const Model& model, Vec u, const ClusterPlan& plan, ClusterRun& done) {
  const TimeSpan& span = plan.span;
  Told told(model.scene(), plan);
  Clusters clusters(model, u, span.begin, plan.atol, plan.rtol, plan.event ? &told : nullptr, *plan.plate);
  told.know(clusters);
  const VecHandle at = model.create_vector();
  TimeReport& report = done.report;
  const auto update = [&](double t) {
    report.t = t;
    report.steps = clusters.steps();
    report.rejections = clusters.rejections();
    report.rhs_evaluations = clusters.evaluations();
    done.node_steps = clusters.node_steps();
    done.clusters = std::int64_t(clusters.most_at_once());
  };
  const auto show = [&](double before, double t) {
    update(t);
    SS_TRY(VecCopy(u, at));
    const std::function<void(double, Vec)> copy = [&](double, Vec into) { SS_TRY(VecCopy(at, into)); };
    for (Observer* observer : plan.observers)
      observer->step({report.steps, before, t, u, report.rejections, copy});
  };
  bool stops = false;
  std::int64_t asked = 0;
  const auto go_on = [&](std::int64_t steps, double t) {
    if (steps < asked + seldom) return true;
    asked = steps;
    update(t);
    return !(stops = !plan.go_on(steps, t));
  };
  show(span.begin, span.begin);
  for (double t = span.begin; t < span.end;) {
    const double wanted = std::min(plan.next_time(t), span.end),
                 reached = clusters.advance(wanted, span.most_steps, go_on);
    clusters.solution(reached, u);
    if (reached > t) show(t, reached);
    t = reached;
    if (clusters.plate_is_over()) {
      report.reason = "ts_max_plate";
      return;
    }
    if (t == wanted) continue;
    report.reason = stops ? "stopped" : "ts_max_steps";
    return;
  }
  report.reason = "end time";
}

}  // namespace stickslip
