// Systems of PETSc, solved directly. To be called before KSPSetUp; options given on the command line override
// it. Collective.
#pragma once

#include <petscksp.h>

namespace stickslip {

// Makes `ksp` solve by LU factors in natural order, O(n) for a banded matrix. On several ranks each factors
// the whole, which is the fastest there.
void solve_by_banded_lu(KSP ksp);

// Makes `ksp` solve by the factors of each block of a matrix (BAIJ) that has blocks on its diagonal alone.
void solve_by_blocks(KSP ksp);

}  // namespace stickslip
