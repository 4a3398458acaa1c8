// Newton's method for periodic solutions by SNES, as a user's options ask for it.
#include <petscsnes.h>

#include "base/local_values.hpp"
#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

namespace {

struct Solve {
  PeriodicEquations& equations;
  const std::vector<Condition>& conditions;
  PeriodicEquations::Newton result;
};

PetscErrorCode form_function(SNES, Vec x, Vec f, void* context) {
  return guarded([&] {
    beat("Newton steps");
    auto& solve = *static_cast<Solve*>(context);
    const Reading in(x);
    const Writing out(f);
    const PeriodicEquations::Step step =
        solve.equations.step({in + 0, in + solve.equations.size()}, solve.conditions);
    solve.result.residual = step.residual;
    for (std::size_t k = 0; k < step.dx.size(); ++k) out[k] = -step.dx[k];
  });
}

PetscErrorCode form_jacobian(SNES, Vec, Mat, Mat, void*) { return 0; }

PetscErrorCode converged(SNES snes, PetscInt, PetscReal, PetscReal, PetscReal, SNESConvergedReason* reason,
                         void* context) {
  return guarded([&] {
    auto& solve = *static_cast<Solve*>(context);
    Vec f;
    SS_TRY(SNESGetFunction(snes, &f, nullptr, nullptr));
    const Reading values(f);
    const bool there =
        solve.result.took(solve.equations.in_units({values + 0, values + solve.equations.size()}),
                          solve.equations.parameters());
    const bool lost = !(solve.result.last_step < 1e6);
    *reason = there ? SNES_CONVERGED_SNORM_RELATIVE : lost ? SNES_DIVERGED_DTOL : SNES_CONVERGED_ITERATING;
  });
}

}  // namespace

PeriodicEquations::Newton PeriodicEquations::newton_by_snes(std::vector<double>& x,
                                                            const std::vector<Condition>& conditions,
                                                            int most) {
  const PetscInt n = PetscInt(size());
  Solve solve{*this, conditions, {}};
  SnesHandle snes;
  VecHandle u, f;
  MatHandle J;
  SS_TRY(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, n, x.data(), u.out()));
  SS_TRY(VecDuplicate(u, f.out()));
  SS_TRY(MatCreateConstantDiagonal(PETSC_COMM_SELF, n, n, n, n, 1, J.out()));
  SS_TRY(SNESCreate(PETSC_COMM_SELF, snes.out()));
  SS_TRY(SNESSetFunction(snes, f, form_function, &solve));
  SS_TRY(SNESSetJacobian(snes, J, J, form_jacobian, nullptr));
  SS_TRY(SNESSetConvergenceTest(snes, converged, &solve, nullptr));
  SS_TRY(SNESSetTolerances(snes, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, most, PETSC_DEFAULT));
  SNESLineSearch search;
  SS_TRY(SNESGetLineSearch(snes, &search));
  SS_TRY(SNESLineSearchSetType(search, SNESLINESEARCHBASIC));
  KSP ksp;
  PC pc;
  SS_TRY(SNESGetKSP(snes, &ksp));
  SS_TRY(KSPSetType(ksp, KSPPREONLY));
  SS_TRY(KSPGetPC(ksp, &pc));
  SS_TRY(PCSetType(pc, PCNONE));
  SS_TRY(SNESSetFromOptions(snes));
  SS_TRY(SNESSolve(snes, nullptr, u));
  SNESConvergedReason reason;
  SS_TRY(SNESGetConvergedReason(snes, &reason));
  solve.result.converged = reason > 0;
  return solve.result;
}

}  // namespace stickslip
