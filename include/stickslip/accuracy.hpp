// `-accuracy E`: method, tolerance, order and grid for an error of E, and what the error then is.
//
// The error is the largest |difference| of psi and eta from the solution of the differential equation (of the chain's
// equations) at ts_max_time, over nodes and probes. Three things are measured on runs that are cheaper than the one
// they prepare:
//   - what a tolerance gives: two or three runs on a coarse grid (the chain: of the scene itself) by an explicit pair,
//     and by a Rosenbrock method where the explicit one's steps do not depend on the tolerance, which is what
//     stability looks like; the cheaper stays;
//   - what a grid gives: grids doubled from a coarse one at the highest order, until the next would be finer than
//     needed;
//     their differences d_k and rates d_(k-1)/d_k give the error of the last one and of any finer one;
//   - afterwards the run itself: its difference from the last of those grids, and from the last of those tolerances.
// An estimate is no bound: it is made to lie a little above the error.
#pragma once

#include <string>
#include <vector>

#include "stickslip/options.hpp"
#include "stickslip/trial.hpp"

namespace stickslip {

class AccuracyPlan {
 public:
  // Runs what it needs. Throws UsageError where what the user set leaves no choice (a method without an error
  // estimate), Failure where the accuracy is out of reach, with the best that is in reach and the reason. Collective.
  AccuracyPlan(const Options& options, double wanted);

  // The user's options, with those set that he left open.
  const Options& options() const { return chosen_; }
  const std::string& what() const { return what_; }  // what was chosen and why, one line
  const Setting& setting() const { return setting_; }
  double seconds() const { return seconds_; }        // processor time of choosing

  // The error of a run by options(), from what it ended with.
  double estimate(const Fields& end) const;
  // Makes setting() stricter, for a run whose estimate was too large.
  void refine(const Fields& end, double estimate);

 private:
  struct Rung {
    Scene scene;
    Fields fields;
  };
  Trial trial(const MethodChoice& method, double tolerance, int order, PetscInt n, double limit);
  bool starts_stiff(PetscInt n) const;
  void choose_method_and_tolerance(PetscInt n);
  void climb();
  void finish(const std::string& why);
  double difference(const Rung& a, const Rung& b) const;
  double error_in_space(double last, double distance_ratio) const;

  Options asked_, chosen_;
  double wanted_, aim_;    // aim_: for which grid and tolerance are chosen; below wanted_ after a refinement
  double most_tolerance_;  // of the run
  Scene scene_;
  std::vector<double> probes_;
  bool grid_open_, order_open_, method_open_, tolerance_open_, has_space_;
  Setting setting_;
  double seconds_ = 0, last_seconds_ = 0;
  PetscInt last_steps_ = 0;
  std::string what_, why_;

  // time: error at tolerance_ref is error_ref, and goes like tolerance^slope
  double tolerance_ref_ = 0, error_ref_ = 0, slope_ = 1;
  // space: the finest grid so far, its error, the order of convergence expected beyond it
  Rung coarse_;
  double space_error_ = 0, order_seen_ = 0;
};

// The order of convergence to be expected beyond three grids from their two rates (log2 of d_(k-1)/d_k; the earlier one
// NaN where there is none) in a scheme of order p: halfway to p while the rates still rise, else the last one.
double expected_order(double earlier, double last, int p);

}  // namespace stickslip
