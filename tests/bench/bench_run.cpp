// A whole adaptive run on a ring: Integrator and Model of this program against a plain PETSc code (DMDA with
// ghost nodes, DMGlobalToLocal, array access, TSRK), same equations, order in space, pair, tolerances and
// first step.
//
//     ninja -C build bench_run && build/tests/bench_run
//     mpirun -n 2 build/tests/bench_run -ts_rk_type 3bs
//
// Options: -bench_n [100000], -bench_order [4], -bench_steps [60, about], -bench_trials [9], -bench_clock
// (wall, cpu), and every -ts_ option, for both. The runs take turns. First the two right-hand sides are
// compared; the runs themselves part by more than round-off, since steps at the limit of stability amplify
// it.
#include <petscdmda.h>
#include <slepcsys.h>

#include <cmath>
#include <string>

#include "bench.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/time.hpp"

using namespace stickslip;

namespace {

// ---- the plain code: cubic law, ring, continuum ----

struct Node {
  PetscReal psi, eta;
};

struct Plain {
  DM dm;
  PetscReal gamma, delta, c, v, h;
};

template <int half_width>
PetscErrorCode PlainRHS(TS, PetscReal, Vec U, Vec F, void* context) {
  static const PetscReal weights[3][4] = {
      {-2., 1., 0, 0}, {-5. / 2, 4. / 3, -1. / 12, 0}, {-49. / 18, 3. / 2, -3. / 20, 1. / 90}};
  const Plain* p = static_cast<Plain*>(context);
  const PetscReal* w = weights[half_width - 1];
  Vec local;
  const Node* u;
  Node* f;
  PetscInt first, count;
  PetscFunctionBeginUser;
  PetscCall(DMGetLocalVector(p->dm, &local));
  PetscCall(DMGlobalToLocal(p->dm, U, INSERT_VALUES, local));
  PetscCall(DMDAVecGetArrayRead(p->dm, local, &u));
  PetscCall(DMDAVecGetArrayWrite(p->dm, F, &f));
  PetscCall(DMDAGetCorners(p->dm, &first, nullptr, nullptr, &count, nullptr, nullptr));
  const PetscReal scale = p->c * p->c / (p->gamma * p->h * p->h);
  for (PetscInt i = first; i < first + count; ++i) {
    const PetscReal psi = u[i].psi, excess = u[i].eta - psi * (psi * psi / 3 - 1);
    PetscReal d2 = w[0] * psi;
    for (int j = 1; j <= half_width; ++j) d2 += w[j] * (u[i - j].psi + u[i + j].psi);
    f[i].psi = p->gamma * excess;
    f[i].eta = (p->v - psi) / p->gamma + scale * d2 - p->delta * excess;
  }
  PetscCall(DMDAVecRestoreArrayWrite(p->dm, F, &f));
  PetscCall(DMDAVecRestoreArrayRead(p->dm, local, &u));
  PetscCall(DMRestoreLocalVector(p->dm, &local));
  PetscFunctionReturn(0);
}

void run() {
  PetscInt n = 100000, order = 4, steps = 60, trials = 9;
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_n", &n, nullptr));
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_order", &order, nullptr));
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_steps", &steps, nullptr));
  SS_TRY(PetscOptionsGetInt(nullptr, nullptr, "-bench_trials", &trials, nullptr));
  if (order != 2 && order != 4 && order != 6) throw UsageError("-bench_order: 2, 4 or 6");
  Scene s;
  s.n = n;
  s.order = int(order);
  const Model model(PETSC_COMM_WORLD, s);
  VecHandle start = model.create_vector(), ours = model.create_vector(), plain = model.create_vector();
  double* a;
  SS_TRY(VecGetArray(start, &a));
  for (PetscInt i = 0; i < model.local(); ++i) {
    a[2 * i] = 0.1 + 0.5 * std::sin(2 * M_PI * s.x(model.first() + i) / s.length);
    a[2 * i + 1] = 0.1;
  }
  SS_TRY(VecRestoreArray(start, &a));

  const auto unless_given = [](const char* option, const std::string& value) {
    PetscBool given;
    SS_TRY(PetscOptionsHasName(nullptr, nullptr, option, &given));
    if (!given) SS_TRY(PetscOptionsSetValue(nullptr, option, value.c_str()));
  };
  const double dt = 1 / model.wave_frequency();
  unless_given("-ts_type", "rk");
  unless_given("-ts_rk_type", "5dp");
  unless_given("-ts_rtol", "1e-6");
  unless_given("-ts_atol", "1e-6");
  unless_given("-ts_dt", std::to_string(dt));
  // the pair's error control settles near its limit of stability
  const double t_end = 2.5 * dt * double(steps);
  unless_given("-ts_max_time", std::to_string(t_end));

  TimeReport report;
  const auto run_ours = [&] {
    SS_TRY(VecCopy(start, ours));
    Integrator integrator(model, MethodSpec(), ours);
    double end;
    SS_TRY(TSGetMaxTime(integrator.ts(), &end));
    report =
        integrator.advance(ours, 0, end, [](const Integrator::Step&) { return Integrator::Verdict::go_on; });
  };

  PetscInt plain_steps = 0, plain_rejections = 0;
  DmHandle dm;
  SS_TRY(DMDACreate1d(PETSC_COMM_WORLD, DM_BOUNDARY_PERIODIC, n, 2, order / 2, nullptr, dm.out()));
  SS_TRY(DMSetUp(dm));
  Plain context{dm, s.gamma, s.delta, s.c, s.v, s.h()};
  const auto plain_rhs = order == 2 ? PlainRHS<1> : order == 4 ? PlainRHS<2> : PlainRHS<3>;
  const auto run_plain = [&] {
    SS_TRY(VecCopy(start, plain));
    TsHandle ts;
    SS_TRY(TSCreate(PETSC_COMM_WORLD, ts.out()));
    SS_TRY(TSSetDM(ts, dm));
    SS_TRY(TSSetRHSFunction(ts, nullptr, plain_rhs, &context));
    SS_TRY(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_MATCHSTEP));
    SS_TRY(TSSetFromOptions(ts));
    SS_TRY(TSSetMaxSteps(ts, PETSC_MAX_INT));
    SS_TRY(TSSolve(ts, plain));
    SS_TRY(TSGetStepNumber(ts, &plain_steps));
    SS_TRY(TSGetStepRejections(ts, &plain_rejections));
  };

  double difference;
  model.rhs(Part::full, start, ours);
  SS_TRY(plain_rhs(nullptr, 0, start, plain, &context));
  SS_TRY(VecAXPY(plain, -1, ours));
  SS_TRY(VecNorm(plain, NORM_INFINITY, &difference));
  if (difference > 1e-15 * (10 + 10 * s.K1() / (s.h() * s.h()))) throw Failure("the right-hand sides differ");

  const auto seconds = bench::interleaved(PETSC_COMM_WORLD, int(trials), 1, {run_ours, run_plain});
  int ranks;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  const double updates = double(n) * double(report.rhs_evaluations);
  SS_TRY(PetscPrintf(PETSC_COMM_WORLD,
                     "# %s, cubic, ring, n = %d, order %d, %d rank(s), %d rounds, %s time; flags: %s\n"
                     "# steps %d + %d rejected (plain %d + %d), %ld right-hand sides\n"
                     "# s, median/min: ours %.4f / %.4f, plain DMDA %.4f / %.4f; ours/plain %.3f / %.3f\n"
                     "# ns a node and stage, median: ours %.2f, plain %.2f\n",
                     report.method.c_str(), int(n), int(order), ranks, int(trials),
                     bench::cpu_clock() ? "processor" : "wall", STICKSLIP_FLAGS, int(report.steps),
                     int(report.rejections), int(plain_steps), int(plain_rejections), report.rhs_evaluations,
                     seconds[0].median, seconds[0].least, seconds[1].median, seconds[1].least,
                     seconds[0].median / seconds[1].median, seconds[0].least / seconds[1].least,
                     1e9 * seconds[0].median / updates, 1e9 * seconds[1].median / updates));
  if (std::abs(double(report.steps - plain_steps)) > 0.05 * double(plain_steps))
    throw Failure("the runs differ in steps, so that their times do not compare");
}

}  // namespace

int main(int argc, char** argv) {
  if (SlepcInitialize(&argc, &argv, nullptr, nullptr)) return 1;
  try {
    run();
  } catch (const std::exception& e) {
    (void)PetscPrintf(PETSC_COMM_WORLD, "bench_run: %s\n", e.what());
    MPI_Abort(PETSC_COMM_WORLD, 1);
  }
  return SlepcFinalize() ? 1 : 0;
}
