// Waves on a uniform motion: which of those that fit a scene grows fastest (reduce.hpp).
#include <algorithm>
#include <cmath>

#include "cycles/cycle_waves.hpp"
#include "stickslip/cycles/cycle.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/study/reduce.hpp"

namespace stickslip {

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
