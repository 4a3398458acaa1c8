// `-accuracy E`: method, tolerance, order and grid for an error of E, and what the error then is.
//
// The error is the largest |difference| of psi and eta from the solution of the differential equation (of the chain's
// equations) at ts_max_time, over nodes and probes. It is found on a ladder of runs of which each is meant to be some
// thirty times as accurate as the one before, in time and in space together, so that all of them cost about as much as
// the last: the distance of two neighbours is the error of the coarser, and falls at a rate that is measured.
//   - with a grid to refine: grids a factor of 1.3 to 2 apart, at tolerances that make the error in time a tenth of
//     that in space; one more run at a looser tolerance, on a grid before the last, tells what a tolerance costs;
//   - without one (the chain, uniform motion): tolerances alone.
// The run itself is the ladder's last step. Its distance from the last rung, with the rate between the rungs, gives
// `error_estimate`, which is no bound: it is made to lie a little above the error. Where it lies above the request, the
// run becomes a rung and the next one is finer.
//
// Explicit methods take rk:7vr, whose stages are the cheapest at every accuracy (docs/chart.md), and their rungs are
// run without PETSc's TS on every rank alike (src/pilot.hpp). Where friction or waves are so fast that the automatic
// choice of a method would take them implicitly, rosw:ra34pw2 is tried first, and stays while an explicit run, bound
// by its stability, would take longer.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stickslip/options.hpp"
#include "stickslip/trial.hpp"

namespace stickslip {

class Pilot;

class AccuracyPlan {
 public:
  // Runs what it needs. Throws UsageError where what the user set leaves no choice (a method without an error
  // estimate), Failure where the accuracy is out of reach, with the best that is in reach and the reason. Collective.
  AccuracyPlan(const Options& options, double wanted);
  ~AccuracyPlan();

  // The user's options, with those set that he left open.
  const Options& options() const { return chosen_; }
  const std::string& what() const { return what_; }  // what was chosen and why, one line
  const Setting& setting() const { return setting_; }
  // Processor time of choosing and estimating so far, the largest over the ranks. Not in it: the checks of the options
  // and the start of the scene, which every run pays for.
  double seconds() const { return seconds_; }
  int trials() const { return trials_; }

  // The error of a run by options(), from what it ended with.
  double estimate(const Fields& end);
  // Makes setting() stricter, for the run of the last estimate(), which was too large.
  void refine();

 private:
  struct Rung {
    Scene scene;
    double tolerance;
    Fields fields;
    PetscInt steps;
    double seconds;
  };
  // The steps of the constructor
  void read_what_is_set();
  void choose();
  bool prefers_explicit(double implicit_seconds, PetscInt n) const;

  // space
  void climb();
  PetscInt first_cells() const;
  int order_at_best() const;
  double rate(std::size_t k) const;      // of the errors of rungs k - 1 and k
  double order_beyond() const;           // expected between the last two rungs,
  double next_order() const;             // and beyond the last
  double error_foreseen(double cells) const;
  double tolerance_of_rung(double at) const;
  struct Outlook {
    double error, order;     // of the last rung, and at which rate errors come to it
    double factor;           // by which its grid is too coarse
    bool sure, resolved, within_reach;
  };
  Outlook outlook() const;
  void place_run(const Outlook& ahead);
  void choose_tolerance_on(double cells, double in_space);
  bool time_is_to_blame();
  [[noreturn]] void give_up_on(const Outlook& ahead) const;
  PetscInt nodes(double cells) const;
  static double cells(const Scene& scene);
  // time alone
  void descend();
  double slope() const;
  double time_foreseen(double tolerance) const;

  void add(Rung made);
  void begin_anew();
  void take_explicit();
  Rung rung(PetscInt n, double tolerance, std::string& failed);
  Rung rung(PetscInt n, double tolerance);
  double difference(const Rung& a, const Rung& b) const;
  double estimate_in_time(const Rung& now, double d) const;
  double estimate_in_space(const Rung& now, double d) const;
  [[noreturn]] void give_up(const std::string& why) const;
  void finish();

  Options asked_, chosen_;
  double wanted_, aim_;  // aim_: below wanted_ after a refinement
  Scene scene_;
  std::vector<double> probes_;
  bool grid_open_, order_open_, method_open_, tolerance_open_, has_space_, friction_sets_steps_ = false;
  std::unique_ptr<Pilot> pilot_;
  Setting setting_;
  double seconds_ = 0;
  int trials_ = 0, restarts_ = 0;
  std::string what_, why_;

  std::vector<Rung> rungs_;       // coarse to fine
  std::vector<double> distances_; // of rungs k and k + 1: the error of rung k
  Rung last_run_;                 // what estimate() saw
  double last_estimate_ = 0, least_stretch_ = 1;  // of the next run's grid against the last rung's
  // with a grid: a tolerance costs `per_tolerance_` times itself on a grid of per_tolerance_cells_, and more on finer
  // ones, as noise of the shortest waves does
  double per_tolerance_ = 5, per_tolerance_cells_ = 0;
  double in_time_ = 0, in_space_ = 0;  // foreseen of the run
};

// The order of convergence to be expected beyond three grids from their two rates in a scheme of order p: the last one,
// or more while the rates still rise (`earlier` NaN where there is none).
double expected_order(double earlier, double last, int p);

}  // namespace stickslip
