// The cost of one right-hand side against one VecCopy of the same vector, for n = 1e3 ... 1e6 nodes.
//
//     ninja -C build bench_rhs && build/tests/bench_rhs
//     mpirun -n 2 build/tests/bench_rhs -bench_law carlson_langer -bench_order 6 -bench_n 10000,1000000
//
// Options: -bench_n, -bench_order, -bench_law (cubic, carlson_langer, healing, ageing), -bench_part (full,
// pointwise, stencil, wave, reaction), -bench_ends (ring, held), -bench_spread, -bench_trials [9],
// -bench_clock (wall, cpu). Right-hand sides, copies and Jacobians take turns, so that other users of the
// machine disturb all alike; medians and minima of the rounds.
#include <slepcsys.h>

#include <cmath>
#include <string>

#include "bench.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"

using namespace stickslip;

namespace {

Scene scene_of(const std::string& law, int order, const std::string& ends, double spread, PetscInt n) {
  Scene s;
  s.order = order;
  s.n = n;
  s.length = 60;
  s.spread = spread;
  if (law == "carlson_langer" || law == "healing") {
    s.friction.law = Law("carlson-langer");
    s.friction.regularised = true;
    s.friction.eps = 0.1;
  }
  if (law == "healing") s.friction.state = StateLaw("healing");
  if (law == "ageing") {
    s.friction.law = Law("rate-and-state");
    s.friction.state = StateLaw("ageing");
  }
  if (ends == "held") {
    s.left = End::velocity;
    s.right = End::free;
    s.left_value = -1.5;
  }
  return s;
}

std::string word(const char* option, const char* otherwise) {
  char text[64];
  PetscBool set;
  SS_TRY(PetscOptionsGetString(nullptr, nullptr, option, text, sizeof text, &set));
  return set ? text : otherwise;
}

void run() {
  PetscInt sizes[32] = {1000, 3000, 10000, 30000, 100000, 300000, 1000000}, count = 32, order = 4, trials = 9;
  PetscBool set;
  SS_TRY(PetscOptionsGetIntArray(nullptr, nullptr, "-bench_n", sizes, &count, &set));
  if (!set) count = 7;
  PetscReal spread = 0;
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_order", &order, nullptr));
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_trials", &trials, nullptr));
  SS_TRY(PetscOptionsGetReal(nullptr, nullptr, "-bench_spread", &spread, nullptr));
  const std::string law = word("-bench_law", "cubic"), ends = word("-bench_ends", "ring"),
                    part_name = word("-bench_part", "full");
  const Part part = part_name == "pointwise"  ? Part::pointwise
                    : part_name == "stencil"  ? Part::stencil
                    : part_name == "wave"     ? Part::wave
                    : part_name == "reaction" ? Part::reaction
                                              : Part::full;
  int ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  SS_TRY(PetscPrintf(PETSC_COMM_WORLD,
                     "# %s, order %d, %s, spread %g, part %s, %d rank(s), %d rounds, %s time; flags: %s\n",
                     law.c_str(), int(order), ends.c_str(), spread, part_name.c_str(), ranks, int(trials),
                     bench::cpu_clock() ? "processor" : "wall", STICKSLIP_FLAGS));
  SS_TRY(PetscPrintf(PETSC_COMM_WORLD, "# %8s %14s %22s %22s %16s %22s\n", "n", "node updates/s",
                     "rhs us median/min", "copy us median/min", "ratio median/min",
                     "Jacobian us median/min"));
  for (PetscInt k = 0; k < count; ++k) {
    const PetscInt n = sizes[k];
    Model model(PETSC_COMM_WORLD, scene_of(law, int(order), ends, spread, n));
    VecHandle u = model.create_vector(), f = model.create_vector();
    double* a;
    SS_TRY(VecGetArray(u, &a));
    for (PetscInt i = 0; i < model.local() * model.dof(); ++i)
      a[i] = 0.3 + std::sin(0.01 * double(model.first() * model.dof() + i));
    SS_TRY(VecRestoreArray(u, &a));
    model.set_held(u);
    MatHandle J = model.create_jacobian(part);
    const auto repeat = std::max<PetscInt>(1, 1000000 / n);  // shorter than a time slice of the machine
    const auto cheap = bench::interleaved(PETSC_COMM_WORLD, int(trials), repeat,
                                          {[&] { model.rhs(part, u, f); }, [&] { SS_TRY(VecCopy(u, f)); }});
    const auto assembly =
        bench::interleaved(PETSC_COMM_WORLD, int(trials), std::max<PetscInt>(1, repeat / 20),
                           {[&] { model.jacobian(part, u, 1, -0.01, J); }});
    const bench::Seconds rhs = cheap[0], copy = cheap[1], jacobian = assembly[0];
    SS_TRY(PetscPrintf(
        PETSC_COMM_WORLD, "%10d %14.4g %10.2f /%10.2f %10.2f /%10.2f %7.2f /%7.2f %10.1f /%10.1f\n", int(n),
        double(n) / rhs.median, 1e6 * rhs.median, 1e6 * rhs.least, 1e6 * copy.median, 1e6 * copy.least,
        rhs.median / copy.median, rhs.least / copy.least, 1e6 * jacobian.median, 1e6 * jacobian.least));
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  try {
    run();
  } catch (const std::exception& e) {
    (void)PetscPrintf(PETSC_COMM_WORLD, "bench_rhs: %s\n", e.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  return SlepcFinalize() ? 1 : 0;
}
