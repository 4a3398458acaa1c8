// One banded system of PETSc, solved directly.
#pragma once

#include <petscksp.h>

namespace stickslip {

// Makes `ksp` solve by LU factors in natural order, O(n) for a banded matrix. On several ranks each factors
// the whole, which is the fastest there. Before KSPSetUp; options given on the command line override it.
// Collective.
void solve_by_banded_lu(KSP ksp);

}  // namespace stickslip
