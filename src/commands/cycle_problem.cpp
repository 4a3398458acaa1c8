#include "commands/cycle_problem.hpp"

#include <algorithm>
#include <cmath>

#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/study/start.hpp"

namespace stickslip {

namespace {

// Waves looked at for each cycle of a branch.
constexpr int wavenumbers_of_branch = 50;

bool has_neighbours(const Options& options) { return options.integer("cycle_cell") > 0; }

bool alone(const Options& options, const Scene& cell) {
  return !has_neighbours(options) || !(cell.mean_K1() > 0);
}

bool one_node(const Scene& cell) { return cell.n == 1; }

std::vector<double> positions(const Scene& cell) {
  std::vector<double> x;
  for (PetscInt i = 0; i < cell.n; ++i)
    if (!cell.held(i)) x.push_back(cell.x(i));
  return x;
}

CycleBranch smooth_branch(const Options& options, const SmoothCycle& first, const std::string& name,
                          double to, int steps, bool with_waves) {
  const double from = options.real(name);
  const auto cell_at = [options, name](double value) { return cell_of_options(options.with(name, value)); };
  const std::unique_ptr<CycleFamily> path = smooth_family(cell_at, from, std::abs(to - from), first);
  CycleWatch watch;
  if (with_waves)
    watch = [&path](double, const Cycle&) {
      return watch_waves(bloch_spectrum(smooth_candidate(*path), wavenumbers_of_branch));
    };
  return continue_cycle(*path, {name, from, to, steps}, watch);
}

FoundCycle smooth(const Options& options, const Scene& cell, const SmoothCycle& cycle) {
  const auto found = std::make_shared<const SmoothCycle>(cycle);
  FoundCycle result{found->cycle, positions(cell),      found->mesh.size() - 1,
                    nullptr,      alone(options, cell), nullptr};
  if (has_neighbours(options)) result.waves = [found](int count) { return bloch_spectrum(*found, count); };
  result.branch = [options, found](const std::string& name, double to, int steps, bool with_waves) {
    return smooth_branch(options, *found, name, to, steps, with_waves);
  };
  return result;
}

CycleBranch stick_branch(const Options& options, const StickCycle& first, const std::string& name, double to,
                         int steps, bool with_waves) {
  const double from = options.real(name);
  const auto cell_at = [options, name](double value) { return cell_of_options(options.with(name, value)); };
  const std::unique_ptr<CycleFamily> path = stick_family(cell_at, from, std::abs(to - from), first);
  CycleWatch watch;
  if (with_waves)
    watch = [&path, cell_at](double value, const Cycle& cycle) {
      return watch_waves(
          bloch_spectrum(stick_candidate(*path), cycle, cell_at(value), wavenumbers_of_branch));
    };
  return continue_cycle(*path, {name, from, to, steps}, watch);
}

[[noreturn]] void refuse_fate(const std::string& none, const StickFate& fate) {
  if (!fate.why.empty()) throw Failure(none + ": the motion " + fate.why);
  throw Failure(none + ": the motion " + to_string(fate.fate) + " (looked at for a time of " +
                rounded_text(fate.time) + ")");
}

FoundCycle sticking(const Options& options, const Scene& cell, const StickCycle& stick) {
  FoundCycle result{described(cell, stick), positions(cell), 0, nullptr, alone(options, cell), nullptr};
  if (has_neighbours(options) && !cell.forced())
    result.waves = [cell, course = result.cycle, stick](int count) {
      return bloch_spectrum(stick, course, cell, count);
    };
  result.branch = [options, stick](const std::string& name, double to, int steps, bool with_waves) {
    return stick_branch(options, stick, name, to, steps, with_waves);
  };
  return result;
}

FoundCycle sticking(const Options& options, const Scene& cell) {
  const bool uniform = one_node(cell) && has_neighbours(options);
  const StickFate fate = uniform ? uniform_stick_fate(cell) : stick_fate(cell, start_of_cell(options, cell));
  if (fate.fate != Fate::repeats) refuse_fate("no cycle with rests", fate);
  return sticking(options, cell, fate.cycle);
}

// Under a load: the cycle with rests that the motion settles on, or one that never stops.
FoundCycle sticking_under_load(const Options& options, const Scene& cell) {
  const StickFate fate = forced_stick_fate(cell, start_of_cell(options, cell));
  if (fate.fate == Fate::repeats) return sticking(options, cell, fate.cycle);
  if (fate.fate != Fate::oscillates) refuse_fate("no cycle", fate);
  std::vector<double> start = fate.cycle.start;
  start.pop_back();  // the time
  const SmoothCycle found = settled_cycle(cell, start, turns_to_settle);
  if (!(least_along(found.cycle, cell.v) > 0))
    throw Failure("no cycle: the motion slides without a stop, and the cycle beside it would stop");
  return smooth(options, cell, found);
}

}  // namespace

Scene cell_of_options(const Options& options) {
  Scene scene = Scene::from(options);
  const PetscInt cell = options.integer("cycle_cell");
  if (cell == 0) return scene;
  const std::string which = "cycle_cell " + std::to_string(cell) + ": ";
  if (scene.has_profile())
    throw UsageError(which + "with a profile along x no cell repeats; cycle_cell 0 takes the whole scene");
  const std::vector<double> amplitude = friction_amplitude(scene, 0, scene.n);
  if (std::any_of(amplitude.begin(), amplitude.end(), [](double a) { return a != 1; }))
    throw UsageError(
        which +
        "where the amplitude of friction differs from node to node no cell repeats; cycle_cell 0 "
        "takes the whole scene");
  if (scene.any_held())
    throw UsageError(which +
                     "with a held end all nodes move differently; cycle_cell 0 takes the whole scene");
  if (cell > 1 && !scene.ring())
    throw UsageError(
        which +
        "several nodes repeat on a ring only; cycle_cell 1: all nodes move in the same way, 0: the "
        "whole scene");
  scene.length = cell == 1 && scene.form == Form::chain ? 1 : scene.h() * double(cell);
  scene.n = cell;
  scene.left = scene.right = End::periodic;
  return scene;
}

std::vector<double> start_of_cell(const Options& options, const Scene& cell) {
  const Model model(PETSC_COMM_SELF, cell);
  const VecHandle u = model.create_vector();
  Start(cell, options).fill(model, u);
  const Reading values(u);
  std::vector<double> start;
  for (PetscInt node = 0; node < cell.n; ++node)
    for (int k = 0; k < model.dof(); ++k) start.push_back(values[node * model.dof() + k]);
  return start;
}

void check_cycle_options(const Options& options, const Scene& cell) {
  if (!cell.friction.sticks()) {
    check_smooth_cell(cell);
  } else {
    if (cell.n > stick_cycle_limit)
      throw UsageError("a cycle of " + std::to_string(cell.n) + " nodes with exact stick: at most " +
                       std::to_string(stick_cycle_limit) +
                       " are solved for; take fewer (grid_n, cycle_cell) or "
                       "friction_stick regularised");
  }
  if (options.boolean("cycle_spectrum") && !has_neighbours(options))
    throw UsageError(
        "cycle_spectrum: a whole scene (cycle_cell 0) has no neighbours; its own multipliers say all");
  if (options.boolean("cycle_spectrum") && cell.forced() && cell.friction.sticks())
    throw UsageError(
        "cycle_spectrum: under a load waves are looked at with smooth friction (friction_stick regularised); "
        "with exact stick take the whole scene (cycle_cell 0)");
  if (springless(cell))
    throw UsageError(
        cell.forced()
            ? "model_k0 0: the mean force of the springs stays what it is at the start, so that under a load "
              "there is a cycle for each and none is apart; set a positive stiffness to the plate, or take "
              "`run`"
            : "model_k0 0: nothing drives a cycle; set a positive stiffness to the plate");
}

FoundCycle find_cycle(const Options& options, const Scene& cell) {
  const bool forced = cell.forced();
  if (cell.friction.sticks()) return forced ? sticking_under_load(options, cell) : sticking(options, cell);
  return smooth(options, cell,
                one_node(cell) && has_neighbours(options) && !forced && !cell.massless()
                    ? uniform_cycle(cell)
                    : settled_cycle(cell, start_of_cell(options, cell), turns_to_settle));
}

}  // namespace stickslip
