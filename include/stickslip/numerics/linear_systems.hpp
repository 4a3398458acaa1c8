// Systems of linear equations solved directly: small dense ones, banded ones, and PETSc's of any shape.
#pragma once

#include <petscksp.h>

#include <algorithm>
#include <complex>
#include <cstddef>
#include <vector>

namespace stickslip {

// Small dense systems, row-major. Local to the process.

// A product without what C++ asks of complex ones that are not finite; a size that tells larger from smaller.
inline double product(double a, double b) { return a * b; }
inline std::complex<double> product(std::complex<double> a, std::complex<double> b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
inline double pivot_size(double a) { return std::abs(a); }
inline double pivot_size(std::complex<double> a) { return std::norm(a); }

// Solves the n by n system a x = b in place by elimination with row exchanges, where a_ij = 0 for |i - j| >
// band, in O(n band (band + columns)); a is destroyed, b holds `columns` right-hand sides and becomes x.
// False where a is singular. For bands, and for what motions in time rest on: the order of operations stands
// here, whatever release of Eigen solves other systems.
template <class T>  // double, std::complex<double>
bool solve_banded(int n, int band, T* a, int columns, T* b) {
  for (int k = 0; k < n; ++k) {
    const int below = std::min(n, k + band + 1), right = std::min(n, k + 2 * band + 1);
    int pivot = k;
    for (int i = k + 1; i < below; ++i)
      if (pivot_size(a[i * n + k]) > pivot_size(a[pivot * n + k])) pivot = i;
    if (!(pivot_size(a[pivot * n + k]) > 0)) return false;
    if (pivot != k) {
      std::swap_ranges(a + k * n + k, a + k * n + right, a + pivot * n + k);
      std::swap_ranges(b + k * columns, b + (k + 1) * columns, b + pivot * columns);
    }
    const T inverse = T(1) / a[k * n + k];
    for (int i = k + 1; i < below; ++i) {
      const T factor = product(a[i * n + k], inverse);
      if (factor == T(0)) continue;
      for (int j = k + 1; j < right; ++j) a[i * n + j] -= product(factor, a[k * n + j]);
      for (int j = 0; j < columns; ++j) b[i * columns + j] -= product(factor, b[k * columns + j]);
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    const T inverse = T(1) / a[k * n + k];
    for (int i = k + 1; i < std::min(n, k + 2 * band + 1); ++i) {
      const T factor = a[k * n + i];
      if (factor == T(0)) continue;
      for (int j = 0; j < columns; ++j) b[k * columns + j] -= product(factor, b[i * columns + j]);
    }
    for (int j = 0; j < columns; ++j) b[k * columns + j] = product(b[k * columns + j], inverse);
  }
  return true;
}
template <class T>
bool solve_dense(int n, T* a, int columns, T* b) {
  return solve_banded(n, n, a, columns, b);
}

// The eigenvalues of a, d by d, row-major, by the QR method of LAPACK (dgeev, zgeev). Largest modulus first,
// those of a conjugate pair as neighbours. Throws Failure where the method fails. (Eigen takes a gigabyte to
// compile.)
template <class T>  // double, std::complex<double>
std::vector<std::complex<double>> eigenvalues(int d, std::vector<T> a);

// The eigenvalues of a, d by d, column-major, with Im >= 0, the rightmost first, and their eigenvectors: by
// LAPACK (dgeev), which balances. Throws Failure where the method fails.
struct Eigenpair {
  std::complex<double> value;
  std::vector<std::complex<double>> vector;
};
std::vector<Eigenpair> eigenpairs(int d, std::vector<double> a);

// All mu with det(a - mu b) = 0, d by d, row-major: by the QZ method of LAPACK (dggev, zggev). A mu of
// +-infinity where b is singular. Largest modulus first, those of a conjugate pair as neighbours. Throws
// Failure where the method fails. (Eigen has it for real matrices only.)
template <class T>  // double, std::complex<double>
std::vector<std::complex<double>> generalised_eigenvalues(int d, std::vector<T> a, std::vector<T> b);

// Systems with a banded matrix, by LAPACK: complex ones by LU factors, real symmetric ones by Cholesky's.
// O(n) for a narrow band. Local to the process.
//
// Source: Anderson et al., LAPACK Users' Guide, SIAM 1999 (zgbtrf, zgbtrs, dpbtrf).

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

// Systems of PETSc, solved directly. To be called before KSPSetUp; options given on the command line override
// it. Collective.

// Makes `ksp` solve by LU factors in natural order, O(n) for a banded matrix. On several ranks each factors
// the whole, which is the fastest there.
void solve_by_banded_lu(KSP ksp);

// Makes `ksp` solve by the factors of each block of a matrix (BAIJ) that has blocks on its diagonal alone.
void solve_by_blocks(KSP ksp);

}  // namespace stickslip
