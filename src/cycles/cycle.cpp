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

std::shared_ptr<Look> CycleFamily::look() {
  auto seen = std::make_shared<CycleLook>();
  seen->cycle = cycle();
  const Cycle& c = seen->cycle;
  seen->value = place().back() * range_;
  seen->period = c.period;
  seen->amplitude = c.amplitude;
  seen->halves = halves();
  for (const auto& [name, value] : c.tests) {
    if (name != "hopf")
      seen->tests[name] = value;
    else if (value < 0)
      seen->amplitude = -c.amplitude;
  }
  for (std::size_t k = 0; k < c.multipliers.size(); ++k)
    if (k != c.phase_mode) seen->multipliers.push_back(c.multipliers[k]);
  seen->growth_rate = growth_rate(c);
  seen->stable = seen->growth_rate < 0;
  return seen;
}

// A slip that only grazes rest is named: its depth falls to zero like the distance of the parameter.
Family::Ending CycleFamily::ending(const Look& last) const {
  const auto depth = last.tests.find("graze");
  if (depth != last.tests.end() && std::abs(depth->second) < 1e-6)
    return {"graze", "a slip only grazes rest"};
  return {ends(), ""};
}

CycleBranch continue_cycle(CycleFamily& family, const Way& way, const CycleWatch& watch, Follow until) {
  std::function<void(Look&)> more;
  if (watch)
    more = [&watch](Look& look) {
      auto& seen = static_cast<CycleLook&>(look);
      const Watched watched = watch(seen.value, seen.cycle);
      seen.stable = watched.stable;
      seen.growth_rate = watched.growth_rate;
      seen.wavenumber = watched.wavenumber;
      seen.tests.insert(watched.tests.begin(), watched.tests.end());
    };
  Followed followed = follow(family, way, until, more);
  CycleBranch branch{{}, std::move(followed.special), std::move(followed.end)};
  for (const std::shared_ptr<Look>& look : followed.points) {
    auto& seen = static_cast<CycleLook&>(*look);
    branch.points.push_back(
        {seen.value, std::move(seen.cycle), seen.stable, seen.growth_rate, seen.wavenumber});
  }
  return branch;
}

}  // namespace stickslip
