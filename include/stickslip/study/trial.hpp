// One run of a scene by one method on one grid, kept in memory: its solution at the end, its price, or why it
// failed. The bricks of `chart` and of `accuracy`.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/output/probe.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/time.hpp"

namespace stickslip {

struct Setting {
  MethodSpec method;
  double tolerance = 1e-6;  // of a step: relative, and in parts of the scene's scales (scales.hpp)
  double step = 0;          // ts_dt of a method without an error estimate, in units of time
  int order = 4;            // of the second difference in space
  PetscInt n = 0;           // nodes
  double eps = 0;           // over which a threshold is smoothed (friction_eps); 0: as the scene has it
  // Accepted and rejected steps after which a run is given up.
  std::int64_t most_attempts = std::numeric_limits<std::int64_t>::max();
};

// Why a run has no answer.
enum class Fault { none, too_slow, too_many_steps, not_finite, not_solved, failed };

// What a run came to.
struct Outcome {
  Fault fault = Fault::none;
  std::string failed;  // why, in words
  TimeReport report;   // as far as it came
  // of processor time, from setting the method up to the end, the largest over the ranks
  double seconds = 0;
  std::vector<std::string> warnings;
  bool is_answer() const { return fault == Fault::none; }
  void fail(Fault of, const std::string& why) {
    fault = of;
    failed = why;
  }
};

// psi and eta at every node, on every rank; and, in a continuum whose friction differs along x, what
// interpolation between nodes needs (probe.hpp): the stored state, if there is one, and the force of friction
// a F.
struct Fields {
  std::vector<double> psi, eta, state, friction;
};

// What a run ends with, and what was measured on its way.
struct Answer {
  Fields fields;
  std::vector<double> measured;
};

// The fields of all nodes of the scene, with the friction that belongs to them; `state` as stored, {} without
// a state law.
Fields fields_with_friction(const Scene& scene, std::vector<double> psi, std::vector<double> eta,
                            std::vector<double> state);

struct Trial : Outcome {
  Fields end;                    // empty where it failed
  std::vector<double> measured;  // what was to be measured beside it
};

// Processor time of this process so far; collectively the largest over the ranks.
double processor_seconds();
double largest_processor_seconds();

// Option ts_max_steps, which may be more than an int holds; where it is unset as many as can be counted.
std::int64_t most_steps(const Options& options);

// The options of the scene on another grid: grid_n and grid_order are set. And the scene.
Options options_for(const Options& options, const Setting& setting);
Scene on_grid(Scene scene, PetscInt n, int order);

// Runs from the scene's start to ts_max_time. PETSc's options are read with `prefix`. A computation that
// fails, or that would take more than `limit` seconds, is reported as its fault; warnings are kept and not
// printed. `measure`, if given, makes an observer of the run. Throws UsageError where scene or start cannot
// be had on this grid. Collective.
Trial run_trial(const Options& options, const Setting& setting, const std::string& prefix, double limit,
                const MeasureMaker& measure = nullptr);

// Sets up what each of the settings needs and throws UsageError where that cannot be had: to be called before
// any work. Warnings about the start are printed, once. Collective.
void check_settings(const Options& options, const std::vector<Setting>& settings);

// u at the nodes of the whole scene of n nodes, of which the model may be one of several equal cells.
// Collective.
Fields fields_of(const Model& model, Vec u, PetscInt n);

// Whether the solution is that of a differential equation in x, which a finer grid comes nearer to: not for
// the chain, not for a start that lives on one grid (a file, or init_noise drawn node by node).
bool has_grid_limit(const Options& options, const Scene& scene);

// The orders in space that the scene can be solved with.
std::vector<int> possible_orders(const Scene& scene);

// psi and eta interpolated: sums with the weights of `row`, of which eta - a F and F are those of eta
// (probe.hpp), where the fields have friction and the row has more than one node; `here` is then friction
// where the point is, at its `place`.
struct Point {
  double psi, eta;
};
Point combined(const Fields& fields, const Combination& row, const FrictionAt& here, std::size_t place);

// psi and eta of one grid at any points, or at the nodes of another over the same length, as probes
// interpolate.
Fields at_points(const Fields& fields, const Scene& scene, const std::vector<double>& x);
Fields resample(const Fields& fields, const Scene& from, const Scene& to);
// Largest |difference| of psi and eta.
double distance(const Fields& a, const Fields& b);

}  // namespace stickslip
