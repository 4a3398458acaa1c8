// Loops over values side by side that keep eight sums, least or largest values apart, whatever the
// processor's vectors hold: vector code, and the same bits everywhere.
#pragma once

#include <petscsys.h>

#include <algorithm>

namespace stickslip {

constexpr int lanes = 8;

// A value for each lane and, in the end, one for all.
struct Lanes {
  double of[lanes];

  explicit Lanes(double all) { std::fill(of, of + lanes, all); }
  double least_of_all() const { return *std::min_element(of, of + lanes); }
  double largest_of_all() const { return *std::max_element(of, of + lanes); }
  double sum() const {
    double all = 0;
    for (const double one : of) all += one;
    return all;
  }
};

// Calls body(number, lane) for 0 .. count - 1 in turn, eight at a time.
template <class Body>
void in_lanes(PetscInt count, const Body& body) {
  PetscInt i = 0;
  for (; i + lanes <= count; i += lanes)
#pragma GCC ivdep
    for (int k = 0; k < lanes; ++k) body(i + k, k);
  for (int k = 0; i + k < count; ++k) body(i + k, k);
}

}  // namespace stickslip
