// Newton's method by SNES for the equations of a train.
#include <petscsnes.h>

#include <algorithm>
#include <cmath>

#include "base/local_values.hpp"
#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"
#include "waves/train_equations.hpp"

namespace stickslip {

namespace {

struct Steps {
  PetscInt numbers = 1;  // q, or q and lambda: the last entries
  double last = -1;
};

// Calls work(problem, in, out) on the entries of x and y; y may be null.
template <class Work>
PetscErrorCode on_entries(void* problem, Vec x, Vec y, Work&& work) {
  return guarded([&] {
    const Reading in(x);
    const Writing out(y);
    work(*static_cast<TrainEquations*>(problem), in, out);
  });
}

PetscErrorCode form_function(SNES, Vec x, Vec f, void* context) {
  return on_entries(context, x, f,
                    [](TrainEquations& p, const double* in, double* out) { p.residual(in, out); });
}

PetscErrorCode form_jacobian(SNES, Vec x, Mat, Mat, void* context) {
  return on_entries(context, x, nullptr,
                    [](TrainEquations& p, const double* in, double*) { p.linearise(in); });
}

PetscErrorCode shell_multiply(Mat J, Vec x, Vec y) {
  void* context;
  PetscCall(MatShellGetContext(J, &context));
  return on_entries(context, x, y,
                    [](TrainEquations& p, const double* in, double* out) { p.multiply(in, out); });
}

PetscErrorCode shell_solve(PC pc, Vec x, Vec y) {
  void* context;
  PetscCall(PCShellGetContext(pc, &context));
  return on_entries(context, x, y,
                    [](TrainEquations& p, const double* in, double* out) { p.solve(in, out); });
}

// Converged by the step, not the residual, which cannot fall below the round-off of stiff intervals. In a
// front of width w (in phase) psi itself cannot be known better than 1e-16/w, so that there the numbers
// sought decide.
PetscErrorCode converged(SNES snes, PetscInt it, PetscReal, PetscReal, PetscReal fnorm,
                         SNESConvergedReason* reason, void* context) {
  return guarded([&] {
    auto* steps = static_cast<Steps*>(context);
    *reason = SNES_CONVERGED_ITERATING;
    if (!std::isfinite(fnorm)) {
      *reason = SNES_DIVERGED_FNORM_NAN;
      return;
    }
    if (it == 0) return;
    Vec dx;
    PetscReal step, number_step = 0;
    PetscInt size;
    SS_TRY(SNESGetSolutionUpdate(snes, &dx));
    SS_TRY(VecNorm(dx, NORM_INFINITY, &step));
    SS_TRY(VecGetSize(dx, &size));
    const Reading values(dx);
    for (PetscInt i = size - steps->numbers; i < size; ++i)
      number_step = std::max(number_step, std::abs(values[i]));
    const bool stagnant = steps->last >= 0 && step > .2 * steps->last;
    if (step < 1e-12 || (stagnant && step < 1e-8) || (stagnant && step < 1e-3 && number_step < 1e-11)) {
      *reason = SNES_CONVERGED_SNORM_RELATIVE;
    } else if (step > 1e6) {
      *reason = SNES_DIVERGED_DTOL;
    }
    steps->last = step;
  });
}

}  // namespace

bool newton(TrainEquations& problem, std::vector<double>& x, double* last_step, int max_it) {
  beat("trains tried");
  const PetscInt n = PetscInt(problem.size());
  SnesHandle snes;
  VecHandle u, f;
  MatHandle J;
  Steps steps{problem.parameters()};
  SS_TRY(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, n, x.data(), u.out()));
  SS_TRY(VecDuplicate(u, f.out()));
  SS_TRY(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, &problem, J.out()));
  SS_TRY(MatShellSetOperation(J, MATOP_MULT, reinterpret_cast<void (*)()>(shell_multiply)));
  SS_TRY(SNESCreate(PETSC_COMM_SELF, snes.out()));
  SS_TRY(SNESSetFunction(snes, f, form_function, &problem));
  SS_TRY(SNESSetJacobian(snes, J, J, form_jacobian, &problem));
  SS_TRY(SNESSetConvergenceTest(snes, converged, &steps, nullptr));
  SS_TRY(SNESSetTolerances(snes, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, max_it, PETSC_DEFAULT));
  SNESLineSearch search;
  SS_TRY(SNESGetLineSearch(snes, &search));
  SS_TRY(SNESLineSearchSetType(search, SNESLINESEARCHBASIC));
  KSP ksp;
  PC pc;
  SS_TRY(SNESGetKSP(snes, &ksp));
  SS_TRY(KSPSetType(ksp, KSPPREONLY));
  SS_TRY(KSPGetPC(ksp, &pc));
  SS_TRY(PCSetType(pc, PCSHELL));
  SS_TRY(PCShellSetContext(pc, &problem));
  SS_TRY(PCShellSetApply(pc, shell_solve));
  if (problem.setting().request.library_options) SS_TRY(SNESSetFromOptions(snes));
  SS_TRY(SNESSolve(snes, nullptr, u));
  SNESConvergedReason reason;
  SS_TRY(SNESGetConvergedReason(snes, &reason));
  if (last_step) *last_step = steps.last;
  return reason > 0;
}

}  // namespace stickslip
