// What the process is among others, and what memory it may have.
#pragma once

namespace stickslip {

// The start of MPI, also in a process that no launcher started.

// MPI_Init; false: it failed. Where no launcher (mpirun, srun and whatever speaks PMI or PMIx) started this
// process, Open MPI starts it without a daemon beside it and without a search of the network and of the
// machine's devices, unless the user set these parameters, in the environment or in
// ~/.openmpi/mca-params.conf. It makes no session folder then, since each process that ends removes the one
// that all of a user share, and those that start at that moment die; an Open MPI that makes one nevertheless
// (5, or where the user wants it) does so in a folder of this process alone. Both are gone when this returns:
// nothing needs them later, and nothing is left behind however the process ends. Another MPI may do without.
bool start_mpi(int& argc, char**& argv);

// What memory a process may still take.

// In bytes, on this machine: what Linux says is available, or what a control group leaves where that is less;
// elsewhere all that the machine has. Swap does not count. Infinite where nothing is known.
double memory_of_machine();

// What the limit of addresses (ulimit -v) leaves to this process; infinite where there is none.
double memory_of_process();

}  // namespace stickslip
