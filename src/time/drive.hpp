// Where a run stands: how far it has come, the step that comes next, who watches and when it ends.
#pragma once

#include <cstdint>
#include <vector>

#include "base/idling.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

struct Drive {
  const Integrator::Observer* observer = nullptr;
  Vec u = nullptr;
  double t = 0, t_before = 0;       // reached, and the beginning of the last step
  double h = 0;                     // the next step, as it is proposed
  double t_end = 0, run_end = 0;    // to be hit exactly: the next corner of the load or the end, and the end
  std::int64_t steps = 0, max_steps = 0;
  bool restarts = true, first = true;  // the next step: forgets what came before; is the first of a run
  bool stop_asked = false, plate_is_over = false;  // the latter: Plate::end has come
  Plate own_plate, *plate = &own_plate;
  TimeReport report;
  long evaluations_before = 0;
  Idling idling;
  double same_time = 0;  // what is no later than that is at one time (base/idling.hpp)

  explicit Drive(const Model& model) : idling(model.comm()) {
    if (const double frequency = model.wave_frequency(); frequency > 0) same_time = 1e-14 / frequency;
  }

  bool goes_on() const { return t < t_end && !stop_asked && steps < max_steps; }

  // The next step starts anew, at `from` and of length `length`, unless what was to be hit is reached: then
  // that stays for who goes on with it.
  void go_on_from(double from, double length) {
    t = from;
    h = t < t_end ? std::min(length, t_end - t) : length;
    restarts = true;
  }

  Integrator::Verdict tell(const Integrator::Step& step) {
    if (!*observer) return Integrator::Verdict::go_on;
    const Integrator::Verdict verdict = (*observer)(step);
    if (verdict == Integrator::Verdict::restart) restarts = true;
    if (verdict == Integrator::Verdict::stop && step.t < run_end) stop_asked = true;
    return verdict;
  }

  // Behind every step that counts, and every start and stop: `changed`, the nodes that began to slip or
  // stopped at its end. Where it took no time nobody is told of it but, after a signal, who ends the run.
  void done(const Integrator::Step& step, const std::vector<PetscInt>& changed = {}) {
    if (!idling.at(step.t, changed, same_time)) return;
    Integrator::Step standing(step);
    standing.t_before = step.t;
    tell(standing);
  }

  void update_report(const Model& model) {
    report.t = t;
    report.steps = steps;
    report.rhs_evaluations = model.rhs_evaluations() - evaluations_before;
  }
};

}  // namespace stickslip
