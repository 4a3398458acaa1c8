// The course of one run: who watches it, when it ends, how far it has come.
#pragma once

#include <algorithm>

#include "stickslip/base/error.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

struct Course {
  const Integrator::Observer* observer = nullptr;
  double t_before = 0;             // beginning of the step
  double t_end = 0, run_end = 0;   // to be hit exactly: the next corner of the load or the end of the run, and the latter
  PetscInt max_steps = 0;
  PetscInt coarse = 0;             // steps taken back because a node that let go ran backwards
  PetscInt rejected_before = 0;    // up to the last corner of the load
  double next_dt = 0;              // proposed last
  bool stop_asked = false;
  TimeReport report;
  long evaluations_before = 0;

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

  void update_report(TS ts, const Model& model) {
    SS_TRY(TSGetTime(ts, &report.t));
    SS_TRY(TSGetStepNumber(ts, &report.steps));
    SS_TRY(TSGetStepRejections(ts, &report.rejections));
    report.rejections += coarse + rejected_before;
    report.rhs_evaluations = model.rhs_evaluations() - evaluations_before;
  }
};

}  // namespace stickslip
