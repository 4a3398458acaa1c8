// The eigenvalues by SLEPc: all of them, or those near a shift.
#include <slepceps.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "base/found_until.hpp"
#include "base/local_values.hpp"
#include "base/log_stage.hpp"
#include "stability/guesses.hpp"
#include "stability/modes.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"
#include "stickslip/numerics/dense.hpp"
#include "stickslip/stability/continuum.hpp"

namespace stickslip {

namespace {

// re + i im, or re alone.
std::vector<Complex> entries_of(Vec re, Vec im, bool real) {
  PetscInt n = 0;
  SS_TRY(VecGetSize(re, &n));
  const Reading x(re), y(im);
  std::vector<Complex> entries;
  for (PetscInt i = 0; i < n; ++i) entries.emplace_back(x[i], real ? 0. : y[i]);
  return entries;
}

// x in units of the entries of a node, or out of them.
void scale(std::vector<Complex>& x, const std::vector<double>& units) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] *= units[i % units.size()];
}

// psi of an eigenvector of J in those units.
std::vector<Complex> velocities_of(const LinearisedOperator& s, const std::vector<double>& units,
                                   std::vector<Complex> x) {
  scale(x, units);
  std::vector<Complex> psi(s.size());
  for (std::size_t i = 0; i < psi.size(); ++i) psi[i] = s.psi_of(&x[i * s.dof()], i);
  return psi;
}

}  // namespace

// ---- dense
// --------------------------------------------------------------------------------------------------------

std::vector<Mode> dense_modes(const LinearisedOperator& s, PetscInt count) {
  const std::size_t n = s.unknowns(), dof = s.dof();
  const std::vector<double> units = s.balance();
  std::vector<double> J(n * n);
  for (const LinearisedOperator::Entry& e : s.entries())
    J[e.column * n + e.row] += e.value * (units[e.column % dof] / units[e.row % dof]);
  const LogStage solving("eigenvalues");
  constexpr std::size_t takes_a_second = 500;
  if (n > takes_a_second)
    announce(
        fmt::format("all eigenvalues of {} unknowns in one call of LAPACK's, some {:.0f} s, which hears no "
                    "signal but a second one",
                    n, std::ceil(7e-9 * std::pow(double(n), 3))),
        "dense matrices");
  std::vector<Eigenpair> pairs = eigenpairs(int(n), std::move(J));
  beat("dense matrices");
  std::vector<Mode> modes;
  PetscInt eigenvalues = 0;
  for (Eigenpair& pair : pairs) {
    Mode mode;
    mode.value = pair.value;
    if (eigenvalues < count) {
      mode.psi = velocities_of(s, units, std::move(pair.vector));
      eigenvalues += eigenvalues_of(pair.value);
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
  const std::vector<double> units, per_unit;
  Complex sigma;
  BandLU lu;
};

// y = Re (J - sigma)^-1 x, J balanced: real, with the eigenvectors of J, largest for eigenvalues near sigma
// and its conjugate.
PetscErrorCode apply_shifted_inverse(Mat M, Vec x, Vec y) {
  return guarded([&] {
    ShiftedInverse* op = nullptr;
    SS_TRY(MatShellGetContext(M, &op));
    const Reading in(x);
    const Writing out(y);
    const std::size_t n = op->J.unknowns();
    std::vector<Complex> entries(in + 0, in + n);
    scale(entries, op->units);
    std::vector<Complex> image = op->J.resolvent(op->sigma, op->lu, entries);
    scale(image, op->per_unit);
    for (std::size_t i = 0; i < n; ++i) out[i] = image[i].real();
  });
}

// Nothing where LAPACK gives up: it may fail to put values that nearly coincide in order (trexc).
std::optional<std::vector<Mode>> modes_near(const LinearisedOperator& s, Complex sigma, PetscInt count) {
  const PetscInt n = s.unknowns();
  const std::vector<double> units = s.balance();
  std::vector<double> per_unit;
  for (const double unit : units) per_unit.push_back(1 / unit);
  ShiftedInverse op{s, units, per_unit, sigma, {}};
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
  try {
    SS_TRY(EPSSolve(eps));
  } catch (const RankFailure& e) {
    if (std::string(e.what()).find("LAPACK subroutine") == std::string::npos) throw;
    return std::nullopt;
  }
  PetscInt found = 0;
  SS_TRY(EPSGetConverged(eps, &found));
  std::vector<Mode> modes;
  for (PetscInt j = 0; j < found; ++j) {
    PetscScalar a, b;
    SS_TRY(EPSGetEigenpair(eps, j, &a, &b, start, im));
    if (b > 0) continue;  // mu is conjugate to lambda, roughly; either member of a pair gives both
    const std::vector<Complex> vector = entries_of(start, im, b == 0);
    std::vector<Complex> image = vector;
    scale(image, units);
    image = s.multiply(image);
    scale(image, per_unit);
    Mode mode;
    mode.value = inner(vector, image) / inner(vector, vector);
    mode.psi = velocities_of(s, units, vector);
    modes.push_back(std::move(mode));
  }
  return modes;
}

}  // namespace

std::vector<Mode> krylov_modes(const LinearisedOperator& s, Complex sigma, PetscInt count) {
  const double aside = 0.01 * (own_rate(s) + std::abs(sigma));
  for (const Complex& shift : {sigma, sigma + aside, sigma + Complex(aside, 2 * aside)})
    if (auto modes = modes_near(s, shift, count)) return *std::move(modes);
  return {};
}

}  // namespace stickslip
