// One run of friction that sticks in which only what slides is advanced (time/clusters.hpp): events as they
// end, and observers at the times that they have announced.
#pragma once

#include <functional>

#include "output/cluster_events.hpp"
#include "stickslip/output/observer.hpp"
#include "study/simulate.hpp"
#include "time/clusters.hpp"

namespace stickslip {

struct ClusterRun {
  TimeReport report;
  std::int64_t node_steps = 0;  // steps, each times the nodes of its cluster
  std::int64_t clusters = 0;    // most at once
};

struct ClusterPlan {
  TimeSpan span;
  double atol, rtol;
  Plate* plate;                                 // whose clock is kept; the caller's
  std::vector<Observer*> observers;             // see u at span's ends and where next_time says
  std::function<double(double t)> next_time;    // the first time later than t
  std::function<void(const SlipEvent&)> event;  // may be empty: no events are wanted
  bool ruptures = false;                        // of events, too
  // Asked now and then with the steps so far and the time: whether to go on.
  std::function<bool(std::int64_t steps, double t)> go_on;
};

// Advances u; `done` is up to date whenever an observer is called, and after a Failure. For one rank.
void simulate_clusters(const Model& model, Vec u, const ClusterPlan& plan, ClusterRun& done);

}  // namespace stickslip
