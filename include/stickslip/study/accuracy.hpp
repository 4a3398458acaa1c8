// `-accuracy E`: method, tolerance, order and grid for an error of E, and what the error then is.
//
// The error is the largest |difference| of psi and eta from the solution of the differential equation (of the
// chain's equations) at ts_max_time, over nodes and probes; with accuracy_of that of a number: of psi and eta
// at one place, of the wave speed, the period or the amplitude (src/output/measures.hpp). Where data that do
// not fit a held end make psi jump (src/study/ladder.hpp), it is that of psi beside the jump. It is found on
// a ladder of runs, each some thirty times as accurate as the one before: the distance of two neighbours is
// the error of the coarser, and falls at a rate that is measured.
//   - with a grid to refine: grids a factor of 1.3 to 2 apart, at one tolerance whose errors are small beside
//     theirs; one more run at a looser tolerance, on the grid before the last, tells what a tolerance costs;
//   - without one (the chain, uniform motion): tolerances alone, until a level is stricter than the run must
//     be.
// With a grid the run itself is the ladder's last step, and its distance from the last level, with the rate
// between the levels, gives `error_estimate`; without one the run lies before the last level, and that
// distance is its error. The estimate is no bound: it is made to lie a little above the error, at probes too.
// Where it lies above the request, the run becomes a level and the next one is finer.
//
// Where rates are low because fronts are not resolved yet, the ladder goes on to finer grids as long as
// accuracy_seconds of processor time last. A refusal says what was tried; the best level is then run all the
// same, for what it is worth.
//
// The error of a number may pass through zero where one does not expect it: it is never taken to fall faster
// from level to level than the scheme's order lets it.
//
// Explicit methods take rk:7vr, whose stages are the cheapest at every accuracy (docs/chart.md), and their
// levels are run without PETSc's TS on every rank alike (src/study/ladder.hpp), unless something is measured
// on the way. Where friction or waves are so fast that a run that names no method would take them implicitly
// (time/methods.hpp), that method is tried first, and stays while an explicit run, bound by its stability,
// would take longer.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "stickslip/options/options.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

// Where the solution jumps at the end, by how much from ahead to behind (empty: not known), and the stretch
// around, in which the error was not asked for.
struct JumpAtEnd {
  double x;
  std::optional<double> height;
  double from, to;
};

class AccuracyPlan {
 public:
  // Runs what it needs. Throws UsageError where what the user set leaves no choice (a method without an error
  // estimate), Failure where nothing can be predicted at all, with the reason. Collective, like all but the
  // accessors.
  AccuracyPlan(const Options& options, double wanted);
  ~AccuracyPlan();

  // The user's options, with those set that he left open.
  const Options& options() const;
  const std::string& what() const;  // what was chosen and why, one line
  // "", or why the accuracy is out of reach: options() are then those of the best level.
  const std::string& refusal() const;
  const Setting& setting() const;
  // Processor time of choosing and estimating so far, the largest over the ranks. Not in it: the checks of
  // the options and the start of the scene, which every run pays for.
  double seconds() const;
  int trials() const;  // short runs so far

  // Makes what a run by options() must measure for estimate(); nullptr: nothing.
  MeasureMaker measure() const;
  // The error of a run by options(), from what it ended with.
  double estimate(const Answer& end);
  // What was wanted of that run: psi and eta at the probe, or what was measured; empty for fields.
  std::vector<double> value(const Answer& end) const;
  // Empty where the solution has none; costs a run of what is ahead of it.
  std::optional<JumpAtEnd> jump();
  // Makes setting() stricter, for the run of the last estimate(), which was too large. Throws Failure where
  // that cannot be had.
  void refine();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
