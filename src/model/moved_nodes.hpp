// A step of nodes side by side that are advanced by themselves, as what watches them sees it.
#pragma once

#include <petscsystypes.h>

namespace stickslip {

// Nodes first, first + 1, ... (round a ring) at the beginning and the end of a step: their unknowns and the
// right-hand side; where neighbours have viscosity also N D2 psi and N D2 psi_t, else nullptr. direction: 1
// or -1 while the node slides in the step, 0 while it rests.
struct MovedNodes {
  double t0, t1;
  PetscInt first, count;
  struct End {
    const double *psi, *eta, *psi_rate, *eta_rate, *viscous = nullptr, *viscous_rate = nullptr;
  } begin, end;
  const double* direction;
};

}  // namespace stickslip
