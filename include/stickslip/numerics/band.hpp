// LU factors of a complex banded matrix, rows and columns of which may be folded round a ring.
#pragma once

#include <complex>
#include <cstddef>
#include <vector>

namespace stickslip {

using Complex = std::complex<double>;

// A determinant as its logarithm, since a product of a million pivots overflows.
struct LogDet {
  double log_abs = 0;  // ln |det|
  Complex unit = 1;    // det/|det|
  double phase = 0;    // sum of the phases of the pivots, each within a half turn
};

// The LU factors, with row exchanges, of a square matrix whose entries stand `lower` rows below and `upper` rows above
// the diagonal. The work is O(n lower (lower + upper)). Usage: reset(), add() entries, factor(), then solve().
class BandLU {
 public:
  // An empty (zero) matrix of the size and band given; keeps its memory where it can.
  void reset(std::size_t n, int lower, int upper);
  void add(std::size_t i, std::size_t j, Complex value) {
    a_[i * std::size_t(width_) + std::size_t(std::ptrdiff_t(j) - std::ptrdiff_t(i) + lower_)] += value;
  }
  // Factors in place and returns the determinant. A pivot that is exactly zero is replaced by one at round-off level,
  // so that an inverse iteration at an eigenvalue works; the determinant then has log_abs = -infinity.
  LogDet factor(bool exchange_rows = true);
  Complex pivot(std::size_t k) const { return a_[k * std::size_t(width_) + std::size_t(lower_)]; }
  void solve(Complex* b) const;             // b := M^-1 b
  void solve_transposed(Complex* b) const;  // b := M^-T b (no conjugation)

 private:
  std::size_t n_ = 0;
  int lower_ = 0, upper_ = 0, width_ = 0;  // entry (i, j) stands at i width_ + (j - i + lower_)
  std::vector<Complex> a_;
  std::vector<int> pivot_;  // row exchanged with row k, less k
};

}  // namespace stickslip
