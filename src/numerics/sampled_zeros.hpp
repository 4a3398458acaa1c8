// Zeros of a function of one variable on samples of it.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

struct Sample {
  double x, f;
};

// Samples in order, those that show a zero which f only touches, or two close together, among them: the least
// |f| between samples of one sign.
template <class F>
std::vector<Sample> with_touching_zeros(F&& f, const std::vector<Sample>& samples) {
  std::vector<Sample> result = samples;
  for (std::size_t k = 1; k + 1 < samples.size(); ++k) {
    const double before = samples[k - 1].f, here = samples[k].f, after = samples[k + 1].f;
    if (!(here * before > 0 && here * after > 0)) continue;
    if (std::abs(here) > std::abs(before) || std::abs(here) > std::abs(after)) continue;
    if (std::abs(here) > 2 * std::max(std::abs(before - here), std::abs(after - here))) continue;
    const double sign = here > 0 ? 1 : -1;
    const Least least = find_least([&](double x) { return sign * f(x); }, samples[k - 1].x, samples[k + 1].x,
                                   1e-9, [](double value) { return !(value > 0); });
    if (least.value <= 1e-12)
      result.push_back({least.x, least.value <= 0 && least.value > -1e-12 ? 0 : sign * least.value});
  }
  std::sort(result.begin(), result.end(), [](const Sample& a, const Sample& b) { return a.x < b.x; });
  return result;
}

}  // namespace stickslip
