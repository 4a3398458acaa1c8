// Passes over the psi of a range of nodes as it lies in a vector, node by node, in vector code: what is
// measured of a field costs no more than reading it. Least, largest and sums are kept in eight lanes whatever
// the processor's vectors hold, so that the same nodes give the same bits everywhere.
#pragma once

#include <petscsys.h>

namespace stickslip {

// Unknowns of `count` nodes, `dof` (2 or 3) a node: psi, eta and the state.
struct FieldRange {
  const double* u;
  PetscInt count;
  int dof;
};

struct FieldSums {
  double low, high;  // least and largest psi; HUGE_VAL and -HUGE_VAL of no node
  double psi, eta;   // sums
};
FieldSums sums_of(const FieldRange& field);

// Least and largest psi of the nodes, and of each node so far: low[i] and high[i] take in what is new.
struct Extremes {
  double low, high;
};
Extremes widen(const FieldRange& field, double* low, double* high);

// The same with nothing kept; range: the largest that a node has come through, this field included. low,
// high: nullptr where no field went before.
struct LastExtremes {
  double low, high, range;
};
LastExtremes widest(const FieldRange& field, const double* low, const double* high);

// Upward passages of psi through a level along a piece of the line, and its state where it begins and ends:
// below the level less the depth (-1), above the level plus the depth (1), or nowhere beyond either (0).
struct Passages {
  int first = 0, last = 0, up = 0;

  void add(int state) {
    if (state == 0) return;
    if (first == 0) first = state;
    if (last == -1 && state == 1) ++up;
    last = state;
  }
  void append(const Passages& next) {
    if (next.first == 0) return;
    if (first == 0) first = next.first;
    if (last == -1 && next.first == 1) ++up;
    up += next.up;
    last = next.last;
  }
};
// With the largest difference of psi between neighbours of the range.
struct Fronts {
  Passages passages;
  double steepest = 0;
};
Fronts fronts_of(const FieldRange& field, double level, double depth);

}  // namespace stickslip
