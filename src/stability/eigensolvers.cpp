// The eigenvalues by SLEPc: all of them, or those near a shift.
#include <slepceps.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/found_until.hpp"
#include "base/local_values.hpp"
#include "base/log_stage.hpp"
#include "stability/guesses.hpp"
#include "stability/modes.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"

namespace stickslip {

namespace {

// re + i im, or re alone; every `step`th entry.
std::vector<Complex> entries_of(Vec re, Vec im, bool real, std::size_t step) {
  PetscInt n = 0;
  SS_TRY(VecGetSize(re, &n));
  const Reading x(re), y(im);
  std::vector<Complex> entries;
  for (PetscInt i = 0; i < n; i += step) entries.emplace_back(x[i], real ? 0. : y[i]);
  return entries;
}

// psi of an eigenvector of J.
std::vector<Complex> velocities_of(const LinearisedOperator& s, Vec re, Vec im, bool real) {
  const std::vector<Complex> x = entries_of(re, im, real, 1);
  std::vector<Complex> psi(s.size());
  for (std::size_t i = 0; i < psi.size(); ++i) psi[i] = s.psi_of(&x[i * s.dof()], i);
  return psi;
}

}  // namespace

// ---- dense
// --------------------------------------------------------------------------------------------------------

std::vector<Mode> dense_modes(const LinearisedOperator& s, PetscInt count) {
  const PetscInt n = s.unknowns();
  MatHandle J;
  SS_TRY(MatCreateSeqDense(PETSC_COMM_SELF, n, n, nullptr, J.out()));
  for (const LinearisedOperator::Entry& e : s.entries())
    SS_TRY(MatSetValue(J, e.row, e.column, e.value, ADD_VALUES));
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  Handle<EPS, EPSDestroy> eps;
  SS_TRY(EPSCreate(PETSC_COMM_SELF, eps.out()));
  SS_TRY(EPSSetOperators(eps, J, nullptr));
  SS_TRY(EPSSetProblemType(eps, EPS_NHEP));
  SS_TRY(EPSSetType(eps, EPSLAPACK));
  SS_TRY(EPSSetWhichEigenpairs(eps, EPS_LARGEST_REAL));
  const LogStage solving("eigenvalues");
  constexpr PetscInt takes_a_second = 500;
  if (n > takes_a_second)
    announce(
        fmt::format("all eigenvalues of {} unknowns in one call of LAPACK's, some {:.0f} s, which hears no "
                    "signal but a second one",
                    n, std::ceil(7e-9 * std::pow(double(n), 3))),
        "dense matrices");
  SS_TRY(EPSSolve(eps));
  beat("dense matrices");
  PetscInt found = 0;
  SS_TRY(EPSGetConverged(eps, &found));
  VecHandle re, im;
  SS_TRY(MatCreateVecs(J, re.out(), im.out()));
  std::vector<Mode> modes;
  PetscInt eigenvalues = 0;
  for (PetscInt j = 0; j < found; ++j) {
    PetscScalar a, b;
    SS_TRY(EPSGetEigenvalue(eps, j, &a, &b));
    if (b < 0) continue;
    Mode mode;
    mode.value = {a, b};
    if (eigenvalues < count) {
      SS_TRY(EPSGetEigenvector(eps, j, re, im));
      mode.psi = velocities_of(s, re, im, b == 0);
      eigenvalues += b > 0 ? 2 : 1;
    }
    modes.push_back(std::move(mode));
  }
  return modes;
}

// ---- krylov
// -------------------------------------------------------------------------------------------------------

namespace {

struct ShiftedInverse {
  const LinearisedOperator& J;
  Complex sigma;
  BandLU lu;
};

// y = Re (J - sigma)^-1 x: real, with the eigenvectors of J, largest for eigenvalues near sigma and its
// conjugate.
PetscErrorCode apply_shifted_inverse(Mat M, Vec x, Vec y) {
  return guarded([&] {
    ShiftedInverse* op = nullptr;
    SS_TRY(MatShellGetContext(M, &op));
    const Reading in(x);
    const Writing out(y);
    const std::size_t n = op->J.unknowns();
    const std::vector<Complex> image =
        op->J.resolvent(op->sigma, op->lu, std::vector<Complex>(in + 0, in + n));
    for (std::size_t i = 0; i < n; ++i) out[i] = image[i].real();
  });
}

}  // namespace

std::vector<Mode> krylov_modes(const LinearisedOperator& s, Complex sigma, PetscInt count) {
  const PetscInt n = s.unknowns();
  ShiftedInverse op{s, sigma, {}};
  s.factor(sigma, op.lu);
  MatHandle M;
  SS_TRY(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, &op, M.out()));
  SS_TRY(MatShellSetOperation(M, MATOP_MULT, reinterpret_cast<void (*)()>(apply_shifted_inverse)));
  Handle<EPS, EPSDestroy> eps;
  SS_TRY(EPSCreate(PETSC_COMM_SELF, eps.out()));
  SS_TRY(EPSSetOperators(eps, M, nullptr));
  SS_TRY(EPSSetProblemType(eps, EPS_NHEP));
  SS_TRY(EPSSetWhichEigenpairs(eps, EPS_LARGEST_MAGNITUDE));
  const PetscInt nev = std::min<PetscInt>(count, n), ncv = std::min<PetscInt>(n, 2 * nev + 12);
  SS_TRY(EPSSetDimensions(eps, nev, ncv, PETSC_DEFAULT));
  SS_TRY(EPSSetTolerances(eps, 1e-9, s.size() > many_nodes ? 12 : 60));
  VecHandle start, im;
  SS_TRY(MatCreateVecs(M, start.out(), im.out()));
  {
    const Writing x(start);
    Noise noise;
    for (PetscInt i = 0; i < n; ++i) x[i] = noise.next();
  }
  Vec first = start;
  SS_TRY(EPSSetInitialSpace(eps, 1, &first));
  SS_TRY(EPSSetFromOptions(eps));
  const LogStage solving("eigenvalues");
  SS_TRY(EPSSolve(eps));
  PetscInt found = 0;
  SS_TRY(EPSGetConverged(eps, &found));
  std::vector<Mode> modes;
  for (PetscInt j = 0; j < found; ++j) {
    PetscScalar a, b;
    SS_TRY(EPSGetEigenpair(eps, j, &a, &b, start, im));
    if (b > 0) continue;  // mu is conjugate to lambda, roughly; either member of a pair gives both
    const std::vector<Complex> vector = entries_of(start, im, b == 0, 1);
    Mode mode;
    mode.value = inner(vector, s.multiply(vector)) / inner(vector, vector);
    mode.psi = velocities_of(s, start, im, b == 0);
    modes.push_back(std::move(mode));
  }
  return modes;
}

}  // namespace stickslip
