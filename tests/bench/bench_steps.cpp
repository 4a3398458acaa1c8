// The bare steps of a run: what `stickslip run` with the same options does beside reading them, measuring and
// writing.
//
//     ninja -C build bench_steps && build/tests/bench_steps -grid_n 100000 -init_type sine -ts_max_time 10
//
// Prints the number of steps, and the processor and wall time that setting the method up and advancing took
// on the slowest rank. command.py calls it.
#include <slepcsys.h>

#include <cstdio>
#include <vector>

#include "bench.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/study/reduce.hpp"
#include "stickslip/study/trial.hpp"
#include "stickslip/time/time.hpp"

using namespace stickslip;

namespace {

void run(int argc, char** argv) {
  std::vector<Given> given;
  for (int i = 1; i + 1 < argc; i += 2) given.push_back({argv[i] + 1, argv[i + 1], ""});
  const Options options = Options::from("run", given);
  insert_library_options(options);
  Problem problem = problem_of(Scene::from(options, false), options, std::nullopt);
  MPI_Barrier(PETSC_COMM_WORLD);
  double seconds[2] = {bench::now(true), bench::now(false)};
  Integrator integrator(problem.model, MethodSpec::from(options), problem.u);
  integrator.advance(problem.u, 0, options.real("ts_max_time"), nullptr, most_steps(options));
  seconds[0] = bench::now(true) - seconds[0];
  seconds[1] = bench::now(false) - seconds[1];
  MPI_Allreduce(MPI_IN_PLACE, seconds, 2, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD);
  PetscPrintf(PETSC_COMM_WORLD, "%lld %.6f %.6f\n", static_cast<long long>(integrator.report().steps),
              seconds[0], seconds[1]);
}

}  // namespace

int main(int argc, char** argv) {
  int first = 1;
  char** program = argv;
  if (SlepcInitialize(&first, &program, nullptr, nullptr) != 0) return 1;
  int code = 0;
  try {
    run(argc, argv);
  } catch (const std::exception& e) {
    PetscFPrintf(PETSC_COMM_WORLD, stderr, "%s\n", e.what());
    code = 1;
  }
  SlepcFinalize();
  return code;
}
