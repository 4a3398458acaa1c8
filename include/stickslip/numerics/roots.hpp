// Zeros of a real function of one real variable and of polynomials, and the place where a condition begins to
// fail. Nothing communicates; a function that does is called the same number of times with the same arguments
// on every rank whose values agree.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

namespace stickslip {

// Two places where the function has values of different sign; either value may be 0.
struct Bracket {
  double a, fa, b, fb;
};

// A zero of f in the bracket: f changes its sign, or is 0, within `tolerance` of the place returned (never
// less than two units in the last place of it). A jump through zero counts as one. Of several zeros one is
// found.
//
// Inverse quadratic interpolation where three values are monotone enough for it, else halving (Chandrupatla,
// Advances in Engineering Software 28 (1997) 145): order 1.8 at a simple zero. Three steps that have not
// halved the bracket are followed by one that does, so that f is called at most 4 log2(|b - a|/tolerance) + 4
// times, whatever it is. f is not called at a and b. NaN where fa fb > 0, or where f is not finite at a place
// it was asked for.
template <class F>
double find_root(F&& f, Bracket bracket, double tolerance) {
  auto [a, fa, b, fb] = bracket;
  if (fa == 0) return a;
  if (fb == 0) return b;
  if ((fa < 0) == (fb < 0) || !std::isfinite(fa) || !std::isfinite(fb))
    return std::numeric_limits<double>::quiet_NaN();
  double part = 0.5;  // of the way from a, the newest place, to b
  double last_width = std::abs(b - a);
  for (int k = 1;; ++k) {
    const double x = a + part * (b - a), fx = f(x);
    if (!std::isfinite(fx)) return std::numeric_limits<double>::quiet_NaN();
    double c, fc;  // the place that leaves the bracket
    if ((fx < 0) == (fa < 0)) {
      c = a;
      fc = fa;
    } else {
      c = b;
      fc = fb;
      b = a;
      fb = fa;
    }
    a = x;
    fa = fx;
    const double best = std::abs(fa) < std::abs(fb) ? a : b, width = std::abs(b - a);
    const double allowed = std::max(tolerance, 2 * std::numeric_limits<double>::epsilon() * std::abs(best));
    if (fa == 0 || width <= allowed) return best;
    part = 0.5;
    const double xi = (a - b) / (c - b), phi = (fa - fb) / (fc - fb);
    const bool slow = k % 4 == 3 && width > 0.5 * last_width;
    if (k % 4 == 3) last_width = width;
    if (!slow && phi * phi < xi && (1 - phi) * (1 - phi) < 1 - xi)
      part = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb);
    const double edge = std::min(0.5, 0.5 * allowed / width);  // so that both ends close in
    part = std::clamp(part, edge, 1 - edge);
  }
}

// A zero of f near x, where f has the value fx: secant steps, the first one of length `step` (its sign
// counts), which end when one is no longer than `tolerance` (what is left is smaller by the change of the
// slope on the way). Where they do not settle within `reach`, a bracket is grown about x, from reach/1000 by
// factors of 4, and find_root called on it, to a millionth of `tolerance` or to `bracket`. `slope`, if given:
// that of the last secant. NaN where no change of sign is found within `reach`.
template <class F>
double root_near(F&& f, double x, double fx, double step, double tolerance, double reach,
                 double* slope = nullptr, double bracket = 0) {
  if (fx == 0) return x;
  double s = x, fs = fx;
  for (int k = 0; k < 8 && std::isfinite(step) && std::abs(s + step - x) < 0.2 * reach; ++k) {
    const double there = f(s + step), m = (there - fs) / step;
    if (there == 0) return s + step;
    if (!std::isfinite(m) || m == 0) break;
    if (slope) *slope = m;
    s += step;
    fs = there;
    step = -fs / m;
    if (std::abs(step) <= tolerance) return s + step;
  }
  for (double away = reach / 1000; away <= reach; away *= 4)
    for (const double other : {x + away, x - away})
      if (const double there = f(other); there * fx <= 0)
        return find_root(f, {x, fx, other, there}, std::max(1e-6 * tolerance, bracket));
  return std::numeric_limits<double>::quiet_NaN();
}

// The place between `yes`, where the condition holds, and `no`, where it does not, at which it ceases to
// hold, by halving until they are within `tolerance` (or neighbours); the last place where it was seen to
// hold. Where it ceases more than once, one of those places.
template <class Condition>
double last_place(Condition&& holds, double yes, double no, double tolerance = 0) {
  while (std::abs(no - yes) > tolerance) {
    const double middle = yes + (no - yes) / 2;
    if (middle == yes || middle == no) break;
    (holds(middle) ? yes : no) = middle;
  }
  return yes;
}

// The least value of f between low and high, and where: golden section, until the interval is no longer than
// `tolerance` or cannot be divided any more, or `enough` says of a value that it is low enough. One of the
// minima, where there are several.
struct Least {
  double x, value;
};
template <class F, class Enough>
Least find_least(F&& f, double low, double high, double tolerance, Enough&& enough) {
  constexpr double golden = 0.3819660112501051;  // (3 - sqrt(5))/2
  double a = low + golden * (high - low), b = high - golden * (high - low), fa = f(a), fb = f(b);
  while (high - low > tolerance && low < a && a < b && b < high && !enough(std::min(fa, fb))) {
    if (fa < fb) {
      high = b;
      b = a;
      fb = fa;
      fa = f(a = low + golden * (high - low));
    } else {
      low = a;
      a = b;
      fa = fb;
      fb = f(b = high - golden * (high - low));
    }
  }
  return fa < fb ? Least{a, fa} : Least{b, fb};
}

// Roots of a quadratic or cubic with real coefficients, highest power first (not 0): to round-off where they
// are apart. Complex ones are exact conjugates, neighbours in the list. Source of the cubic: Kahan, To solve
// a real cubic equation, Berkeley 1986.
std::vector<std::complex<double>> polynomial_roots(const std::vector<double>& coefficients);

// Zeros of a function of one variable on samples of it.
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

// Where a function first comes up to zero, known with its slope. Nothing communicates.

// A function of x with its slope.
struct ValueAndSlope {
  double x, value, slope;
};

// The first place from a.x to b.x at which f, a function from x to ValueAndSlope, is at least 0 and grows:
// where f comes up to 0, of two neighbours the later one, or a place where it starts to grow being there.
// Infinity where there is none. How far the slope changes in between is seen at both ends and the middle, to
// a factor of two, and f lies so much beyond its values there at most; where that does not decide, the halves
// are looked at. So no rise is missed, however short f stays there, if from a to b the slope turns no more
// often than three values show. `tiny`: what f changes by round-off alone.
template <class F>
double first_rise(const F& f, const ValueAndSlope& a, const ValueAndSlope& b, double tiny) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const double width = b.x - a.x, middle = a.x + width / 2;
  const ValueAndSlope m = f(middle);
  const double turns = std::max(std::abs(m.slope - a.slope), std::abs(b.slope - m.slope));
  if (std::max({a.value, m.value, b.value}) + width / 4 * turns < 0) return infinity;
  if (std::max({a.slope, m.slope, b.slope}) <= -turns) return infinity;  // it falls throughout
  const bool grows = std::min({a.slope, m.slope, b.slope}) > turns,
             stands = width * (std::abs(m.slope) + turns) <= tiny || middle == a.x || middle == b.x;
  if (grows || stands) {
    if (b.value < 0 || !(b.slope > 0)) return infinity;
    if (a.value >= 0) return a.slope > 0 ? a.x : b.x;
    return std::nextafter(last_place([&](double x) { return f(x).value < 0; }, a.x, b.x), infinity);
  }
  const double early = first_rise(f, a, m, tiny);
  return early < infinity ? early : first_rise(f, m, b, tiny);
}

// The cubic on [0, 1] with given values and slopes at both ends.

// Slopes of a step from t to t + dt: dt times those in t.
struct HermiteCubic {
  double y0, m0, c2, c3;

  HermiteCubic(double y_0, double y_1, double m_0, double m_1)
      : y0(y_0), m0(m_0), c2(3 * (y_1 - y_0) - 2 * m_0 - m_1), c3(2 * (y_0 - y_1) + m_0 + m_1) {}
  double operator()(double s) const { return y0 + s * (m0 + s * (c2 + s * c3)); }
  double slope(double s) const { return m0 + s * (2 * c2 + s * 3 * c3); }

  // Calls take(s) where the slope is 0 inside.
  template <class Take>
  void extrema(const Take& take) const {
    const double a = 3 * c3, b = 2 * c2, root = b * b - 4 * a * m0;
    if (!(root >= 0)) return;
    const double q = -(b + std::copysign(std::sqrt(root), b)) / 2;
    for (const double s : {a != 0 ? q / a : -1., q != 0 ? m0 / q : -1.})
      if (s > 0 && s < 1) take(s);
  }
};

}  // namespace stickslip
