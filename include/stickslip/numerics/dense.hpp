// Small dense systems. Local to the process.
#pragma once

#include <complex>
#include <vector>

namespace stickslip {

// Solves the n by n system a x = b in place by elimination with row exchanges; a is row-major and destroyed,
// b holds `columns` right-hand sides (row-major, n by columns) and becomes x. False where a is singular.
template <class T>  // double, std::complex<double>
bool solve_dense(int n, T* a, int columns, T* b);

// The same where a_ij = 0 for |i - j| > band, in O(n band (band + columns)); what stands outside of the band
// must be 0.
template <class T>
bool solve_banded(int n, int band, T* a, int columns, T* b);

// All mu with det(a - mu b) = 0, d by d, row-major: by the QZ method of LAPACK (dggev, zggev). A mu of
// +-infinity where b is singular. Largest modulus first, those of a conjugate pair as neighbours. Throws
// Failure where the method fails.
std::vector<std::complex<double>> generalised_eigenvalues(int d, std::vector<double> a,
                                                          std::vector<double> b);
std::vector<std::complex<double>> generalised_eigenvalues(int d, std::vector<std::complex<double>> a,
                                                          std::vector<std::complex<double>> b);

}  // namespace stickslip
