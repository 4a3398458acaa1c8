// The unit tests' main: starts SLEPc (and with it PETSc and MPI) once and combines the result over the ranks.
// Where a REQUIRE on one rank would skip a collective call on it, use CHECK.
#define CATCH_CONFIG_RUNNER
#include <slepcsys.h>

#include "catch.hpp"
#include "stickslip/base/error.hpp"

#include <array>
#include <cstdio>
#include <vector>

namespace {

// Which test cases failed on this rank, in the order in which all ranks ran them.
std::vector<int> failed_here;

struct Outcomes : CatchListener {
  using CatchListener::CatchListener;
  void testCaseEnded(const Catch::TestCaseStats& stats) override {
    CatchListener::testCaseEnded(stats);
    failed_here.push_back(stats.totals.testCases.failed > 0);
  }
};
CATCH_REGISTER_LISTENER(Outcomes)

// Prints `N passed, N failed` on rank 0: a case failed where it failed on any rank.
void print_counts() {
  std::vector<int> failed(failed_here.size());
  MPI_Allreduce(failed_here.data(), failed.data(), static_cast<int>(failed.size()), MPI_INT, MPI_MAX,
                MPI_COMM_WORLD);
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  long bad = 0;
  for (const int f : failed) bad += f;
  if (rank == 0 && !failed.empty()) {
    std::fflush(stdout);
    std::printf("%ld passed, %ld failed\n", static_cast<long>(failed.size()) - bad, bad);
  }
}

}  // namespace

int main(int argc, char** argv) {
  int one = 1;
  char* name[] = {argv[0], nullptr};
  char** names = name;
  if (SlepcInitialize(&one, &names, nullptr, nullptr)) return 1;
  stickslip::install_error_handler();
  Catch::Session session;
  // on every rank the same
  session.applyCommandLine(3, std::array<const char*, 3>{argv[0], "--order", "decl"}.data());
  int mine = session.run(argc, argv);
  int all = 0;
  MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  print_counts();
  if (SlepcFinalize()) return 1;
  return all;
}
