// The unit tests' main: starts SLEPc (and with it PETSc and MPI) once and combines the result over the ranks.
// Where a REQUIRE on one rank would skip a collective call on it, use CHECK.
#define CATCH_CONFIG_RUNNER
#include <slepcsys.h>

#include <catch2/catch.hpp>

#include "stickslip/error.hpp"

int main(int argc, char** argv) {
  int one = 1;
  char* name[] = {argv[0], nullptr};
  char** names = name;
  if (SlepcInitialize(&one, &names, nullptr, nullptr)) return 1;
  stickslip::install_error_handler();
  int mine = Catch::Session().run(argc, argv);
  int all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  if (SlepcFinalize()) return 1;
  return all;
}
