#include "stickslip/cycles/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip {

double growth_rate(const Cycle& cycle) {
  double largest = 0;
  for (std::size_t k = 0; k < cycle.multipliers.size(); ++k)
    if (k != cycle.phase_mode) largest = std::max(largest, std::abs(cycle.multipliers[k]));
  return largest > 0 ? std::log(largest) / cycle.period : -std::numeric_limits<double>::infinity();
}

double least_along(const Cycle& cycle, double v) { return v < 0 ? -cycle.psi_max : cycle.psi_min; }

void measure(Cycle& cycle) {
  const double inf = std::numeric_limits<double>::infinity();
  cycle.psi_min = inf;
  cycle.psi_max = -inf;
  double range = 0, low_force = inf, high_force = -inf;
  for (PetscInt i = 0; i < cycle.nodes; ++i) {
    double low = inf, high = -inf;
    for (std::size_t k = 0; k < cycle.times.size(); ++k) {
      low = std::min(low, cycle.psi(k, i));
      high = std::max(high, cycle.psi(k, i));
    }
    range = std::max(range, high - low);
    cycle.psi_min = std::min(cycle.psi_min, low);
    cycle.psi_max = std::max(cycle.psi_max, high);
  }
  for (std::size_t k = 0; k < cycle.times.size(); ++k) {
    double mean = 0;
    for (PetscInt i = 0; i < cycle.nodes; ++i) mean += cycle.eta(k, i) / double(cycle.nodes);
    low_force = std::min(low_force, mean);
    high_force = std::max(high_force, mean);
  }
  cycle.amplitude = range / 2;
  cycle.force_drop = high_force - low_force;
  double rest = 0;
  for (const Rest& r : cycle.rests) rest += r.end - r.begin;
  cycle.rest_fraction = rest / cycle.period / double(cycle.nodes);
}

}  // namespace stickslip
