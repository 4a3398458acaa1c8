// The start of MPI in a process that no launcher started.
#pragma once

namespace stickslip {

// Before MPI_Init: has Open MPI start a process of its own without a daemon beside it and without a search of
// the network and of the machine's devices, where neither a launcher (mpirun, srun and whatever speaks PMI or
// PMIx) started this process nor the user set these parameters, in the environment or in
// ~/.openmpi/mca-params.conf. Without effect on another MPI.
void prepare_lone_process();

}  // namespace stickslip
