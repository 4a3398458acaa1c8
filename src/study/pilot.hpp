// Runs of a scene by an explicit Runge-Kutta pair on one rank, for `-accuracy`: those that prepare a run are
// so short that PETSc's grid and TS cost more than the steps do. Steps are those of PETSc's rk with its own
// error control, and end at the corners of a load as a run's do (a test compares them); every rank does the
// same.
#pragma once

#include "stickslip/study/start.hpp"
#include "stickslip/time/time.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

class Pilot {
 public:
  // The start is found once. Throws what Start does. Collective where that is.
  Pilot(const Options& options, const Scene& scene);

  // Whether a setting is run here: a pair of type rk with an error estimate, friction that does not stick
  // exactly.
  static bool suits(const Scene& scene, const MethodSpec& method);
  Trial run(const Setting& setting, double limit) const;

  // The longest step, ts_adapt_dt_max: as the user set it; for rk:7vr, which is stable for all decaying modes
  // of |lambda| dt < 4.5, just below that of the shortest wave. Steps left to the error estimate alone go
  // beyond it, are rejected, and leave noise in the shortest waves (docs/chart.md). 0: none.
  double longest_step(const Setting& setting) const;

  // The scene at its start on a grid.
  struct AtStart {
    Model model;
    Rates rates;
  };
  AtStart at_start(int order, PetscInt n) const;
  // The method of a run of this tolerance that names none, as Integrator chooses it; where that is explicit,
  // rk:7vr.
  MethodSpec automatic(const AtStart& start, double tolerance) const;
  double t_end() const { return t_end_; }
  const Start& start() const { return start_; }

 private:
  Model model(int order, PetscInt n) const;

  const Options& options_;
  Scene scene_;
  Start start_;
  double t_end_;
  bool reduces_;
};

}  // namespace stickslip
