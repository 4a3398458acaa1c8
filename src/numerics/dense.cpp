#include "stickslip/numerics/dense.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "stickslip/base/error.hpp"

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
}

namespace stickslip {

template <class T>
bool solve_dense(int n, T* a, int columns, T* b) {
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(a[i * n + k]) > std::abs(a[pivot * n + k])) pivot = i;
    if (!(std::abs(a[pivot * n + k]) > 0)) return false;
    if (pivot != k) {
      for (int j = k; j < n; ++j) std::swap(a[k * n + j], a[pivot * n + j]);
      for (int j = 0; j < columns; ++j) std::swap(b[k * columns + j], b[pivot * columns + j]);
    }
    const T inverse = T(1) / a[k * n + k];
    for (int i = k + 1; i < n; ++i) {
      const T factor = a[i * n + k] * inverse;
      if (factor == T(0)) continue;
      for (int j = k + 1; j < n; ++j) a[i * n + j] -= factor * a[k * n + j];
      for (int j = 0; j < columns; ++j) b[i * columns + j] -= factor * b[k * columns + j];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    const T inverse = T(1) / a[k * n + k];
    for (int j = 0; j < columns; ++j) {
      T sum = b[k * columns + j];
      for (int i = k + 1; i < n; ++i) sum -= a[k * n + i] * b[i * columns + j];
      b[k * columns + j] = sum * inverse;
    }
  }
  return true;
}

template bool solve_dense(int, double*, int, double*);
template bool solve_dense(int, std::complex<double>*, int, std::complex<double>*);

template <class T>
bool solve_banded(int n, int band, T* a, int columns, T* b) {
  for (int k = 0; k < n; ++k) {
    const int below = std::min(n, k + band + 1), right = std::min(n, k + 2 * band + 1);
    int pivot = k;
    for (int i = k + 1; i < below; ++i)
      if (std::abs(a[i * n + k]) > std::abs(a[pivot * n + k])) pivot = i;
    if (!(std::abs(a[pivot * n + k]) > 0)) return false;
    if (pivot != k) {
      std::swap_ranges(a + k * n + k, a + k * n + right, a + pivot * n + k);
      std::swap_ranges(b + k * columns, b + (k + 1) * columns, b + pivot * columns);
    }
    const T inverse = T(1) / a[k * n + k];
    for (int i = k + 1; i < below; ++i) {
      const T factor = a[i * n + k] * inverse;
      if (factor == T(0)) continue;
      for (int j = k + 1; j < right; ++j) a[i * n + j] -= factor * a[k * n + j];
      for (int j = 0; j < columns; ++j) b[i * columns + j] -= factor * b[k * columns + j];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    const T inverse = T(1) / a[k * n + k];
    for (int i = k + 1; i < std::min(n, k + 2 * band + 1); ++i) {
      const T factor = a[k * n + i];
      if (factor == T(0)) continue;
      for (int j = 0; j < columns; ++j) b[k * columns + j] -= factor * b[i * columns + j];
    }
    for (int j = 0; j < columns; ++j) b[k * columns + j] *= inverse;
  }
  return true;
}

template bool solve_banded(int, int, double*, int, double*);
template bool solve_banded(int, int, std::complex<double>*, int, std::complex<double>*);

namespace {

std::vector<std::complex<double>> sorted(std::vector<std::complex<double>> values) {
  std::stable_sort(values.begin(), values.end(),
                   [](const auto& x, const auto& y) { return std::abs(x) > std::abs(y); });
  return values;
}

void check_qz(int info) {
  if (info != 0) throw Failure("LAPACK found no generalised eigenvalues");
}

}  // namespace

// Row-major is the transposed, which has the same eigenvalues.
std::vector<std::complex<double>> generalised_eigenvalues(int d, std::vector<double> a,
                                                          std::vector<double> b) {
  const std::size_t n = std::size_t(d);
  std::vector<double> re(n), im(n), beta(n), work(8 * n + 16);
  const int one = 1, size = int(work.size());
  int info = 0;
  dggev_("N", "N", &d, a.data(), &d, b.data(), &d, re.data(), im.data(), beta.data(), nullptr, &one, nullptr,
         &one, work.data(), &size, &info, 1, 1);
  check_qz(info);
  std::vector<std::complex<double>> values;
  for (std::size_t k = 0; k < n; ++k) values.emplace_back(re[k] / beta[k], im[k] == 0 ? 0. : im[k] / beta[k]);
  return sorted(std::move(values));
}

std::vector<std::complex<double>> generalised_eigenvalues(int d, std::vector<std::complex<double>> a,
                                                          std::vector<std::complex<double>> b) {
  const std::size_t n = std::size_t(d);
  std::vector<std::complex<double>> alpha(n), beta(n), work(2 * n + 16);
  std::vector<double> real_work(8 * n);
  const int one = 1, size = int(work.size());
  int info = 0;
  zggev_("N", "N", &d, a.data(), &d, b.data(), &d, alpha.data(), beta.data(), nullptr, &one, nullptr, &one,
         work.data(), &size, real_work.data(), &info, 1, 1);
  check_qz(info);
  for (std::size_t k = 0; k < n; ++k) alpha[k] /= beta[k];
  return sorted(std::move(alpha));
}

}  // namespace stickslip
