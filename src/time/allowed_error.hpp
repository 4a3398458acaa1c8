// What an unknown of this value (psi 0, eta 1, the state 2) may be off by at the end of a step.
#pragma once

#include <cmath>

#include "stickslip/time/tolerances.hpp"

namespace stickslip {

inline double allowed_error(const Tolerances& tolerances, int unknown, double value) {
  return tolerances.absolute[unknown] + tolerances.relative[unknown] * std::abs(value);
}

}  // namespace stickslip
