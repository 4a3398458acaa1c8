// When the phase of an analytic function f counts as followed over a step: f'/f at both ends says that ln f
// changes by little, and the change is what the two slopes predict. A zero beside the step, a pair of them,
// or a crowd further off shows in the slopes, so that no whole turn passes unseen.
#pragma once

#include <cmath>
#include <complex>

namespace stickslip {

// `change`: of ln f over `step`, its imaginary part within a half turn; the slopes are f'/f at the ends.
inline bool follows(std::complex<double> slope, std::complex<double> next_slope, std::complex<double> step,
                    std::complex<double> change) {
  const std::complex<double> predicted = (slope + next_slope) / 2. * step;
  return std::abs(slope * step) < 0.7 && std::abs(next_slope * step) < 0.7 &&
         std::abs(change - predicted) < 0.2;
}

}  // namespace stickslip
