// Whether the machine and the number of ranks suit the scene.
#pragma once

#include "stickslip/options/options.hpp"

namespace stickslip {

// UsageError where there are more ranks than nodes, or more nodes than the memory of the machines can hold. main()
// calls it for commands with a grid, except before a restart: that command calls it with the restored options.
// Needs MPI, not PETSc. Collective on the ranks that share the scene.
void check_size(const Options& options, MPI_Comm comm = MPI_COMM_WORLD);

}  // namespace stickslip
