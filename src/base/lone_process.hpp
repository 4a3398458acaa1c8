// The start of MPI, also in a process that no launcher started.
#pragma once

namespace stickslip {

// MPI_Init; false: it failed. Where no launcher (mpirun, srun and whatever speaks PMI or PMIx) started this
// process, Open MPI starts it without a daemon beside it and without a search of the network and of the
// machine's devices, unless the user set these parameters, in the environment or in
// ~/.openmpi/mca-params.conf. Its session folder then lies in a folder of this process alone, since each
// process that ends removes the one that all of a user share, and those that start at that moment die. Both
// are gone when this returns: nothing needs them later, and nothing is left behind however the process ends.
// Another MPI may do without.
bool start_mpi(int& argc, char**& argv);

}  // namespace stickslip
