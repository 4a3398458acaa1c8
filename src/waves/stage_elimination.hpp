// Small dense linear systems with complex coefficients and several right-hand sides, by elimination with row
// exchanges. Real and imaginary parts stand apart, so that rows are gone through in vectors, with the same
// bits in vectors of any width.
#pragma once

#include <array>
#include <functional>
#include <numeric>
#include <utility>

#include "model/kernel.hpp"

namespace stickslip {

// Rows of the matrix, each with the right-hand sides behind it, which become the solution.
template <int unknowns, int sides>
struct StageRows {
  static constexpr int n = unknowns, vector = 8, width = (n + sides + vector - 1) / vector * vector;
  alignas(64) double re[n][width], im[n][width];
  std::array<int, n> order;  // of the rows, once solved
};

template <int unknowns, int sides>
struct StageElimination {
  using Rows = StageRows<unknowns, sides>;
  static constexpr int n = Rows::n, width = Rows::width;

  // False where the matrix is singular.
  bool operator()(Rows* rows) const {
    auto& [re, im, order] = *rows;
    std::iota(order.begin(), order.end(), 0);
    double inverse_re[n], inverse_im[n];
    for (int k = 0; k < n; ++k) {
      const auto size = [&](int i) {
        const double x = re[order[i]][k], y = im[order[i]][k];
        return x * x + y * y;
      };
      int pivot = k;
      double most = size(k);
      for (int i = k + 1; i < n; ++i)
        if (const double here = size(i); here > most) {
          pivot = i;
          most = here;
        }
      if (!(most > 0)) return false;
      std::swap(order[k], order[pivot]);
      const double *a = re[order[k]], *b = im[order[k]];
      inverse_re[k] = a[k] / most;
      inverse_im[k] = -b[k] / most;
      for (int i = k + 1; i < n; ++i) {
        double *x = re[order[i]], *y = im[order[i]];
        const double f = x[k] * inverse_re[k] - y[k] * inverse_im[k],
                     g = x[k] * inverse_im[k] + y[k] * inverse_re[k];
        // what stands before column k + 1 is not asked for again
#pragma GCC ivdep
        for (int j = (k + 1) / Rows::vector * Rows::vector; j < width; ++j) {
          x[j] -= f * a[j] - g * b[j];
          y[j] -= f * b[j] + g * a[j];
        }
      }
    }
    for (int k = n - 1; k >= 0; --k) {
      double *a = re[order[k]], *b = im[order[k]];
      for (int i = k + 1; i < n; ++i) {
        const double *x = re[order[i]] + n, *y = im[order[i]] + n;
        for (int j = 0; j < sides; ++j) {
          a[n + j] -= a[i] * x[j] - b[i] * y[j];
          b[n + j] -= a[i] * y[j] + b[i] * x[j];
        }
      }
      for (int j = n; j < n + sides; ++j) {
        const double x = a[j], y = b[j];
        a[j] = x * inverse_re[k] - y * inverse_im[k];
        b[j] = x * inverse_im[k] + y * inverse_re[k];
      }
    }
    return true;
  }

  // In the version that suits this processor.
  static bool solve(Rows* rows) {
    static const auto best = kernel::compiled<std::function<bool(Rows*)>>(StageElimination());
    return best(rows);
  }
};

}  // namespace stickslip
