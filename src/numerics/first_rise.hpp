// Where a function first comes up to zero, known with its slope. Nothing communicates.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

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

}  // namespace stickslip
