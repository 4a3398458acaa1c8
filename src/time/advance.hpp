// One call to advance: who watches it, when it ends, how far it has come.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/idling.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

struct Advance {
  const Integrator::Observer* observer = nullptr;
  double t_before = 0;  // beginning of the step
  // to be hit exactly: the next corner of the load or the end of the run, and the latter
  double t_end = 0, run_end = 0;
  std::int64_t max_steps = 0;
  std::int64_t counted = 0;                        // steps before the first that the TS counts
  PetscInt rejections_seen = 0;                    // by the TS, of those that are in the report
  double next_dt = 0;                              // proposed last
  bool stop_asked = false, plate_is_over = false;  // the latter: Plate::end has come
  Plate own_plate, *plate = &own_plate;
  TimeReport report;
  long evaluations_before = 0;
  Idling idling;
  double same_time = 0;  // what is no later than that is at one time (base/idling.hpp)

  explicit Advance(const Model& model) : idling(model.comm()) {
    if (const double frequency = model.wave_frequency(); frequency > 0) same_time = 1e-14 / frequency;
  }

  Integrator::Verdict tell(TS ts, const Integrator::Step& step) {
    next_dt = step.next_dt;
    if (!*observer) return Integrator::Verdict::go_on;
    const Integrator::Verdict verdict = (*observer)(step);
    if (verdict == Integrator::Verdict::restart) SS_TRY(TSRestartStep(ts));
    if (verdict == Integrator::Verdict::stop && step.t < run_end) {
      stop_asked = true;
      SS_TRY(TSSetConvergedReason(ts, TS_CONVERGED_USER));
    }
    return verdict;
  }

  // Behind every step that counts, and every start and stop: `changed`, the nodes that began to slip or
  // stopped at its end. Where it took no time nobody is told of it but, after a signal, who ends the run.
  void done(TS ts, const Integrator::Step& step, const std::vector<PetscInt>& changed = {}) {
    if (!idling.at(step.t, changed, same_time)) return;
    Integrator::Step standing(step);
    standing.t_before = step.t;
    tell(ts, standing);
  }

  // The TS counts steps in a PetscInt, from 1 on again where it has come to `most_counted`.
  static constexpr PetscInt most_counted = PetscInt(1) << 30;

  std::int64_t steps(TS ts) const {
    PetscInt steps;
    SS_TRY(TSGetStepNumber(ts, &steps));
    return counted + steps;
  }

  // From now on so many steps are done.
  void begin_count(TS ts, std::int64_t steps) {
    counted = steps > 0 ? (steps - 1) / most_counted * most_counted : 0;
    const std::int64_t left = max_steps - counted, most = std::numeric_limits<PetscInt>::max();
    SS_TRY(TSSetStepNumber(ts, PetscInt(steps - counted)));
    SS_TRY(TSSetMaxSteps(ts, PetscInt(std::clamp<std::int64_t>(left, 0, most))));
  }

  void update_report(TS ts, const Model& model) {
    PetscInt rejections;
    SS_TRY(TSGetTime(ts, &report.t));
    SS_TRY(TSGetStepRejections(ts, &rejections));
    report.steps = steps(ts);
    if (report.steps - counted > most_counted) begin_count(ts, report.steps);
    // also where the TS wraps
    report.rejections += PetscInt(unsigned(rejections) - unsigned(rejections_seen));
    rejections_seen = rejections;
    report.rhs_evaluations = model.rhs_evaluations() - evaluations_before;
  }
};

}  // namespace stickslip
