// `chart_kind error`: the same scene by many methods, tolerances, stencil orders and grids: error against
// seconds.
//
// Errors are largest |differences| of psi and eta over the nodes at ts_max_time:
//     error        against the solution of the differential equation, in space and time
//     error_time   against the same semi-discrete system, solved without an error in time
//     error_space  of that solution against the differential equation
// The chain is no differential equation in x, nor is a start that lives on one grid: there error is
// error_time. With chart_of they are errors of one quantity instead: psi and eta at a place, the speed of
// waves, the period, the amplitude, or the times at which events begin and end; a row with other events than
// the reference has failed.
//
// The reference is solved on grids doubled at the highest order until its error, estimated from the last two
// differences and their measured rate (and from two methods in time), is far below that of every row; a row
// whose error is less than 100 times that is dropped with a note. seconds: processor time, median of the
// repetitions. Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.10 (such
// diagrams); Richardson's extrapolation.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

struct TableText;  // src/output/table.hpp

struct ChartRow : Outcome {  // failed: "" or why there is no error
  Setting setting;
  std::string method, implicit;  // as run
  std::optional<double> error, error_time, error_space;
  int repeats = 0;
  bool best = false;  // of chart_front()
};

// The rows that no other beats: no row has a smaller or equal error in less or equal time (of equals the
// first stands). By increasing seconds.
std::vector<std::size_t> chart_front(const std::vector<ChartRow>& rows);

// The methods that option chart_methods lists, or those of these names. Throws UsageError.
std::vector<MethodSpec> chart_methods(const Options& options, std::vector<std::string> names);

// The settings of a chart, in the order of its rows: methods, orders, grids, tolerances (or steps), as listed
// by the options or by default. Throws UsageError.
std::vector<Setting> chart_settings(const Options& options);

std::vector<TableText> chart_tables();  // of what it writes
// Body of `stickslip chart`. Returns the exit code. Collective.
int chart_errors(const Options& options);

// `chart_kind limits`: where each method fails in a scene.
//
// Every method runs the scene with fixed steps, longer and longer, and bisection finds
//   limit     the longest step up to which every run reached its end with psi no further out than twice the
//             truth;
//   followed  the longest step up to which every run had the true regime, its amplitude to 10 % and its wave
//             speed to 2 %;
//   shortest  the step from which on the shortest wave about steady sliding, one up and down from node to
//             node, grows falsely, by 2 % of its frequency more than it should: runs from sliding with noise
//             of 1e-11;
//   damps     the step from which on no perturbation of steady sliding grows although it should: runs that
//             start from sliding with noise of 1e-8 and take 160 steps.
// Beside them stand, from the spectrum of the linearised operator and the method's own propagator
// (step_audit.hpp), shortest_theory, damps_theory, and as the counterpart of `limit` theory: waves on a
// motion whose friction stays at its steepest. What happens beyond `limit` and `followed` stands in `how` and
// `wrong`, and whether the program said so in `warned`: a run that fails without exit code 1 or a warning is
// in `silent`, and the chart itself warns of it.
struct LimitRow {
  std::string method, implicit;
  int order = 0;
  PetscInt n = 0;
  double value = 0;  // of chart_parameter
  // empty: none found
  std::optional<double> theory, limit, followed, shortest_theory, shortest, damps_theory, damps;
  std::string how, wrong;  // "" where nothing went wrong up to the longest step
  bool warned = true;
  std::vector<double> silent;  // steps
  int runs = 0;
  double longest = 0;  // step tried
};

// The rows of one grid: options hold grid_n, grid_order and everything else. Collective.
class Limits {
 public:
  // Runs the scene accurately. Throws Failure where that fails.
  explicit Limits(const Options& options);
  ~Limits();
  LimitRow row(const MethodSpec& method);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

std::vector<TableText> limit_tables();  // of what it writes
// Body of `stickslip chart -chart_kind limits`. Returns the exit code. Collective.
int chart_limits(const Options& options);

}  // namespace stickslip
