#include "stickslip/numerics/band.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip {

namespace {
// std::complex products check for infinities; here they are plain.
inline Complex product(Complex a, Complex b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
inline double size(Complex a) { return std::abs(a.real()) + std::abs(a.imag()); }
inline Complex inverse(Complex a) {
  const double s = 1 / size(a);  // scaled, so that the square neither overflows nor vanishes
  const Complex b{a.real() * s, a.imag() * s};
  const double d = s / (b.real() * b.real() + b.imag() * b.imag());
  return {b.real() * d, -b.imag() * d};
}
}  // namespace

void BandLU::reset(std::size_t n, int lower, int upper) {
  n_ = n;
  lower_ = lower;
  upper_ = upper;
  width_ = 2 * lower + upper + 1;
  a_.assign(n * std::size_t(width_), Complex(0));
  pivot_.assign(n, 0);
}

LogDet BandLU::factor(bool exchange_rows) {
  LogDet det;
  double mantissa_re = 1, mantissa_im = 0;
  const std::size_t w = std::size_t(width_);
  double largest = 0;
  for (const Complex& x : a_) largest = std::max(largest, size(x));
  const double tiny = std::max(largest, std::numeric_limits<double>::min()) * std::numeric_limits<double>::epsilon();
  for (std::size_t k = 0; k < n_; ++k) {
    const int below = int(std::min<std::size_t>(std::size_t(lower_), n_ - 1 - k));
    const int right = int(std::min<std::size_t>(std::size_t(lower_ + upper_), n_ - 1 - k));
    Complex* row_k = &a_[k * w + std::size_t(lower_)];  // row_k[j - k]
    int p = 0;
    double best = size(row_k[0]);
    for (int r = 1; exchange_rows && r <= below; ++r) {
      const double s = size(a_[(k + std::size_t(r)) * w + std::size_t(lower_ - r)]);
      if (s > best) {
        best = s;
        p = r;
      }
    }
    pivot_[k] = p;
    double sign = 1;
    if (p > 0) {
      Complex* row_p = &a_[(k + std::size_t(p)) * w + std::size_t(lower_ - p)];
      for (int j = 0; j <= right; ++j) std::swap(row_k[j], row_p[j]);
      sign = -1;
    }
    if (best == 0) {
      row_k[0] = tiny;
      det.log_abs = -std::numeric_limits<double>::infinity();
    }
    const Complex d = product(Complex(mantissa_re, mantissa_im), sign * row_k[0]);
    if (!exchange_rows) det.phase += std::arg(row_k[0]);
    const double s = size(d);
    det.log_abs += std::log(s);
    mantissa_re = d.real() / s;
    mantissa_im = d.imag() / s;
    const Complex inv = inverse(row_k[0]);
    for (int r = 1; r <= below; ++r) {
      Complex* row = &a_[(k + std::size_t(r)) * w + std::size_t(lower_ - r)];
      if (row[0] == Complex(0)) continue;
      const Complex l = product(row[0], inv);
      row[0] = l;
      for (int j = 1; j <= right; ++j) row[j] -= product(l, row_k[j]);
    }
  }
  const double modulus = std::hypot(mantissa_re, mantissa_im);
  det.log_abs += std::log(modulus);
  det.unit = Complex(mantissa_re, mantissa_im) / modulus;
  return det;
}

void BandLU::solve(Complex* b) const {
  const std::size_t w = std::size_t(width_);
  for (std::size_t k = 0; k < n_; ++k) {
    if (pivot_[k]) std::swap(b[k], b[k + std::size_t(pivot_[k])]);
    const int below = int(std::min<std::size_t>(std::size_t(lower_), n_ - 1 - k));
    const Complex x = b[k];
    for (int r = 1; r <= below; ++r)
      b[k + std::size_t(r)] -= product(a_[(k + std::size_t(r)) * w + std::size_t(lower_ - r)], x);
  }
  for (std::size_t k = n_; k-- > 0;) {
    const int right = int(std::min<std::size_t>(std::size_t(lower_ + upper_), n_ - 1 - k));
    const Complex* row = &a_[k * w + std::size_t(lower_)];
    Complex x = b[k];
    for (int j = 1; j <= right; ++j) x -= product(row[j], b[k + std::size_t(j)]);
    b[k] = product(x, inverse(row[0]));
  }
}

void BandLU::solve_transposed(Complex* b) const {
  const std::size_t w = std::size_t(width_);
  for (std::size_t k = 0; k < n_; ++k) {
    const int right = int(std::min<std::size_t>(std::size_t(lower_ + upper_), n_ - 1 - k));
    const Complex* row = &a_[k * w + std::size_t(lower_)];
    const Complex x = b[k] = product(b[k], inverse(row[0]));
    for (int j = 1; j <= right; ++j) b[k + std::size_t(j)] -= product(row[j], x);
  }
  for (std::size_t k = n_; k-- > 0;) {
    const int below = int(std::min<std::size_t>(std::size_t(lower_), n_ - 1 - k));
    Complex x = b[k];
    for (int r = 1; r <= below; ++r)
      x -= product(a_[(k + std::size_t(r)) * w + std::size_t(lower_ - r)], b[k + std::size_t(r)]);
    b[k] = x;
    if (pivot_[k]) std::swap(b[k], b[k + std::size_t(pivot_[k])]);
  }
}

}  // namespace stickslip
