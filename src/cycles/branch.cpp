#include "stickslip/cycles/branch.hpp"

#include <cmath>

namespace stickslip {

std::shared_ptr<Look> CycleFamily::look() {
  auto seen = std::make_shared<CycleLook>();
  seen->cycle = cycle();
  const Cycle& c = seen->cycle;
  seen->value = place().back() * range_;
  seen->period = c.period;
  seen->amplitude = c.amplitude;
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
