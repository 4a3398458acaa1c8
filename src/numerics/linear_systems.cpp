
#include "stickslip/numerics/linear_systems.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <type_traits>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

// PETSc does not declare these of LAPACK.
extern "C" {
void dggev_(const char* left, const char* right, const int* n, double* a, const int* rows_a, double* b,
            const int* rows_b, double* re, double* im, double* beta, double* vl, const int* rows_l,
            double* vr, const int* rows_r, double* work, const int* size, int* info, std::size_t,
            std::size_t);
void zggev_(const char* left, const char* right, const int* n, std::complex<double>* a, const int* rows_a,
            std::complex<double>* b, const int* rows_b, std::complex<double>* alpha,
            std::complex<double>* beta, std::complex<double>* vl, const int* rows_l, std::complex<double>* vr,
            const int* rows_r, std::complex<double>* work, const int* size, double* real_work, int* info,
            std::size_t, std::size_t);
void dgeev_(const char* left, const char* right, const int* n, double* a, const int* rows_a, double* re,
            double* im, double* vl, const int* rows_l, double* vr, const int* rows_r, double* work,
            const int* size, int* info, std::size_t, std::size_t);
void zgeev_(const char* left, const char* right, const int* n, std::complex<double>* a, const int* rows_a,
            std::complex<double>* values, std::complex<double>* vl, const int* rows_l,
            std::complex<double>* vr, const int* rows_r, std::complex<double>* work, const int* size,
            double* real_work, int* info, std::size_t, std::size_t);
}

// PETSc declares LAPACK for its own scalars only, which are real, and without these.
extern "C" {
void zgbtrf_(const int* m, const int* n, const int* lower, const int* upper, std::complex<double>* a,
             const int* height, int* exchanged, int* info);
void zgbtrs_(const char* form, const int* n, const int* lower, const int* upper, const int* columns,
             const std::complex<double>* a, const int* height, const int* exchanged, std::complex<double>* b,
             const int* rows, int* info, std::size_t form_length);
void dpbtrf_(const char* triangle, const int* n, const int* band, double* a, const int* height, int* info,
             std::size_t triangle_length);
}

namespace stickslip {

namespace {

void sort_by_modulus(std::vector<std::complex<double>>& values) {
  std::stable_sort(values.begin(), values.end(),
                   [](const auto& x, const auto& y) { return std::abs(x) > std::abs(y); });
}

}  // namespace

// Row-major is the transposed, which has the same eigenvalues.
template <class T>
std::vector<std::complex<double>> eigenvalues(int d, std::vector<T> a) {
  std::vector<std::complex<double>> values(d);
  std::vector<T> work(4 * d);
  std::vector<double> real(2 * d);  // real and imaginary parts, or room
  const int one = 1, size = int(work.size());
  int info = 0;
  if constexpr (std::is_same_v<T, double>)
    dgeev_("N", "N", &d, a.data(), &d, &real[0], &real[d], nullptr, &one, nullptr, &one, work.data(), &size,
           &info, 1, 1);
  else
    zgeev_("N", "N", &d, a.data(), &d, values.data(), nullptr, &one, nullptr, &one, work.data(), &size,
           real.data(), &info, 1, 1);
  if (info != 0) throw Failure("LAPACK found no eigenvalues");
  if constexpr (std::is_same_v<T, double>)
    for (int k = 0; k < d; ++k) values[k] = {real[k], real[d + k]};
  sort_by_modulus(values);
  return values;
}
template std::vector<std::complex<double>> eigenvalues(int, std::vector<double>);
template std::vector<std::complex<double>> eigenvalues(int, std::vector<std::complex<double>>);

std::vector<Eigenpair> eigenpairs(int d, std::vector<double> a) {
  const std::size_t n = d;
  std::vector<double> re(n), im(n), vectors(n * n), work(1);
  const int one = 1;
  int info = 0;
  for (int size = -1;; size = int(work.size())) {  // first asks for the room
    dgeev_("N", "V", &d, a.data(), &d, re.data(), im.data(), nullptr, &one, vectors.data(), &d, work.data(),
           &size, &info, 1, 1);
    if (size > 0 || info != 0) break;
    work.resize(std::size_t(work[0]));
  }
  if (info != 0) throw Failure("LAPACK found no eigenvalues");
  std::vector<Eigenpair> pairs;
  for (std::size_t k = 0; k < n; ++k) {
    if (im[k] < 0) continue;
    Eigenpair pair{{re[k], im[k]}, std::vector<std::complex<double>>(n)};
    for (std::size_t i = 0; i < n; ++i)
      pair.vector[i] = {vectors[k * n + i], im[k] > 0 ? vectors[(k + 1) * n + i] : 0};
    pairs.push_back(std::move(pair));
  }
  std::stable_sort(pairs.begin(), pairs.end(), [](const Eigenpair& x, const Eigenpair& y) {
    return x.value.real() > y.value.real();
  });
  return pairs;
}

template <class T>
std::vector<std::complex<double>> generalised_eigenvalues(int d, std::vector<T> a, std::vector<T> b) {
  std::vector<std::complex<double>> values(d);
  std::vector<T> beta(d), work(8 * d + 16);
  std::vector<double> real(8 * d);  // real and imaginary parts, or room
  const int one = 1, size = int(work.size());
  int info = 0;
  if constexpr (std::is_same_v<T, double>)
    dggev_("N", "N", &d, a.data(), &d, b.data(), &d, &real[0], &real[d], beta.data(), nullptr, &one, nullptr,
           &one, work.data(), &size, &info, 1, 1);
  else
    zggev_("N", "N", &d, a.data(), &d, b.data(), &d, values.data(), beta.data(), nullptr, &one, nullptr, &one,
           work.data(), &size, real.data(), &info, 1, 1);
  if (info != 0) throw Failure("LAPACK found no generalised eigenvalues");
  for (int k = 0; k < d; ++k)
    if constexpr (std::is_same_v<T, double>)
      values[k] = {real[k] / beta[k], real[d + k] == 0 ? 0. : real[d + k] / beta[k]};
    else
      values[k] /= beta[k];
  sort_by_modulus(values);
  return values;
}
template std::vector<std::complex<double>> generalised_eigenvalues(int, std::vector<double>,
                                                                   std::vector<double>);
template std::vector<std::complex<double>> generalised_eigenvalues(int, std::vector<std::complex<double>>,
                                                                   std::vector<std::complex<double>>);

namespace {

inline double size(Complex a) { return std::abs(a.real()) + std::abs(a.imag()); }

}  // namespace

void LogDet::multiply(Complex factor) {
  const double modulus = std::abs(factor);
  log_abs += std::log(modulus);
  unit = product(unit, factor / modulus);
}

void BandLU::reset(std::size_t n, int lower, int upper) {
  n_ = n;
  lower_ = lower;
  upper_ = upper;
  height_ = 2 * lower + upper + 1;
  a_.assign(n * height_, Complex(0));
}

LogDet BandLU::factor() {
  double largest = 1e-84;  // of zeros alone: so that a solution still has a square
  for (const Complex& x : a_) largest = std::max(largest, size(x));
  const int n = int(n_);
  int info = 0;
  exchanged_.resize(n_);
  zgbtrf_(&n, &n, &lower_, &upper_, a_.data(), &height_, exchanged_.data(), &info);
  LogDet det;
  Complex unit = 1;  // kept near 1 in modulus
  for (std::size_t k = 0; k < n_; ++k) {
    Complex& pivot = a_[place(k, k)];
    if (pivot == Complex(0)) {
      pivot = largest * std::numeric_limits<double>::epsilon();
      det.log_abs = -std::numeric_limits<double>::infinity();
    }
    unit = product(unit, exchanged_[k] == int(k) + 1 ? pivot : -pivot);
    const double modulus = size(unit);
    det.log_abs += std::log(modulus);
    unit = {unit.real() / modulus, unit.imag() / modulus};
  }
  det.multiply(unit);
  return det;
}

std::vector<Complex> BandLU::pivots() {
  std::vector<Complex> found(n_);
  for (std::size_t k = 0; k < n_; ++k) {
    const Complex inverse = 1. / (found[k] = a_[place(k, k)]);
    const std::size_t below = std::min(n_, k + 1 + lower_), right = std::min(n_, k + 1 + upper_);
    for (std::size_t j = k + 1; j < right; ++j) {
      const Complex factor = product(a_[place(k, j)], inverse);
      for (std::size_t i = k + 1; i < below; ++i) a_[place(i, j)] -= product(factor, a_[place(i, k)]);
    }
  }
  return found;
}

void BandLU::solve(char form, Complex* b) const {
  const int n = int(n_), one = 1;
  int info = 0;
  zgbtrs_(&form, &n, &lower_, &upper_, &one, a_.data(), &height_, exchanged_.data(), b, &n, &info, 1);
}

bool positive_definite(std::vector<double>& a, std::size_t n, std::size_t band) {
  const int size = int(n), beside = int(band), height = beside + 1;
  int info = 0;
  dpbtrf_("U", &size, &beside, a.data(), &height, &info, 1);
  return info == 0;
}

namespace {
PC direct_pc(KSP ksp) {
  SS_TRY(KSPSetType(ksp, KSPPREONLY));
  PC pc;
  SS_TRY(KSPGetPC(ksp, &pc));
  return pc;
}

bool is_distributed(KSP ksp) { return ranks_in(PetscObjectComm(reinterpret_cast<PetscObject>(ksp))) > 1; }
}  // namespace

void solve_by_banded_lu(KSP ksp) {
  PC pc = direct_pc(ksp);
  if (is_distributed(ksp)) {
    SS_TRY(PCSetType(pc, PCREDUNDANT));
    KSP inner;
    SS_TRY(PCRedundantGetKSP(pc, &inner));
    SS_TRY(KSPGetPC(inner, &pc));
  }
  SS_TRY(PCSetType(pc, PCLU));
  SS_TRY(PCFactorSetMatOrderingType(pc, MATORDERINGNATURAL));
}

// PCPBJACOBI, which is made for this, keeps the inverses of the first values that a matrix had: in PETSc from
// 3.20 on those of a BAIJ, in 3.25 of an AIJ as well.
void solve_by_blocks(KSP ksp) {
  SS_TRY(PCSetType(direct_pc(ksp), is_distributed(ksp) ? PCBJACOBI : PCILU));
}

}  // namespace stickslip
