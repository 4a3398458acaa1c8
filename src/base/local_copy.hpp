// A copy of the part of a vector that this rank holds. Not collective.
#pragma once

#include <vector>

#include "base/local_values.hpp"

namespace stickslip {

inline std::vector<double> local_values(Vec v) {
  PetscInt count;
  SS_TRY(VecGetLocalSize(v, &count));
  const Reading own(v);
  return std::vector<double>(own + 0, own + count);
}

}  // namespace stickslip
