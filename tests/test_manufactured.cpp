// Manufactured solutions: fields chosen in advance, the source that makes them exact, and the order at which
// the semi-discrete system with that source comes back to them, in space and in time.
#include <cmath>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"

using namespace stickslip;

namespace {

// psi = 0.4 + shape(x) g(t), eta = 0.1 + shape(x) q(t): on a ring shape = sin(2 pi x/L), between free ends
// cos(pi x/L), from a held left end (psi = 0.4) to a free right one sin(pi x/2L).
struct Problem {
  Scene scene;
  double wavenumber, phase;

  double shape(double x) const { return std::sin(wavenumber * x + phase); }
  static double g(double t) { return 0.5 * std::cos(1.3 * t); }
  static double q(double t) { return 0.3 * std::sin(t) + 0.2; }

  // what psi_t and eta_t of the chosen fields leave over
  void source(double x, double t, double* psi_source, double* eta_source) const {
    const double s = shape(x), psi = 0.4 + s * g(t), eta = 0.1 + s * q(t);
    const double psi_t = -0.65 * s * std::sin(1.3 * t), eta_t = 0.3 * s * std::cos(t);
    const double psi_xx = -wavenumber * wavenumber * s * g(t), F = psi * psi * psi / 3 - psi;
    *psi_source = psi_t - scene.A() * (eta - F);
    *eta_source = eta_t - (scene.K0() * (scene.v - psi) + scene.K1() * psi_xx - scene.s_delta() * (eta - F));
  }
};

struct Context {
  const Problem& problem;
  const Model& model;
};

PetscErrorCode RHSFunction(TS, PetscReal t, Vec u, Vec f, void* context) {
  return guarded([&] {
    const auto& [problem, model] = *static_cast<Context*>(context);
    model.rhs(Part::full, u, f);
    double* a;
    SS_TRY(VecGetArray(f, &a));
    for (PetscInt i = 0; i < model.local(); ++i) {
      if (model.held(model.first() + i)) continue;
      double psi, eta;
      problem.source(problem.scene.x(model.first() + i), t, &psi, &eta);
      a[2 * i] += psi;
      a[2 * i + 1] += eta;
    }
    SS_TRY(VecRestoreArray(f, &a));
  });
}

// Largest error of psi and eta at t = 1; a held node is not solved for. dt = 0: adaptive, far below the error
// in space.
double error(const Problem& problem, const char* method, double dt) {
  Model model(PETSC_COMM_WORLD, problem.scene);
  VecHandle u = model.create_vector();
  const auto each_node = [&](const auto& body) {
    double* a;
    SS_TRY(VecGetArray(u, &a));
    for (PetscInt i = 0; i < model.local(); ++i)
      body(a + 2 * i, problem.shape(problem.scene.x(model.first() + i)), model.held(model.first() + i));
    SS_TRY(VecRestoreArray(u, &a));
  };
  each_node([](double* at, double s, bool) {
    at[0] = 0.4 + s * Problem::g(0);
    at[1] = 0.1 + s * Problem::q(0);
  });
  model.set_held(u);
  Context context{problem, model};
  TsHandle ts;
  TSAdapt adapt;
  SS_TRY(TSCreate(PETSC_COMM_WORLD, ts.out()));
  SS_TRY(TSSetType(ts, TSRK));
  SS_TRY(TSRKSetType(ts, method));
  SS_TRY(TSSetRHSFunction(ts, nullptr, RHSFunction, &context));
  SS_TRY(TSGetAdapt(ts, &adapt));
  SS_TRY(TSAdaptSetType(adapt, dt > 0 ? TSADAPTNONE : TSADAPTBASIC));
  SS_TRY(TSSetTolerances(ts, 1e-12, nullptr, 1e-12, nullptr));
  SS_TRY(TSSetTimeStep(ts, dt > 0 ? dt : 0.01));
  SS_TRY(TSSetMaxTime(ts, 1));
  SS_TRY(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_MATCHSTEP));
  SS_TRY(TSSolve(ts, u));
  double largest = 0;
  each_node([&](double* at, double s, bool held) {
    if (held) return;
    largest = std::max(
        {largest, std::abs(at[0] - 0.4 - s * Problem::g(1)), std::abs(at[1] - 0.1 - s * Problem::q(1))});
  });
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE, MPI_MAX, PETSC_COMM_WORLD));
  return largest;
}

enum class Kind { ring, free, held };

Problem problem_with(Kind kind, int order, PetscInt cells) {
  Problem p;
  p.scene.order = order;
  p.scene.length = 4;
  p.scene.n = kind == Kind::ring ? cells : cells + 1;
  p.scene.left = kind == Kind::ring ? End::periodic : kind == Kind::free ? End::free : End::velocity;
  p.scene.right = kind == Kind::ring ? End::periodic : End::free;
  p.scene.left_value = 0.4;
  p.wavenumber = (kind == Kind::ring ? 2 : kind == Kind::free ? 1 : 0.5) * M_PI / p.scene.length;
  p.phase = kind == Kind::free ? M_PI / 2 : 0;
  return p;
}

}  // namespace

TEST_CASE("manufactured solutions in space") {
  for (const auto& [name, kind] :
       {std::pair("ring", Kind::ring), std::pair("free", Kind::free), std::pair("held", Kind::held)})
    for (const int order : {2, 4, 6, 8}) {
      if (kind == Kind::held && order == 8) continue;
      const double coarse = error(problem_with(kind, order, 12), TSRK8VR, 0);
      const double fine = error(problem_with(kind, order, 24), TSRK8VR, 0);
      const double measured = std::log2(coarse / fine);
      INFO(name << " order " << order << ": " << coarse << " to " << fine << ", order measured " << measured);
      CHECK(measured > order - 0.3);
    }
}

TEST_CASE("manufactured solutions in time") {
  // The error in space is the same for both steps and far below theirs: order 8, 64 cells.
  const Problem p = problem_with(Kind::ring, 8, 64);
  for (const auto& [method, order] : {std::pair(TSRK3BS, 3), std::pair(TSRK4, 4), std::pair(TSRK5DP, 5)}) {
    const double measured = std::log2(error(p, method, 1. / 32) / error(p, method, 1. / 64));
    INFO(method << ": order measured " << measured);
    CHECK(measured > order - 0.3);
    CHECK(measured < order + 0.7);
  }
}
