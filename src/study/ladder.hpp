// The bricks of -accuracy (accuracy.hpp): what it is wanted of, what lies in its way, and the short runs that
// prepare a run.
#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/base/error.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/study/start.hpp"
#include "stickslip/study/trial.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

// What friction that is made of pieces costs methods of high order: with k continuous derivatives of friction
// the rates have k, and where a motion passes from piece to piece the error of one step in time is of order
// k + 2, that of differences along x integrates to the same. So passages, whose number does not grow with
// that of the steps, leave order k + 2.
inline void warn_of_pieces(const Scene& scene) {
  const FrictionParameters& friction = scene.friction;
  if (friction.piecewise())
    warn("friction_law " + to_string(friction.law) + ": its slope has corners, at which every method of a " +
         "higher order is of order " + std::to_string(friction.law->continuous_derivatives + 2) +
         ", in time and along x");
}

// What errors are of (-accuracy_of, chart_of).
struct Quantity {
  enum class Kind { fields, probe, speed, period, amplitude, events };
  Kind kind = Kind::fields;
  double x = 0;  // of the probe

  // As this option has it. Throws UsageError where it is none of these.
  static Quantity from(const Options& options, const std::string& option);

  // Numbers, of which errors may pass through zero from one level of a ladder to the next; not the largest
  // over a field.
  bool is_number() const { return kind != Kind::fields; }
  // Seen on the way, not read from the end.
  bool is_measured() const { return kind != Kind::fields && kind != Kind::probe; }
  // Where fields are interpolated at the end.
  std::vector<double> places(const Options& options) const;
  // Makes what measures it; nullptr where it is read from the end.
  MeasureMaker measure(const Options& options) const;
  std::string name() const;  // for messages
  // What to say of a motion in which there is none.
  std::string missing() const { return "the motion has no " + name() + " to measure"; }
  // Largest |difference| of what was measured; infinity where one has more of it than the other.
  static double difference(const std::vector<double>& one, const std::vector<double>& other);
};

// Data of the continuum that do not fit a held end: psi jumps there at t = 0, and the exact solution carries
// the jump inwards at the speed c, along x = c t (from the right end, x = L - c t), and never smears it (nu =
// 0).
//
// With J = psi behind less psi ahead, on the characteristic  dJ/dt = -(A a [F(psi + J) - F(psi)] + s delta
// J)/2,  psi, a and the state ahead of it: the waves that cross it are continuous, and so is the state, whose
// rate is bounded. What is ahead no signal from the end has reached: it is the same scene with a free end
// there.
//
// Finite differences of order p converge behind it, in psi, like h^(p/(p+1)) where friction damps the short
// waves that they shed there, like h^(1/2) where it does not; eta, which carries a mass along it, not at all.
class Jump {
 public:
  // Where one end has such data, and one alone.
  static std::optional<Jump> of(const Scene& scene, const Start& start);

  // Where it is; it goes to and fro between the ends.
  double x(double t) const;
  // The part of the scene about it in which differences on a grid follow nothing: ahead of it six times h (c
  // t/h)^(1/(p+1)), beyond which less than 1e-6 of it is left; behind it a twentieth of the scene, or a
  // quarter of the way that it has gone where that is less.
  struct Extent {
    double from, to;
    bool covers(double place) const { return place > from && place < to; }
  };
  Extent extent(const Scene& grid, double t) const;
  // The fewest cells on which it reaches no farther ahead than behind.
  double least_cells(int order, double t) const;
  // By how much psi behind exceeds psi ahead at ts_max_time; empty once it has met the other end, or where
  // friction differs along x by more than its amplitude. Costs a run on the setting's grid. Collective.
  std::optional<double> height(const Options& options, const Setting& setting) const;

 private:
  Jump(const Scene& scene, bool from_left, double height)
      : scene_(scene), from_left_(from_left), start_(height) {}
  double ahead(const Scene& grid, double t) const;
  double behind(double t) const { return std::min(scene_.length / 20, scene_.c * t / 4); }

  Scene scene_;
  bool from_left_;
  double start_;
};

// What the start of a scene tells before it is run, found by every rank alone.
class SceneAtStart {
 public:
  // The start is found once. Throws what Start does. Collective where that is.
  SceneAtStart(const Options& options, const Scene& scene);

  // The longest step, ts_adapt_dt_max: as the user set it; for rk:7vr, which is stable for all decaying modes
  // of |lambda| dt < 4.5, just below that of the shortest wave. Steps left to the error estimate alone go
  // beyond it, are rejected, and leave noise in the shortest waves (docs/chart.md). 0: none.
  double longest_step(const Setting& setting) const;

  // The scene at its start on a grid.
  struct OnGrid {
    Model model;
    Rates rates;
  };
  OnGrid on(int order, PetscInt n) const;
  // The method of a run of this tolerance that names none, as Integrator chooses it; where that is explicit,
  // rk:7vr.
  MethodSpec automatic(const OnGrid& start, double tolerance) const;
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

// How the errors of ever finer levels fall, like fineness^-p, told by how far neighbours are apart.
struct FallingErrors {
  std::vector<double> fineness, distances;  // of levels k and k + 1: the error of level k
  double best = 0;                          // no order is higher
  double unseen = 0;                        // the order while there are two levels
  bool steady = false;                      // the order is what it is from the beginning, `least` or more
  double least = 0;

  double error(std::size_t k) const;  // of level k
  double rate(std::size_t k) const;   // from level k - 1 to level k
  double order_between() const;       // expected between the last two levels
  double order_beyond() const;        // and beyond the last
  double predicted(double at) const;  // error at this fineness
};

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
  const SceneAtStart& at_start() const { return at_start_; }

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
  SceneAtStart at_start_;
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
