// Systems with a banded matrix, by LAPACK: complex ones by LU factors, real symmetric ones by Cholesky's.
// O(n) for a narrow band. Local to the process.
//
// Source: Anderson et al., LAPACK Users' Guide, SIAM 1999 (zgbtrf, zgbtrs, dpbtrf).
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
  void multiply(Complex factor);
};

// The LU factors, with row exchanges, of a square matrix whose entries stand `lower` rows below and `upper`
// rows above the diagonal. Usage: reset(), add() entries, factor(), then solve().
class BandLU {
 public:
  // An empty (zero) matrix of the size and band given; keeps its memory where it can. n < 2^31.
  void reset(std::size_t n, int lower, int upper);
  void add(std::size_t i, std::size_t j, Complex value) { a_[place(i, j)] += value; }
  // Factors in place and returns the determinant. A pivot that is exactly zero is replaced by one at
  // round-off level, so that an inverse iteration at an eigenvalue works; the determinant then has log_abs =
  // -infinity.
  LogDet factor();
  // The pivots of the factors without row exchanges, in the place of factor(). Sensible only where none is
  // small, as for diagonally dominant matrices and those with a definite real part.
  std::vector<Complex> pivots();
  void solve(Complex* b) const { solve('N', b); }             // b := M^-1 b
  void solve_transposed(Complex* b) const { solve('T', b); }  // b := M^-T b (no conjugation)

 private:
  // Column by column, as LAPACK has it, with room for the rows that exchanges bring in.
  std::size_t place(std::size_t i, std::size_t j) const {
    return j * height_ + std::size_t(std::ptrdiff_t(i) - std::ptrdiff_t(j) + lower_ + upper_);
  }
  void solve(char form, Complex* b) const;

  std::size_t n_ = 0;
  int lower_ = 0, upper_ = 0, height_ = 0;
  std::vector<Complex> a_;
  std::vector<int> exchanged_;
};

// Whether a real symmetric matrix is positive definite; entry (i, j), i - band <= j <= i, at a[i (band + 1) +
// j - i + band]. The matrix is destroyed.
bool positive_definite(std::vector<double>& a, std::size_t n, std::size_t band);

}  // namespace stickslip
