#include "stickslip/study/size.hpp"

#include <petscsys.h>
#include <unistd.h>

#include "base/broadcast.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

// Of all machines that take part, in bytes; 0 where it is not known.
double memory_of_all_machines(MPI_Comm comm) {
  MPI_Comm machine;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
  const bool first = rank_in(machine) == 0;
  MPI_Comm_free(&machine);
  const double here = double(sysconf(_SC_PHYS_PAGES)) * double(sysconf(_SC_PAGE_SIZE));
  return sum_over(comm, first && here > 0 ? here : 0);
}

}  // namespace

void check_size(const Options& options, MPI_Comm comm) {
  const PetscInt n = options.integer("grid_n");
  int ranks = 1;
  MPI_Comm_size(comm, &ranks);
  if (n < ranks)
    throw UsageError("-grid_n " + std::to_string(n) + ": more ranks (" + std::to_string(ranks) +
                     ") than nodes; start at most " + std::to_string(n));
  // what an explicit run takes, the least of all (docs/performance.md)
  const double needed = double(n) * 40, there = needed < 1e8 ? 0 : memory_of_all_machines(comm);
  if (there > 0 && needed > there)
    throw UsageError("-grid_n " + std::to_string(n) + ": needs at least " + std::to_string(long(needed / 1e9)) +
                     " GB of memory; there are " + std::to_string(long(there / 1e9)));
}

}  // namespace stickslip
