// How far perturbations can grow before the spectrum has its say: the operator is not normal.
#include <petscsys.h>
// after petscsys.h
#include <petscblaslapack.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/error.hpp"
#include "stickslip/spectrum.hpp"
#include "stickslip/stencil.hpp"

namespace stickslip {

namespace {

using Matrix = std::vector<double>;  // square, by columns

Matrix times(const Matrix& a, const Matrix& b, PetscBLASInt m) {
  Matrix c(a.size());
  const double one = 1, zero = 0;
  BLASgemm_("N", "N", &m, &m, &m, &one, a.data(), &m, b.data(), &m, &zero, c.data(), &m);
  return c;
}

// Largest eigenvalue of a symmetric matrix.
double largest_eigenvalue(Matrix a, PetscBLASInt m) {
  std::vector<double> values(std::size_t(m), 0.), work(std::size_t(8 * m));
  PetscBLASInt size = 8 * m, info = 0;
  LAPACKsyev_("N", "U", &m, a.data(), &m, values.data(), work.data(), &size, &info);
  if (info != 0) throw Failure("LAPACK found no eigenvalues of the symmetric part");
  return values.back();
}

double two_norm(const Matrix& x, PetscBLASInt m) {
  Matrix square(x.size());
  const double one = 1, zero = 0;
  BLASgemm_("T", "N", &m, &m, &m, &one, x.data(), &m, x.data(), &m, &zero, square.data(), &m);
  return std::sqrt(std::max(0., largest_eigenvalue(std::move(square), m)));
}

// exp(M t): Taylor's series of M t/2^k, squared k times.
Matrix exponential(const Matrix& M, PetscBLASInt m, double t) {
  double norm = 0;
  for (PetscBLASInt j = 0; j < m; ++j) {
    double column = 0;
    for (PetscBLASInt i = 0; i < m; ++i) column += std::abs(M[std::size_t(j * m + i)]) * t;
    norm = std::max(norm, column);
  }
  const int halvings = norm > 0.5 ? int(std::ceil(std::log2(norm / 0.5))) : 0;
  Matrix a = M, sum(M.size(), 0.), term(M.size(), 0.);
  for (double& x : a) x *= std::ldexp(t, -halvings);
  for (PetscBLASInt i = 0; i < m; ++i) sum[std::size_t(i * m + i)] = term[std::size_t(i * m + i)] = 1;
  for (int k = 1; k <= 16; ++k) {
    term = times(term, a, m);
    for (std::size_t i = 0; i < term.size(); ++i) sum[i] += term[i] /= k;
  }
  for (int k = 0; k < halvings; ++k) sum = times(sum, sum, m);
  return sum;
}

void grow(const Matrix& M, PetscBLASInt m, double horizon, Transient& result) {
  Matrix symmetric(M.size());
  for (PetscBLASInt i = 0; i < m; ++i)
    for (PetscBLASInt j = 0; j < m; ++j)
      symmetric[std::size_t(j * m + i)] = (M[std::size_t(j * m + i)] + M[std::size_t(i * m + j)]) / 2;
  result.abscissa = std::max(result.abscissa, largest_eigenvalue(std::move(symmetric), m));
  if (horizon <= 0) return;
  const int steps = 200;
  const Matrix step = exponential(M, m, horizon / steps);
  Matrix x = step;
  for (int k = 1; k <= steps; ++k) {
    const double g = two_norm(x, m);
    if (g > result.growth) {
      result.growth = g;
      result.time = horizon * k / steps;
    }
    if (k < steps) x = times(x, step, m);
  }
}

}  // namespace

std::optional<Transient> transient_growth(const Sliding& s, double growth_rate) {
  Transient result;
  result.abscissa = -std::numeric_limits<double>::infinity();
  // growth is bounded only where sliding is stable; the largest comes within a few damping or oscillation times
  const double slow = std::min(std::abs(growth_rate), std::sqrt(s.A * s.K0) + 1e-300);
  const double horizon = growth_rate < 0 ? 6 / slow : 0;
  const std::size_t d = s.dof();
  const std::vector<Sliding::Wave> waves = s.exact_waves();
  if (!waves.empty()) {
    // a block for every wavenumber, in P = sqrt(K/A) p, e, t
    const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
    for (const Sliding::Wave& w : waves) {
      const double K = s.K0 + s.K1 * symbol(s.scene.order, h, w.k);
      if (!(K > 0)) continue;
      const double root = std::sqrt(K / s.A);
      Matrix M(d * d, 0.);
      const auto entry = [&](std::size_t i, std::size_t j) -> double& { return M[j * d + i]; };
      entry(0, 0) = -s.A * (s.B + s.F_psi[0]);
      entry(0, 1) = s.A * root;
      entry(1, 0) = (-K + s.s_delta * s.F_psi[0]) / root;
      entry(1, 1) = -s.s_delta;
      if (d == 3) {
        entry(0, 2) = -s.A * root * s.F_state[0];
        entry(1, 2) = s.s_delta * s.F_state[0];
        entry(2, 0) = s.g_psi[0] / root;
        entry(2, 2) = -s.r[0];
      }
      grow(M, PetscBLASInt(d), horizon, result);
    }
    return result;
  }
  if (!s.symmetric || !(s.K0 > 0) || s.size() * d > 400) return std::nullopt;
  // dense: W (K0 - K1 D2) = L L^T, P = L^T p/sqrt(A), e and t times the root of the weight
  const std::size_t n = s.size(), m = n * d;
  PetscBLASInt size = PetscBLASInt(n), info = 0;
  Matrix L(n * n, 0.);
  for (const Sliding::Entry& e : s.entries())
    if (e.row % d == 1 && e.column % d == 0) L[(e.column / d) * n + e.row / d] -= s.weight[e.row / d] * e.value;
  for (std::size_t i = 0; i < n; ++i) L[i * n + i] += s.weight[i] * s.s_delta * s.F_psi[i];
  LAPACKpotrf_("L", &size, L.data(), &size, &info);
  if (info != 0) return std::nullopt;
  const auto lower = [&](std::size_t i, std::size_t j) { return i >= j ? L[j * n + i] : 0.; };
  // columns of the inverse of L^T, by back substitution
  Matrix inverse(n * n, 0.);  // (L^T)^-1
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = n; i-- > 0;) {
      double sum = i == j ? 1 : 0;
      for (std::size_t k = i + 1; k < n; ++k) sum -= lower(k, i) * inverse[j * n + k];
      inverse[j * n + i] = sum / lower(i, i);
    }
  // M = T J T^-1 column by column, the order of unknowns: all P, all e, all t
  Matrix M(m * m, 0.);
  std::vector<Complex> x(m), y(m);
  for (std::size_t column = 0; column < m; ++column) {
    std::fill(x.begin(), x.end(), Complex(0));
    const std::size_t c = column / n, j = column % n;
    if (c == 0) {
      for (std::size_t i = 0; i < n; ++i) x[i * d] = std::sqrt(s.A) * inverse[j * n + i];
    } else {
      x[j * d + c] = 1 / std::sqrt(s.weight[j]);
    }
    s.multiply(x.data(), y.data());
    for (std::size_t i = 0; i < n; ++i) {
      double P = 0;
      for (std::size_t k = i; k < n; ++k) P += lower(k, i) * y[k * d].real();
      M[column * m + i] = P / std::sqrt(s.A);
      for (std::size_t k = 1; k < d; ++k) M[column * m + k * n + i] = std::sqrt(s.weight[i]) * y[i * d + k].real();
    }
  }
  grow(M, PetscBLASInt(m), horizon, result);
  return result;
}

}  // namespace stickslip
