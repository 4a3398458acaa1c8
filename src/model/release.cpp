#include "model/release.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

// At rest the threshold minus the force is convex or concave in time, a sum of something linear and an
// exponential or a logarithm: it is followed to its extremum, if it has one, and there is one root on either
// side.
double release_time(const Friction& law, double amplitude, double force, double rate, double s,
                    double latest) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  if (!law.has_state)
    return rate > 0 ? std::max(0., (amplitude * law.threshold(0).value - force) / rate) : infinity;
  const auto excess = [&](double wait) {
    return force + rate * wait - amplitude * law.threshold(law.state_at_rest(s, wait)).value;
  };
  const auto growth = [&](double wait) {
    const double then = law.state_at_rest(s, wait);
    return rate - amplitude * (law.threshold(then).slope * law.sliding_rate(0, then, 0).g);
  };
  const double scale = law.time_at_rest(s);
  double low = 0, high = scale;
  if (growth(0) <= 0) {  // falls behind the threshold at first
    if (rate <= 0) return infinity;
    while (growth(high) <= 0 && std::isfinite(high)) high *= 2;
    if (!std::isfinite(high)) return infinity;
    low = last_place([&](double wait) { return growth(wait) <= 0; }, 0, high);
    high = 2 * low;
  } else if (rate <= 0) {  // gains on a threshold that falls, for a while
    while (growth(high) > 0 && std::isfinite(high)) high *= 2;
    if (std::isfinite(high)) high = last_place([&](double wait) { return growth(wait) > 0; }, 0, high);
    if (!(excess(std::isfinite(high) ? high : 1e6 * scale) > 0)) return infinity;
    if (!std::isfinite(high)) high = 1e6 * scale;
  }
  while (excess(high) < 0 && high < latest) high *= 2;
  if (excess(high) < 0) return infinity;  // later than another
  // of the two neighbours the later one, where the force has come to the threshold
  const double before = last_place([&](double wait) { return excess(wait) < 0; }, low, high);
  return std::nextafter(before, infinity);
}

}  // namespace stickslip
