// Runs side by side that differ in their seeds (`run_seeds`): the ranks are shared out before PETSc starts.
#pragma once

#include <petscsys.h>

#include "stickslip/options/options.hpp"

namespace stickslip {

// The ranks that work with this one: all, or with run_seeds those of one seed.
MPI_Comm team();
// Splits the ranks over run_seeds and gives each team the options of its seed. Collective; throws UsageError.
Options of_own_seed(const Options& options);
// Waits for all teams and returns the largest exit code; `code` as it stands where there is one team. Collective.
int join_teams(int code);

}  // namespace stickslip
