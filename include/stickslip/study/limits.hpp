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
// (step_forecast.hpp), shortest_theory, damps_theory, and as the counterpart of `limit` theory: waves on a
// motion whose friction stays at its steepest. What happens beyond `limit` and `followed` stands in `how` and
// `wrong`, and whether the program said so in `warned`: a run that fails without exit code 1 or a warning is
// in `silent`, and the chart itself warns of it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stickslip/options/options.hpp"
#include "stickslip/study/trial.hpp"

namespace stickslip {

struct TableText;  // src/output/table.hpp

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
