// Advancing the semi-discrete system in time by PETSc TS.
//
// Without any option the method is chosen from two frequencies of the scene at its start: that of the
// shortest wave, sqrt(A (K0 + K1 kappa^2_max)) or, where it is larger, the rate A N kappa^2_max of viscosity,
// and the rate of friction, max |A (B + F_psi)|. Where an accurate step is stable, the explicit Runge-Kutta
// pair 7vr is used (5dp where friction jumps at rest or steps are fixed); otherwise an implicit-explicit
// ARKIMEX method takes the stiff part implicitly. Every -ts_, -snes_, -ksp_, -pc_ option overrides the
// choice.
//
// imex_implicit says what an IMEX method takes implicitly:
//     friction  all pointwise terms (node by node, tile by tile); D2 psi explicit, that of viscosity too
//     wave      the linear constant terms (factored once while the step stands), viscosity among them; F and
//               g explicit
//     both      everything
//     none      nothing
// Explicit methods (rk, ssp, euler) take the whole right-hand side; rk takes all stages of a step tile by
// tile in the cache (rk_fused; docs/developers/performance.md), with PETSc's tableau, error control, options;
// methods that are fully implicit (theta, cn, beuler, bdf, rosw, ...) take everything implicitly.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/time/methods.hpp"

namespace stickslip {

// By how much a step may err: an unknown u by absolute + relative |u|, with numbers of its own for psi, eta
// and the state.
//
//     automatic   `parts` of the scene's own scales (model/scales.hpp), so that it does not matter in what
//                 units a scene is written; of a state that is a logarithm `relative` counts as of 1
//     as set      one number for all of them, in the units of each, as PETSc has it
struct Tolerances {
  static constexpr double usual = 1e-6;  // relative, and in parts of the scales

  std::array<double, 3> absolute{usual, usual, usual}, relative{usual, usual, usual};
  Scales scales;

  static Tolerances automatic(const Scales& scales, double relative, double parts) {
    Tolerances t;
    t.scales = scales;
    t.absolute = {parts * scales.psi, parts * scales.eta, parts * scales.state};
    t.relative.fill(relative);
    if (scales.state_is_logarithm) {
      t.absolute[2] += relative;
      t.relative[2] = 0;
    }
    return t;
  }
  static Tolerances as_set(const Scales& scales, double relative, double absolute) {
    Tolerances t;
    t.scales = scales;
    t.absolute.fill(absolute);
    t.relative.fill(relative);
    return t;
  }

  // Of a step as a whole: the relative one, and the absolute ones in parts of the scales.
  double largest() const { return over_all([](double a, double b) { return std::max(a, b); }); }
  double least() const { return over_all([](double a, double b) { return std::min(a, b); }); }
  // To which implicit equations are solved, in parts of scale and value, far below what a step may err by; at
  // least to near round-off.
  static constexpr double least_target = 1e-14;
  double solver_target() const { return std::clamp(1e-3 * least(), least_target, 1e-9); }

 private:
  template <class Choose>
  double over_all(const Choose& choose) const {
    double value = choose(relative[0], absolute[0] / scales.psi);
    value = choose(value, absolute[1] / scales.eta);
    return choose(value, absolute[2] / scales.state);
  }
};

// What an unknown of this value (psi 0, eta 1, the state 2) may be off by at the end of a step.
inline double allowed_error(const Tolerances& tolerances, int unknown, double value) {
  return tolerances.absolute[unknown] + tolerances.relative[unknown] * std::abs(value);
}

// The frequencies of a scene over the velocities that it will meet from its start u on, and whether one is
// far above everything that an accurate step resolves anyway. Collective.
struct Rates {
  double wave, friction;
  bool stiff_friction, stiff_wave;
  double own;  // of the scene (model/scales.hpp), which has one where nothing else does
  // The start of an adaptive run, and the step of a fixed one: well inside the stability region.
  double first_step() const { return 0.5 / std::max({wave, friction, 1e-3 * own}); }
};
Rates rates_of(const Model& model, Vec u);

enum class Implicit { none, friction, wave, both };
std::string to_string(Implicit implicit);

// The terms of the right-hand side that are taken explicitly and implicitly; nothing where there are none.
struct PartsOfStep {
  std::optional<Part> of_explicit, of_implicit;
};
PartsOfStep parts_of(Implicit implicit);

// Makes the time steppers of this program known to PETSc, so that -ts_type names them. After SlepcInitialize;
// every Integrator does it too.
void register_time_steppers();

// What ends a run on its way: a solution that is not finite, equations of a step that Newton's method does
// not solve.
class NotFinite : public Failure {
 public:
  using Failure::Failure;
};
class NotSolved : public Failure {
 public:
  using Failure::Failure;
};

// What a run did.
enum class Stop { end_time, max_steps, max_plate, asked };  // asked: by an observer

struct TimeReport {
  double t = 0;  // reached
  std::int64_t steps = 0, rejections = 0;
  long rhs_evaluations = 0;  // of the whole right-hand side or of parts of it
  std::string method;        // e.g. "rk:5dp"
  Implicit implicit = Implicit::none;
  Stop stop = Stop::end_time;  // why it went no further, where it came to a step's end
};

// Steps and rejections are counted in 64 bits, whatever the TS counts in.
class Integrator {
 public:
  // One accepted step. Everything is collective.
  struct Step {
    std::int64_t index;  // number of this step, 0 for the start
    double t_before, t;
    Vec u;           // at t; not to be changed
    double next_dt;  // proposed
    // u at a time in [t_before, t] that was announced by set_output_times, or at t
    std::function<void(double at, Vec into)> interpolate;
  };
  enum class Verdict { go_on, restart, stop };
  // Called at the start (index 0) and after every accepted step, which is finite. `restart`: forget what the
  // method remembers of earlier steps, so that a run restarted from here goes on alike.
  using Observer = std::function<Verdict(const Step&)>;

  // Sets the method up for the scene and its start u. `prefix` is put before the names of PETSc's options,
  // which tune what `method` leaves open. Throws UsageError for methods that do not work here. Collective.
  Integrator(const Model& model, const MethodSpec& method, Vec u, const std::string& prefix = "");
  ~Integrator();

  // Times at which the observer will interpolate: told ahead, so that only steps that hold one pay for it.
  // `next_time` gives the first one later than its argument, infinity where there is none.
  void set_output_times(std::function<double(double after)> next_time);

  // The clock of a plate that halts is kept there, where the caller sees it and may have set it to go on
  // from a checkpoint.
  void drive_by(struct Plate& plate);

  // Continues from a checkpoint: step number and size are taken as they were saved, whatever the options say.
  void continue_from(std::int64_t step, double dt);

  // Advances u from t to t_end (hit exactly) or through max_steps steps in all. Throws Failure where a step
  // is not finite or the method gives up; u is then the last state reached.
  TimeReport advance(Vec u, double t, double t_end, const Observer& observer,
                     std::int64_t max_steps = std::numeric_limits<std::int64_t>::max());

  // The length of the next step, as it is proposed; and how many are done, for those that follow.
  const Model& model() const;
  double next_step() const;
  void set_next_step(double dt);
  void count_from(std::int64_t steps);

  const TimeReport& report() const;  // as far as it has come; valid after a Failure too
  const Tolerances& tolerances() const;
  void set_tolerances(const Tolerances& tolerances);
  bool adaptive() const;  // does an error estimate choose the steps?
  const Method& method() const;
  TS ts() const;  // its options; it knows of no step but of PETSc's own types

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stickslip
