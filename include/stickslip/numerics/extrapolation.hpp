// Steps of y' = f(y) of order 12 by extrapolation of the midpoint rule, for smooth problems that are not
// stiff and answers to nearly round-off. Local to the process.
//
// In a step of length h the midpoint rule with n = 2, 4, ..., 12 parts has an error in even powers of h/n;
// the polynomial in (h/n)^2 through the six results is taken at 0. The error estimate is its difference from
// that through the last five, of order 10. 36 evaluations of f a step beside that at its start.
//
// Source: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, Springer 1993,
// section II.9.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace stickslip {

class Extrapolation {
 public:
  // Results of unknowns 0..size-1; the first `controlled` count in the error estimate.
  explicit Extrapolation(std::size_t size)
      : size_(size), columns_(parts * size), a_(size), b_(size), f_(size) {}

  // `into` becomes y after h; f(y, rates) is the right-hand side, f0 its value at y. Returns the largest
  // error estimate of an unknown over `tolerance` (scale + |y|), its scale that of the list: at most 1 is
  // within it; not finite where f is not.
  template <class F>
  double step(F&& f, const double* y, const double* f0, double h, std::size_t controlled, double tolerance,
              const double* scales, double* into) {
    for (int j = 0; j < parts; ++j) {
      double* const result = &columns_[j * size_];
      midpoint(f, y, f0, h, 2 * (j + 1), result);
    }
    // Aitken and Neville: column j becomes the value of the polynomial through results 0..j.
    double error = 0;
    for (std::size_t k = 0; k < size_; ++k) {
      double t[parts];
      for (int j = 0; j < parts; ++j) t[j] = columns_[j * size_ + k];
      double before = t[parts - 1];
      for (int level = 1; level < parts; ++level) {
        before = t[parts - 1];
        for (int j = parts - 1; j >= level; --j) {
          const double ratio = double(j + 1) / double(j + 1 - level);
          t[j] += (t[j] - t[j - 1]) / (ratio * ratio - 1);
        }
      }
      into[k] = t[parts - 1];
      if (k < controlled)
        error = worse(error, std::abs(t[parts - 1] - before) / (tolerance * (scales[k] + std::abs(y[k]))));
    }
    return error;
  }

  // The length of the next step, by that of this one and its error.
  static double next(double h, double error) {
    if (!std::isfinite(error)) return h / 8;
    return h * std::clamp(0.8 * std::pow(std::max(error, 1e-30), -1. / 11), 0.125, 4.);
  }

 private:
  static constexpr int parts = 6;
  // NaN is worst, and stays
  static double worse(double a, double b) { return b <= a || std::isnan(a) ? a : b; }

  template <class F>
  void midpoint(F&& f, const double* y, const double* f0, double h, int n, double* result) {
    const double part = h / n;
    std::copy(y, y + size_, a_.begin());
    for (std::size_t k = 0; k < size_; ++k) b_[k] = y[k] + part * f0[k];
    for (int i = 1; i < n; ++i) {
      f(b_.data(), f_.data());
      for (std::size_t k = 0; k < size_; ++k) a_[k] += 2 * part * f_[k];
      std::swap(a_, b_);
    }
    std::copy(b_.begin(), b_.end(), result);
  }

  std::size_t size_;
  std::vector<double> columns_, a_, b_, f_;
};

}  // namespace stickslip
