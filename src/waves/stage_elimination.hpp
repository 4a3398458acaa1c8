// Small dense linear systems with complex coefficients and several right-hand sides, eight of the same shape
// at once, by elimination with row exchanges in each.
#pragma once

#include <functional>
#include <utility>

#include "model/kernel.hpp"
#include "numerics/lanes.hpp"

namespace stickslip {

// Rows of the matrices, each with the right-hand sides behind it, which become the solution; what belongs to
// a system stands in its lane.
template <int unknowns, int sides>
struct StageSystems {
  static constexpr int n = unknowns, width = n + sides;
  alignas(64) double re[n][width][kernel::lanes], im[n][width][kernel::lanes];
};

template <int unknowns, int sides>
struct StageElimination {
  using Systems = StageSystems<unknowns, sides>;
  using Lanes = kernel::Lanes;
  static constexpr int n = Systems::n, width = Systems::width;

  // False where a matrix is singular.
  bool operator()(Systems* systems) const {
    const auto re = [&](int i, int j) { return kernel::lanes_at(systems->re[i][j]); };
    const auto im = [&](int i, int j) { return kernel::lanes_at(systems->im[i][j]); };
    const auto size = [&](int i, int k) { return *re(i, k) * *re(i, k) + *im(i, k) * *im(i, k); };
    Lanes inverse_re[n], inverse_im[n];
    for (int k = 0; k < n; ++k) {
      Lanes most = size(k, k);
      for (int i = k + 1; i < n; ++i) {  // the larger pivot comes to row k
        const Lanes here = size(i, k);
        const auto larger = here > most;
        most = larger ? here : most;
        for (int j = k; j < width; ++j)
          for (const auto& [a, b] : {std::pair{re(k, j), re(i, j)}, std::pair{im(k, j), im(i, j)}}) {
            const Lanes of_k = *a;
            *a = larger ? *b : of_k;
            *b = larger ? of_k : *b;
          }
      }
      for (int lane = 0; lane < kernel::lanes; ++lane)
        if (!(most[lane] > 0)) return false;
      inverse_re[k] = *re(k, k) / most;
      inverse_im[k] = -*im(k, k) / most;
      for (int i = k + 1; i < n; ++i) {
        const Lanes f = *re(i, k) * inverse_re[k] - *im(i, k) * inverse_im[k],
                    g = *re(i, k) * inverse_im[k] + *im(i, k) * inverse_re[k];
        for (int j = k + 1; j < width; ++j) {
          *re(i, j) -= f * *re(k, j) - g * *im(k, j);
          *im(i, j) -= f * *im(k, j) + g * *re(k, j);
        }
      }
    }
    for (int k = n - 1; k >= 0; --k)
      for (int j = n; j < width; ++j) {
        Lanes x = *re(k, j), y = *im(k, j);
        for (int i = k + 1; i < n; ++i) {
          x -= *re(k, i) * *re(i, j) - *im(k, i) * *im(i, j);
          y -= *re(k, i) * *im(i, j) + *im(k, i) * *re(i, j);
        }
        *re(k, j) = x * inverse_re[k] - y * inverse_im[k];
        *im(k, j) = x * inverse_im[k] + y * inverse_re[k];
      }
    return true;
  }

  // In the version that suits this processor.
  static bool solve(Systems* systems) {
    static const auto best = kernel::compiled<std::function<bool(Systems*)>>(StageElimination());
    return best(systems);
  }
};

}  // namespace stickslip
