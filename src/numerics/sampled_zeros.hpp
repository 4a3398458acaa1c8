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

// Of f at the ends of so many equal pieces of [0, 1].
template <class F>
std::vector<Sample> samples_of_unit(F&& f, int pieces) {
  std::vector<Sample> samples;
  for (int k = 0; k <= pieces; ++k) {
    const double x = double(k) / pieces;
    samples.push_back({x, f(x)});
  }
  return samples;
}

// Where f is not a number at 0 or 1: as near to there as can be.
template <class F>
void mend_ends(F&& f, std::vector<Sample>& samples) {
  constexpr double inside = 1e-9;
  for (Sample* end : {&samples.front(), &samples.back()})
    if (std::isnan(end->f)) {
      end->x = end->x == 0 ? inside : 1 - inside;
      end->f = f(end->x);
    }
}

// The runs of samples that are zero, as intervals: of one sample, which shows a zero there, or of several,
// between which f vanishes and no place is one.
inline std::vector<Bracket> zero_runs(const std::vector<Sample>& samples) {
  std::vector<Bracket> runs;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (samples[k].f != 0) continue;
    const bool goes_on = k > 0 && samples[k - 1].f == 0;
    if (!goes_on) runs.push_back({samples[k].x, 0, samples[k].x, 0});
    runs.back().b = samples[k].x;
  }
  return runs;
}

// The runs of several samples that are zero, up to where f ceases to be; samples right beyond those places
// are added, since f may change its sign before the next one.
template <class F>
std::vector<Bracket> zero_stretches(F&& f, std::vector<Sample>& samples) {
  constexpr double near = 1e-6;
  const auto zero = [&](double x) { return f(x) == 0; };
  const auto in_order = [](const Sample& a, const Sample& b) { return a.x < b.x; };
  std::vector<Sample> beyond;
  // The end of a run on the way from its last sample to the next one.
  const auto end_of = [&](double last, double next) {
    constexpr double part = 1. / 64;
    const double end = last_place(zero, last, next, near), x = end + part * (next - end);
    beyond.push_back({x, f(x)});
    return end;
  };
  std::vector<Bracket> stretches;
  for (Bracket run : zero_runs(samples)) {
    if (run.a == run.b) continue;
    const auto first = std::lower_bound(samples.begin(), samples.end(), Sample{run.a, 0}, in_order),
               behind = std::upper_bound(samples.begin(), samples.end(), Sample{run.b, 0}, in_order);
    if (first != samples.begin()) run.a = end_of(run.a, std::prev(first)->x);
    if (behind != samples.end()) run.b = end_of(run.b, behind->x);
    stretches.push_back(run);
  }
  samples.insert(samples.end(), beyond.begin(), beyond.end());
  std::sort(samples.begin(), samples.end(), in_order);
  return stretches;
}

// Of the zeros that samples show, in order; a sample that is zero is a bracket without width.
inline std::vector<Bracket> brackets_of(const std::vector<Sample>& samples) {
  std::vector<Bracket> found;
  for (const Bracket& run : zero_runs(samples))
    if (run.a == run.b) found.push_back(run);
  for (std::size_t k = 1; k < samples.size(); ++k) {
    const Sample &a = samples[k - 1], &b = samples[k];
    if (a.f * b.f < 0) found.push_back({a.x, a.f, b.x, b.f});
  }
  std::sort(found.begin(), found.end(), [](const Bracket& p, const Bracket& q) { return p.a < q.a; });
  return found;
}

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
