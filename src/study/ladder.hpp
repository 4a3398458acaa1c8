// The bricks of -accuracy (accuracy.hpp): what is asked and left open, the short runs that prepare a run, and
// what a ladder of such runs, its levels, must know.
#pragma once

#include <algorithm>
#include <memory>
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

// One run of a ladder.
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

  // A run; `failed` says why it has no fields, "" where it has.
  Level run(PetscInt n, double tolerance, std::string& failed);
  // Throws OutOfReach where it fails.
  Level run(PetscInt n, double tolerance);
  // Whether a run of so many seconds is within what is left of accuracy_seconds.
  bool affords(double seconds) const;
  int count() const { return count_; }

  // Largest |difference| of what is wanted; of fields at the nodes of the coarser one, `between` them, where
  // a level may miss a front, and at the probes; beside a jump of psi alone. Above 0, so that ratios of them
  // are numbers.
  double difference(const Level& a, const Level& b, bool between = true) const;
  // The jump of the solution, if it has one.
  const std::optional<Jump>& jump() const { return jump_; }

  // Takes what a run that names no method takes at such tolerances (src/time/methods.hpp).
  void choose_method();
  // Whether an explicit run on n nodes takes less than an implicit one at `tolerance`, of which one was seen.
  bool prefers_explicit(const Level& seen, PetscInt n, double tolerance) const;
  void take_explicit();
  const std::string& why() const { return why_; }  // this method, or ""
  bool friction_sets_steps() const { return friction_sets_steps_; }
  const Pilot& pilot() const { return pilot_; }

 private:
  Trial trial(const Setting& setting, double limit) const;
  double step_seconds(const MethodSpec& method, PetscInt n) const;
  double explicit_seconds(const Rates& rates, PetscInt n) const;
  double seen_difference(const Level& a, const Level& b, bool between) const;
  double difference_beside_jump(const Level& coarse, const Level& fine) const;

  const AccuracyRequest& request_;
  Setting& setting_;
  Pilot pilot_;
  std::optional<Jump> jump_;
  int count_ = 0;
  double spent_ = 0;
  bool friction_sets_steps_ = false;
  std::string why_;
};

// Where the method, the tolerance and the grid of a run come from. All collective; all throw OutOfReach.
class Ladder {
 public:
  Ladder(const AccuracyRequest& request, Setting& setting, LevelRuns& runs)
      : request_(request), setting_(setting), runs_(runs), aim_(request.wanted) {}
  virtual ~Ladder() = default;
  // Climbs until the run is predicted; what it chose stands in the setting.
  virtual void choose() = 0;
  // The error of a run with the setting, from what it ended with.
  virtual double estimate(const Answer& end) = 0;
  // Makes the setting stricter, for the run of the last estimate().
  virtual void refine() = 0;
  // Puts the best level into the setting, after OutOfReach; false where there is none that predicts an error.
  virtual bool confirm() = 0;
  // What is predicted of the run, for what().
  virtual std::string predicted() const = 0;

 protected:
  // Errors fall with the tolerance as they do where nothing is stiff and no threshold is crossed.
  bool smooth() const { return setting_.method.can().is_explicit && request_.scene.friction.smooth(); }
  // The power of the tolerance that they fall with, as a rule.
  double slope_in_time() const { return smooth() ? 1 : 0.75; }
  // Of the run and the last level, whose error is predicted: a single number may come near by chance.
  double difference_of_run(double predicted_of_last) const;
  // By how much the error falls at most from one level to another.
  virtual double steepest_fall(const Level& from, const Level& to) const = 0;
  void add(Level made);
  void begin_anew();
  [[noreturn]] void give_up_in_time(double tolerance, double error) const;

  const AccuracyRequest& request_;
  Setting& setting_;
  LevelRuns& runs_;
  double aim_;                     // below the request after a refinement
  std::vector<Level> levels_;      // coarse to fine, loose to strict
  std::vector<double> distances_;  // of levels k and k + 1: the error of level k
  Level last_run_;                 // what estimate() saw
  double last_estimate_ = 0;
};

std::unique_ptr<Ladder> grid_ladder(const AccuracyRequest& request, Setting& setting, LevelRuns& runs);
std::unique_ptr<Ladder> tolerance_ladder(const AccuracyRequest& request, Setting& setting, LevelRuns& runs);

// Parts of the accuracy: the error predicted in space, that in time beside it or where nothing else errs, and
// what the error in time of a level may be of that in space.
constexpr double share_of_space = 0.35, share_of_time = 0.1, share_in_all = 0.55, share_of_level = 0.1;
constexpr double loosened = 30;  // the tolerance that tells what a tolerance costs, over that of the level
constexpr double least_tolerance = 1e-14;

}  // namespace stickslip
