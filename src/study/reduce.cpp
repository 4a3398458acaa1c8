#include "stickslip/study/reduce.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "cycles/cycle_waves.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/study/start.hpp"
#include "stickslip/waves/wave_stability.hpp"

namespace stickslip {

PetscInt promised_cells(const Scene& scene, const Options& options) {
  if (!scene.nodes_alike() || options.real("init_noise") != 0) return 1;
  if (scene.left == End::velocity || scene.right == End::velocity) return 1;
  const std::string type = options.text("init_type");
  PetscInt cells = 1;
  if (type == "file" || type == "text") return 0;
  if (type == "uniform" || (type == "sine" && options.real("init_amplitude") == 0)) return scene.n;
  if (type == "sine") cells = options.integer("init_mode");
  if (type == "pulses" || type == "wave") cells = options.integer("init_pulses");
  cells = std::gcd(cells, scene.n);
  return scene.ring() || cells == scene.n ? cells : 1;
}

Scene cell_of(const Scene& scene, PetscInt cells) {
  Scene cell = scene;
  cell.n = scene.n / cells;
  cell.length = scene.h() * double(cell.n);
  cell.left = cell.right = End::periodic;
  cell.copies = cells;
  return cell;
}

namespace {

Model model_of_cell(const Scene& cell) {
  return Model(cell.n < ranks_in(PETSC_COMM_WORLD) ? PETSC_COMM_SELF : PETSC_COMM_WORLD, cell);
}

std::string description(const Scene& whole, const Model& model) {
  const PetscInt n = model.scene().n;
  return fmt::format(
      "{} for {}, {} unknowns for {}",
      n == 1 ? "a uniform scene: one node" : fmt::format("{} equal cells: {} nodes", whole.n / n, n), whole.n,
      model.unknowns(), whole.n * model.dof());
}

// The entries first, first + 1, ... of a vector, up to `count`, wherever they lie; every rank asks for its
// own. Collective.
std::vector<double> fetch(Vec from, PetscInt first, PetscInt count) {
  std::vector<double> values(count, 0.);
  VecHandle into;
  IsHandle entries;
  ScatterHandle scatter;
  SS_TRY(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, count, values.data(), into.out()));
  SS_TRY(ISCreateStride(PETSC_COMM_SELF, count, first, 1, entries.out()));
  SS_TRY(VecScatterCreate(from, entries, into, nullptr, scatter.out()));
  SS_TRY(VecScatterBegin(scatter, from, into, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecScatterEnd(scatter, from, into, INSERT_VALUES, SCATTER_FORWARD));
  return values;
}

// Whether every value is that of `cell` nodes before it, up to a part of the largest of its kind and of the
// scene's scale. Collective.
bool repeats(const Model& model, Vec u, PetscInt cell, double part) {
  const PetscInt dof = model.dof(), begin = std::max<PetscInt>(model.first(), cell),
                 count = std::max<PetscInt>(0, model.first() + model.local() - begin);
  const std::vector<double> before = fetch(u, (begin - cell) * dof, count * dof);
  bool same = true;
  const Scales scales = scales_of(model.scene()).least;
  double allowed[3] = {};
  for (int d = 0; d < dof && part > 0; ++d) {
    double largest;
    SS_TRY(VecStrideNorm(u, d, NORM_INFINITY, &largest));
    allowed[d] = part * std::max(scales.of(d), largest);
  }
  {
    const Reading own(u);
    const double* here = own + (begin - model.first()) * dof;
    for (std::size_t i = 0; i < before.size() && same; ++i)
      same = std::abs(here[i] - before[i]) <= allowed[i % dof];
  }
  return !on_any_rank(model.comm(), !same);
}

// Of the divisors of n those whose cells might repeat to the last bit, by the first nodes of the first two.
// Collective.
std::vector<PetscInt> likely_cells(const Model& model, Vec u, bool ring) {
  const PetscInt n = model.scene().n, dof = model.dof();
  std::vector<PetscInt> cells;
  for (PetscInt cell = 1; 2 * cell <= n; ++cell)
    if (n % cell == 0 && (cell == 1 || ring)) {
      const PetscInt count = std::min<PetscInt>(cell, 8) * dof;
      if (fetch(u, 0, count) == fetch(u, cell * dof, count)) cells.push_back(cell);
    }
  return cells;
}

// How many equal cells the start holds: as many as are promised, if it agrees with that up to rounding; where
// nothing is promised, as many as are equal to the last bit. Collective.
PetscInt cells_of_start(const Model& model, const Options& options, Vec u) {
  const Scene& whole = model.scene();
  const PetscInt promised =
      options.text("scene_reduce") == "off" || whole.n == 1 ? 1 : promised_cells(whole, options);
  if (promised == 1) return 1;
  if (promised > 1) {
    return repeats(model, u, whole.n / promised, 1e-9) ? promised : 1;
  }
  for (const PetscInt cell : likely_cells(model, u, whole.ring()))
    if (repeats(model, u, cell, 0)) return whole.n / cell;
  return 1;
}

}  // namespace

Problem problem_of(const Scene& whole, const Options& options, std::optional<PetscInt> nodes) {
  Model model(PETSC_COMM_WORLD, whole);
  VecHandle u = model.create_vector();
  if (!nodes) set_start(model, options, u);
  const PetscInt cells = nodes ? whole.n / *nodes : cells_of_start(model, options, u);
  if (cells == 1) return {std::move(model), std::move(u), ""};

  Model small = model_of_cell(cell_of(whole, cells));
  VecHandle start = small.create_vector();
  if (!nodes) {
    const std::vector<double> values = fetch(u, small.first() * small.dof(), small.local() * small.dof());
    std::copy(values.begin(), values.end(), static_cast<double*>(Writing(start)));
  }
  std::string what = description(whole, small);
  return {std::move(small), std::move(start), std::move(what)};
}

// ---- stability of the whole scene's motion

namespace {

constexpr double small_perturbation = 1e-6;

// When a perturbation has become as large as the motion.
std::string outlook(double growth_rate, double duration) {
  return fmt::format(
      "a perturbation of {:g} takes over after about {:.3g}, one of the size of round-off after about "
      "{:.3g} (this run: {:.3g})",
      small_perturbation, -std::log(small_perturbation) / growth_rate, -std::log(1e-16) / growth_rate,
      duration);
}

}  // namespace

std::string broken_symmetry(const Scene& scene, const Scene& cell, const Measured& seen, double psi,
                            double duration) {
  const std::string unknown = "scene_reduce: whether the whole scene would keep this symmetry is not known: ";
  const std::string see = "; init_noise 1e-6 would show it";
  if (cell.friction.sticks())
    return unknown + "friction_law " + to_string(cell.friction.law) + " jumps at rest" + see;
  try {
    if (cell.n == 1) {
      const double small = 1e-6 * scales_of(scene).slip.psi;
      const bool still = seen.amplitude && *seen.amplitude < small && std::abs(psi - scene.v) < small;
      const bool slides =
          still || (seen.motion != Motion::stick_slip && !Oscillator(scene).sliding_unstable(1));
      const UniformInstability found =
          slides ? instability_of_sliding(scene) : instability_of_oscillation(scene);
      if (found.growth_rate * duration < -std::log(small_perturbation)) return "";  // not in this run
      return fmt::format(
          "scene_reduce: the uniform {} that one node stands for is unstable to waves: length {:.3g} "
          "grows fastest of those that fit, at {:.3g} per unit time; {}",
          slides ? "sliding" : "oscillation", 2 * M_PI / found.wavenumber, found.growth_rate,
          outlook(found.growth_rate, duration));
    }
    const PetscInt cells = scene.n / cell.n;
    if (scene.form == Form::chain) return unknown + "trains of a chain are not solved for" + see;
    const bool runs = seen.wave_speed && seen.pulses && *seen.pulses > 0;
    if (!runs) return unknown + "the motion is not a steady train" + see;
    const Train train = solve_train(scene, {*seen.pulses, scene.length, {}});
    if (std::abs(train.speed - std::abs(*seen.wave_speed)) > 0.02 * train.speed)
      return unknown + "the motion is not a steady train" + see;
    const std::vector<int> growing = growing_modes(train);
    int count = 0;
    for (std::size_t m = 0; m < growing.size(); ++m)
      if (PetscInt(m) % cells != 0) count += growing[m] * (2 * PetscInt(m) == train.pulses ? 1 : 2);
    if (count == 0) return "";
    return fmt::format(
        "scene_reduce: the train on {} equal cells is unstable to {} modes that make them unequal; the "
        "whole scene leaves it in time (`stickslip wave` with wave_spectrum tells how fast)",
        cells, count);
  } catch (const Error& e) {
    return unknown + e.what() + see;
  }
}

// Waves on a uniform motion: which of those that fit a scene grows fastest (reduce.hpp).

namespace {

constexpr double orbit_tolerance = 1e-7, least_growth = 1e-6;  // relative; of a multiplier beyond 1

}  // namespace

UniformInstability instability_of_sliding(const Scene& scene) {
  const auto medium = sliding_medium(scene);
  const auto found = medium ? fastest_wave(*medium, Waves::of(scene), same_growth(*medium), 1) : std::nullopt;
  if (!found || !(found->value.real() > 0)) return {};
  return {found->value.real(), found->wavenumber, 0, 1};
}

UniformInstability instability_of_oscillation(const Scene& scene) {
  const SmoothCycle cycle = uniform_cycle(scene, orbit_tolerance);
  const double period = cycle.cycle.period;
  Deviations deviations(cycle);
  const Waves waves = Waves::of(scene);
  const auto multiplier = [&](PetscInt j) { return std::abs(deviations.of_wave(waves.kappa2(j)).front()); };
  PetscInt low = 1, last = std::max<PetscInt>(1, PetscInt(waves.count) - 1);  // the last with c k T < 100
  while (low < last) {
    const PetscInt middle = low + (last - low + 1) / 2;
    if (std::sqrt(scene.A() * scene.K1() * waves.kappa2(middle)) * period < 100)
      low = middle;
    else
      last = middle - 1;
  }
  const PetscInt best = waves.count < 2 ? 0 : PetscInt(fastest_of(1, last, multiplier, true));
  const double growth = best == 0 ? 0 : multiplier(best);
  if (growth < 1 + least_growth) return {0, 0, period, 1};
  return {std::log(growth) / period, waves.k(best), period, growth};
}

}  // namespace stickslip
