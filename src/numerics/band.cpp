#include "stickslip/numerics/band.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

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

// std::complex products check for infinities; here they are plain.
inline Complex product(Complex a, Complex b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
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

}  // namespace stickslip
