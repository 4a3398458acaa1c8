#include "stickslip/cycles/smooth_cycle.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "cycles/cell_field.hpp"
#include "cycles/cycle_waves.hpp"
#include "cycles/plane.hpp"
#include "numerics/mesh_solve.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/oscillator.hpp"

namespace stickslip {

namespace {

using std::size_t;

// The phase of a cycle through y, or under a load what the number q stands for.
Condition number_condition(const CellField& field, const std::vector<double>& y) {
  return field.periods() > 0 ? number_of(y.size()) : plane_across(field, y);
}

// With its residual, multipliers and errors; `estimate` is the relative one of the period, or under a load,
// whose period is known, of psi.
SmoothCycle finished(const std::shared_ptr<const CellField>& field, PeriodicEquations& equations,
                     const std::vector<double>& x, const std::vector<Condition>& conditions,
                     double estimate) {
  SmoothCycle result;
  result.field = field;
  result.mesh = equations.mesh();
  result.values.assign(x.begin(), x.begin() + long((result.mesh.size() - 1) * equations.block()));
  result.cycle = cycle_of(*field, result.mesh, result.values, field->period(equations.q(x)).T);
  const PeriodicEquations::Step step = equations.step(x, conditions);
  result.cycle.residual = step.residual;
  // round-off: what one more step of Newton's method would move the period by, and a few units of the last
  // place
  const double noise = std::abs(step.dx[x.size() - size_t(equations.parameters())]);
  result.cycle.error_estimate = estimate + 4 * noise + 4e-15;
  set_multipliers(result);
  return result;
}

}  // namespace

void check_smooth_cell(const Scene& cell) {
  const CellField field(cell, cell.forced() ? 1 : 0);
  if (field.dim() > most_cell_unknowns)
    throw UsageError("a cycle of " + std::to_string(field.dim()) + " unknowns: at most " +
                     std::to_string(most_cell_unknowns) +
                     " are solved for; take fewer nodes (grid_n) or a smaller "
                     "cycle_cell");
}

SmoothCycle solve_cycle(const Scene& cell, const CycleGuess& guess, double tolerance) {
  const auto field = std::make_shared<const CellField>(cell, guess.periods);
  const size_t d = size_t(field->dim());
  const auto profile = [&](double phase, double* y) {
    std::vector<double> natural(field->nodes() * size_t(field->dof()));
    guess.at(phase, natural.data());
    const std::vector<double> here = in_band_order(*field, natural.data());
    std::copy(here.begin(), here.end(), y);
  };
  std::vector<double> start(d);
  profile(0, start.data());
  const std::vector<Condition> phase{number_condition(*field, start)};
  using Solution = MeshSolution<PeriodicEquations>;
  const auto solve = [&](Solution& s) {
    const PeriodicEquations::Newton newton = s.equations.newton(s.x, phase);
    s.last_step = newton.last_step;
    return newton.converged;
  };
  Solution s{PeriodicEquations(guess.mesh, field), {}};
  s.x = s.equations.fill(profile, guess.periods > 0 ? start[0] : std::log(guess.period));
  const double unit = field->unit(0);  // of psi
  const auto change = [&](const Solution& coarse, const Solution& fine) {
    return field->periods() > 0 ? std::abs(coarse.q() - fine.q()) / unit
                                : std::abs(std::expm1(coarse.q() - fine.q()));
  };
  if (solve(s))
    if (auto found = solve_to_accuracy<PeriodicEquations>(
            solve, std::move(s), {tolerance, d > 3 ? 8. : 12., field->velocities(), {}, change, "the cycle"}))
      return finished(field, found->solution.equations, found->solution.x, phase, found->estimate);
  throw Failure("Newton's method does not converge to a cycle of period near " + rounded_text(guess.period));
}

namespace {

// The uniform cycle that a slip of this size settles on. Throws Failure where it settles on none.
SmoothCycle cycle_of_slip(const Scene& node, const Oscillator& oscillator, double tolerance, double slip) {
  const Orbit orbit = find_orbit(oscillator, 1, 1e-5, slip);
  const int dof = oscillator.dim();
  const CycleGuess guess{orbit.period,
                         [&](double phase, double* y) {
                           double at[train_max_dim];
                           orbit.at(phase, at);
                           y[0] = at[0];
                           y[1] = oscillator.eta(1, at);
                           if (dof == 3) y[2] = at[2];
                         },
                         orbit.mesh};
  return solve_cycle(node, guess, tolerance);
}

// Where sliding is stable a cycle may live beside it, out of reach of the slip that was tried: stronger ones,
// in friction forces above sliding.
constexpr double stronger_slips[] = {2, 4, 10, 30};

std::optional<SmoothCycle> cycle_of_stronger_slips(const Scene& node, const Oscillator& oscillator,
                                                   double tolerance) {
  for (const double slip : stronger_slips) {
    try {
      SmoothCycle found = cycle_of_slip(node, oscillator, tolerance, slip);
      if (growth_rate(found.cycle) < 0) return found;
    } catch (const Failure&) {
      continue;  // the next one
    }
  }
  return std::nullopt;
}

}  // namespace

SmoothCycle uniform_cycle(const Scene& scene, double tolerance, double slip) {
  Scene node = scene;
  node.n = 1;
  node.left = node.right = End::periodic;
  node.length = scene.form == Form::chain ? 1 : scene.h();
  const Oscillator oscillator(node);
  const bool strong = slip > 1;  // strong slips were tried already
  // the cubic's cycle, and beyond its Hopf point none (Lienard)
  const bool only_one = !std::isnan(oscillator.v_c());
  std::optional<SmoothCycle> found;
  std::string why;
  try {
    found = cycle_of_slip(node, oscillator, tolerance, slip);
    if (strong || only_one || growth_rate(found->cycle) < 0) return *found;
  } catch (const Failure& e) {
    if (strong || only_one) throw Failure(std::string("no cycle: ") + e.what());
    why = e.what();
  }
  if (std::optional<SmoothCycle> stronger = cycle_of_stronger_slips(node, oscillator, tolerance))
    return *stronger;
  if (found) return *found;
  // what becomes of a slip in the end is said by the steps of a run
  std::vector<double> start = CellField(node).sliding();
  start[1] += slip * (start[1] - node.B() * node.v);  // a force of friction above sliding
  try {
    return settled_cycle(node, start, turns_to_settle, tolerance);
  } catch (const Failure& e) {
    throw Failure(e.what() + ("; " + why));
  }
}

namespace {

CycleGuess guess_of(const SmoothCycle& slide, const Scene& cell) {
  CycleGuess guess;
  guess.periods = 1;
  guess.period = cell.forcing_period();
  guess.mesh = slide.mesh;
  guess.at = [&slide, d = size_t(slide.field->dim())](double phase, double* y) {
    std::vector<double> there(d);
    evaluate(Collocation::gauss5(), slide.mesh, slide.values.data(), int(d), phase, there.data());
    unfold(*slide.field, there.data(), y);
  };
  return guess;
}

}  // namespace

SmoothCycle forced_slide_near(const SmoothCycle& other, const Scene& cell, double tolerance) {
  return solve_cycle(cell, guess_of(other, cell), tolerance);
}

SmoothCycle forced_slide(const Scene& cell, double tolerance) {
  constexpr int intervals = 12;
  constexpr double least_step = 1. / 64, rough = 1e-4;  // what is only on the way need not be known well
  CycleGuess guess;
  guess.periods = 1;
  guess.period = cell.forcing_period();
  for (int i = 0; i <= intervals; ++i) guess.mesh.push_back(double(i) / intervals);
  const CellField at_rest_of_load(cell, 1);
  const std::vector<double> sliding = at_rest_of_load.sliding();
  guess.at = [&](double, double* y) { unfold(at_rest_of_load, sliding.data(), y); };
  SmoothCycle found;
  Scene scene = cell;
  for (double grown = 0, step = 1; grown < 1;) {
    scene.load = cell.load.scaled(grown + step);
    scene.normal = cell.normal.scaled(grown + step);
    try {
      found = solve_cycle(scene, guess, grown + step < 1 ? rough : tolerance);
    } catch (const Failure&) {
      if ((step /= 2) < least_step) throw;
      continue;
    }
    grown += step;
    guess = guess_of(found, cell);
  }
  return found;
}

}  // namespace stickslip
