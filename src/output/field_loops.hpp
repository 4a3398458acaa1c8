// Loops over values side by side that keep eight sums, least or largest values apart, whatever the
// processor's vectors hold: vector code, and the same bits everywhere.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <cstddef>

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

// Passes over the psi of a range of nodes as it lies in a vector, node by node, in vector code: what is
// measured of a field costs no more than reading it. Least, largest and sums are kept in eight lanes whatever
// the processor's vectors hold, so that the same nodes give the same bits everywhere.

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

namespace stickslip::event_loops {

// The loops of the catalogue over nodes side by side, in the version that suits this processor.

// A step of nodes side by side: psi and friction at its beginning, in its middle and at its end.
struct StepOfNodes {
  const double *p0, *p, *p1, *F0, *F, *F1;
  double dt;
  double *slip, *slipped;  // to which the slip is added
  std::size_t count;
};
struct StepSums {
  double work, squares, ends;  // of psi F and of psi^2 by Simpson's rule over dt/6; of psi^2 at the end
};
StepSums add_step(const StepOfNodes& nodes);

// psi in the middle of a step, on the cubic through values and slopes at its ends.
struct MiddleOfNodes {
  const double *p0, *p1, *eta0, *eta1, *F0, *F1;
  double A, B, dt;
  double* p;
  std::size_t count;
};
void find_middle(const MiddleOfNodes& nodes);

// psi for a law: where it is 0 as small as can be in the direction of the motion that begins or ends there,
// that of p0 + p1.
struct AimedNodes {
  const double *psi, *p0, *p1;
  double* aimed;
  std::size_t count;
};
void aim(const AimedNodes& nodes);

// Unknowns as they lie in a vector, dof (2 or 3) a node, each kind in an array of its own.
struct InterleavedNodes {
  const double* u;
  double *psi, *eta, *state;
  int dof;
  std::size_t count;
};
void separate(const InterleavedNodes& nodes);

// Nodes whose friction at the beginning of a step is not that of the end of the last one.
struct EarlierNodes {
  const double* p0;
  const unsigned char* moved;
  std::size_t count;
};
std::size_t count_unknown(const EarlierNodes& nodes);

// 1 for nodes that move at either end of a step, else 0.
struct MovingNodes {
  const double *p0, *p1;
  double velocity;
  unsigned char* moves;
  std::size_t count;
};
void mark_moving(const MovingNodes& nodes);

}  // namespace stickslip::event_loops
