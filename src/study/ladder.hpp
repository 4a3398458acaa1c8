// The bricks of -accuracy (accuracy.hpp): what is asked and left open, and the short runs that prepare a run.
#pragma once

#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/study/trial.hpp"
#include "study/jump.hpp"
#include "study/pilot.hpp"
#include "study/quantity.hpp"

namespace stickslip {

// The accuracy cannot be had: why. Within -accuracy alone.
struct OutOfReach {
  std::string why;
};

struct AccuracyRequest {
  // Throws UsageError where what the user set leaves no choice.
  AccuracyRequest(const Options& options, double wanted);

  Options options;
  Scene scene;
  double wanted;
  Quantity of;
  std::vector<double> probes;  // where the end is interpolated
  bool has_space, grid_open, order_open, method_open, tolerance_open;
  // Distance of the corners of a spread medium or of a noisy start, whose third derivative jumps there; 0:
  // all smooth.
  double corner_distance;
  // At which order differences converge at the worst of those corners, and of what profiles jump or bend at:
  // 8 or less.
  int corner_order;
  // Cells of every grid are a multiple of it, so that profiles jump at nodes alone, and bend there where that
  // can be had.
  PetscInt mesh_divisor;

  // The method to begin with and what else is fixed from the start.
  Setting setting() const;
  // So many cells, or a few more, as nodes: on a ring of equal parts the same in each, with profiles' jumps
  // at nodes.
  PetscInt nodes(double cells) const;
};

double cells_of(const Scene& scene);

// One run that prepares another.
struct Level {
  Scene scene;
  double tolerance;
  Answer answer;
  std::int64_t steps, attempts;  // accepted; with those rejected
  double seconds;                // measured: decides whether there is time left, and nothing else
};

// The order of convergence to be expected beyond three grids from their two rates in a scheme of order p: the
// last one, or more while the rates still rise (`earlier` NaN where there is none).
double expected_order(double earlier, double last, double p);

// Runs of the scene by the method of `setting`, counted and timed.
class LevelRuns {
 public:
  LevelRuns(const AccuracyRequest& request, Setting& setting);

  // Throws OutOfReach where it fails. Collective.
  Level run(PetscInt n, double tolerance);
  // Whether a run of so many seconds is within what is left of accuracy_seconds.
  bool affords(double seconds) const;
  int count() const { return count_; }

  // Largest |difference| of what is wanted: of fields at the nodes of the coarser one, `between` them, where
  // a level may miss a front, and at the probes; beside a jump of psi alone. Above 0, so that ratios of them
  // are numbers.
  double difference(const Level& a, const Level& b, bool between = true) const;
  // The jump of the solution, if it has one, and what of a grid it takes.
  const std::optional<Jump>& jump() const { return jump_; }

  // Takes what a run that names no method takes at such tolerances (src/time/methods.hpp).
  void choose_method(double tolerance);
  // Whether an explicit run on n nodes takes less than an implicit one at `tolerance`, of which one was seen.
  bool prefers_explicit(const Level& seen, PetscInt n, double tolerance) const;
  void take_explicit();
  // After a run that failed: explicit steps for implicit ones, implicit ones where explicit ones were far too
  // many; false where neither may be had.
  bool take_other();
  const std::string& why() const { return why_; }  // this method, or ""
  bool friction_sets_steps() const { return friction_sets_steps_; }
  const Pilot& pilot() const { return pilot_; }

 private:
  Trial trial(const Setting& setting, double limit) const;
  std::vector<double> places(const Scene& scene) const;
  double step_seconds(const MethodSpec& method, PetscInt n) const;
  double explicit_steps(const Rates& rates) const;
  double explicit_seconds(const Rates& rates, PetscInt n) const;
  std::int64_t most_explicit_steps(PetscInt n) const;
  void take_implicit();

  const AccuracyRequest& request_;
  Setting& setting_;
  Pilot pilot_;
  std::optional<Jump> jump_;
  int count_ = 0;
  double spent_ = 0;
  bool friction_sets_steps_ = false;
  // What a run that names no method would take: implicit where the scene is stiff; else explicit.
  MethodSpec automatic_;
  double explicit_steps_seen_ = 0;  // of a run that was given up for them; 0: of none
  bool gave_up_implicit_ = false;
  std::string why_;
};

}  // namespace stickslip
