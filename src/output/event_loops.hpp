// The loops of the catalogue over nodes side by side, in the version that suits this processor.
#pragma once

#include <cstddef>

namespace stickslip::event_loops {

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
