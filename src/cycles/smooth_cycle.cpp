#include "stickslip/cycles/smooth_cycle.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "cycles/cell_field.hpp"
#include "cycles/deviations.hpp"
#include "cycles/plane.hpp"
#include "cycles/profile.hpp"
#include "numerics/kinks.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/oscillator.hpp"

namespace stickslip {

namespace {

using std::size_t;

// The largest change of a value, each component in units of its range (at least 1e-3), at the points of the
// finer mesh.
double change_of_profile(const PeriodicEquations& coarse, const std::vector<double>& x,
                         const PeriodicEquations& fine, const std::vector<double>& y) {
  const size_t d = size_t(fine.dim()), count = y.size() / d * d;
  const std::vector<double> from = fine.fill(coarse, x);
  std::vector<double> low(d, 1e300), high(d, -1e300);
  for (size_t i = 0; i < count; ++i) {
    low[i % d] = std::min(low[i % d], y[i]);
    high[i % d] = std::max(high[i % d], y[i]);
  }
  double change = 0;
  for (size_t i = 0; i < count; ++i)
    change = std::max(change, std::abs(from[i] - y[i]) / std::max(high[i % d] - low[i % d], 1e-3));
  return change;
}

// Nodes of the mesh at the kinks of the motion; what a change by halving is to be divided by.
double converge(const std::shared_ptr<const CellField>& field, PeriodicEquations& problem,
                std::vector<double>& x, const std::vector<Condition>& phase) {
  std::vector<int> velocities;
  for (int a = 0; a < field->dim(); a += field->dof()) velocities.push_back(a);
  const auto jacobian = [&](const double* y, double* J) { field->jacobian(y, J); };
  return settle_on_kinks(
      {[&]() -> const std::vector<double>& { return problem.mesh(); },
       [&] { return kinks_of(problem.mesh(), x.data(), field->dim(), velocities, jacobian); },
       [&](std::vector<double> mesh) {
         PeriodicEquations better(std::move(mesh), field);
         std::vector<double> y = better.fill(problem, x);
         if (!better.newton(y, phase).converged) return false;
         problem = std::move(better);
         x = std::move(y);
         return true;
       }});
}

// With its residual, multipliers and errors; `estimate` is the relative one of the period.
SmoothCycle finished(const std::shared_ptr<const CellField>& field, PeriodicEquations& equations,
                     const std::vector<double>& x, const std::vector<Condition>& conditions,
                     double estimate) {
  SmoothCycle result;
  result.field = field;
  result.mesh = equations.mesh();
  result.values.assign(x.begin(), x.begin() + long((result.mesh.size() - 1) * equations.block()));
  result.cycle = cycle_of(*field, result.mesh, result.values, std::exp(equations.q(x)));
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
  const CellField field(cell);
  if (field.dim() > most_cell_unknowns)
    throw UsageError("a cycle of " + std::to_string(field.dim()) + " unknowns: at most " +
                     std::to_string(most_cell_unknowns) +
                     " are solved for; take fewer nodes (grid_n) or a smaller "
                     "cycle_cell");
}

SmoothCycle solve_cycle(const Scene& cell, const CycleGuess& guess, double tolerance) {
  const auto field = std::make_shared<const CellField>(cell);
  const size_t d = size_t(field->dim());
  const auto profile = [&](double phase, double* y) {
    std::vector<double> natural(d);
    guess.at(phase, natural.data());
    const std::vector<double> here = in_band_order(*field, natural.data());
    std::copy(here.begin(), here.end(), y);
  };
  std::vector<double> start(d);
  profile(0, start.data());
  const std::vector<Condition> phase{plane_across(*field, start)};
  PeriodicEquations problem(guess.mesh, field);
  std::vector<double> x = problem.fill(profile, std::log(guess.period));
  const std::string none =
      "Newton's method does not converge to a cycle of period near " + rounded_text(guess.period);
  if (!problem.newton(x, phase).converged) throw Failure(none);
  double least = d > 3 ? 8 : 12;
  for (int round = 0; round < 12; ++round) {
    // the motion to 1e-9 of its range or the tolerance asked for, whichever is finer, within reason
    const std::vector<double> rough = roughness(problem.mesh(), x.data(), int(d));
    const double wanted = intervals_for(problem.mesh(), rough, std::max(tolerance, 1e-12) * 10);
    const size_t intervals = size_t(std::min(20000., std::max(least, .5 * wanted)));
    least = 1.5 * double(intervals);  // should there be a next round
    PeriodicEquations better(equidistribute(problem.mesh(), rough, intervals), field);
    std::vector<double> y = better.fill(problem, x);
    if (!better.newton(y, phase).converged) continue;  // too coarse
    problem = better;
    x = y;
    const double gain = converge(field, problem, x, phase);
    PeriodicEquations finer(halved(problem.mesh()), field);
    std::vector<double> z = finer.fill(problem, x);
    const PeriodicEquations::Newton last = finer.newton(z, phase);
    if (!last.converged) continue;
    const double estimate = std::abs(std::expm1(problem.q(x) - finer.q(z))) / gain;
    const double profile_error = change_of_profile(problem, x, finer, z) / 32;
    if (estimate <= tolerance && profile_error <= std::max({1e-9, tolerance, last.last_step}))
      return finished(field, finer, z, phase, estimate);
    if (finer.mesh().size() > 40000)
      throw Failure("the cycle needs more than " + std::to_string(finer.mesh().size()) + " mesh intervals");
  }
  throw Failure(none);
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
  throw Failure("no cycle: " + why + "; no stronger slip settles on one");
}

}  // namespace stickslip
