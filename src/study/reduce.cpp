#include "stickslip/study/reduce.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/output/gather.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/study/start.hpp"
#include "stickslip/waves/wave_stability.hpp"

namespace stickslip {

PetscInt promised_cells(const Scene& scene, const Options& options) {
  if (!scene.same_friction() || options.real("init_noise") != 0) return 1;
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

namespace {

// Whether values repeat after `period` entries.
bool repeats(const std::vector<double>& values, std::size_t period, double tolerance) {
  for (std::size_t i = period; i < values.size(); ++i)
    if (!(std::abs(values[i] - values[i - period]) <= tolerance)) return false;
  return true;
}

// How many equal cells the values (of n nodes, dof each) hold: `promised`, if they agree with that up to rounding;
// where nothing is promised, as many as are equal to the last bit.
PetscInt cells_in(const std::vector<double>& values, PetscInt n, int dof, PetscInt promised, bool ring) {
  if (promised > 0) {
    double size = 1;
    for (const double value : values) size = std::max(size, std::abs(value));
    return repeats(values, static_cast<std::size_t>(n / promised * dof), 1e-9 * size) ? promised : 1;
  }
  for (PetscInt cell = 1; 2 * cell <= n; ++cell)
    if (n % cell == 0 && (cell == 1 || ring) && repeats(values, static_cast<std::size_t>(cell * dof), 0))
      return n / cell;
  return 1;
}

}  // namespace

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
  int ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  return Model(cell.n < ranks ? PETSC_COMM_SELF : PETSC_COMM_WORLD, cell);
}

std::string description(const Scene& whole, const Model& model) {
  const PetscInt n = model.scene().n;
  return (n == 1 ? "a uniform scene: one node" : std::to_string(whole.n / n) + " equal cells: " + std::to_string(n) +
                                                     " nodes") +
         " for " + std::to_string(whole.n) + ", " + std::to_string(model.unknowns()) + " unknowns for " +
         std::to_string(whole.n * model.dof());
}

}  // namespace

namespace {

// How many equal cells the start holds; `values`: of all nodes, on rank 0. Collective.
PetscInt cells_of_start(const Model& model, const Options& options, Vec u, std::vector<double>& values) {
  const Scene& whole = model.scene();
  PetscInt cells = options.text("scene_reduce") == "off" || whole.n == 1 ? 1 : promised_cells(whole, options);
  if (cells == 1) return 1;
  values = Gather(u, model.dof()).interleaved(u);
  if (rank_in(PETSC_COMM_WORLD) == 0) cells = cells_in(values, whole.n, model.dof(), cells, whole.ring());
  broadcast(cells);
  return cells;
}

}  // namespace

Problem problem_of(const Scene& whole, const Options& options, std::optional<PetscInt> nodes) {
  Model model(PETSC_COMM_WORLD, whole);
  VecHandle u = model.create_vector();
  std::vector<double> values;
  if (!nodes) set_start(model, options, u);
  const PetscInt cells = nodes ? whole.n / *nodes : cells_of_start(model, options, u, values);
  if (cells == 1) return {std::move(model), std::move(u), ""};

  Model small = model_of_cell(cell_of(whole, cells));
  VecHandle start = small.create_vector();
  if (!nodes) {
    values.resize(static_cast<std::size_t>(small.scene().n * small.dof()));
    broadcast(values);
    const auto from = values.begin() + small.first() * small.dof();
    std::copy(from, from + small.local() * small.dof(), static_cast<double*>(Writing(start)));
  }
  std::string what = description(whole, small);
  return {std::move(small), std::move(start), std::move(what)};
}

// ---- stability of the whole scene's motion ------------------------------------------------------------------------

namespace {

// When a perturbation has become as large as the motion.
std::string outlook(double growth_rate, double duration) {
  return "a perturbation of 1e-6 takes over after about " + rounded_text(-std::log(1e-6) / growth_rate) +
         ", one of the size of round-off after about " + rounded_text(-std::log(1e-16) / growth_rate) +
         " (this run: " + rounded_text(duration) + ")";
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
      const double small = 1e-6 * (1 + std::abs(scene.v));
      const bool still = seen.amplitude && *seen.amplitude < small && std::abs(psi - scene.v) < small;
      const bool slides = still || (seen.motion != Motion::stick_slip && !Oscillator(scene).sliding_unstable(1));
      const UniformInstability found = slides ? instability_of_sliding(scene) : instability_of_oscillation(scene);
      if (found.growth_rate * duration < 0.1) return "";  // nothing to be seen of it in this run
      return std::string("scene_reduce: the uniform ") + (slides ? "sliding" : "oscillation") +
             " that one node stands for is unstable to waves: length " + rounded_text(2 * M_PI / found.wavenumber) +
             " grows fastest of those that fit, at " + rounded_text(found.growth_rate) + " per unit time; " +
             outlook(found.growth_rate, duration);
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
    return "scene_reduce: the train on " + std::to_string(cells) + " equal cells is unstable to " +
           std::to_string(count) + " modes that make them unequal; the whole scene leaves it in time (`stickslip wave`"
           " with wave_spectrum tells how fast)";
  } catch (const Error& e) {
    return unknown + e.what() + see;
  }
}

}  // namespace stickslip
