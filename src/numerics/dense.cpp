#include "stickslip/numerics/dense.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <type_traits>

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
void dgeev_(const char* left, const char* right, const int* n, double* a, const int* rows_a, double* re,
            double* im, double* vl, const int* rows_l, double* vr, const int* rows_r, double* work,
            const int* size, int* info, std::size_t, std::size_t);
void zgeev_(const char* left, const char* right, const int* n, std::complex<double>* a, const int* rows_a,
            std::complex<double>* values, std::complex<double>* vl, const int* rows_l,
            std::complex<double>* vr, const int* rows_r, std::complex<double>* work, const int* size,
            double* real_work, int* info, std::size_t, std::size_t);
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

}  // namespace stickslip
