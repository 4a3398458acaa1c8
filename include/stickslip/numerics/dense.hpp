// Small dense systems. Local to the process.
#pragma once

namespace stickslip {

// Solves the n by n system a x = b in place by elimination with row exchanges; a is row-major and destroyed, b holds
// `columns` right-hand sides (row-major, n by columns) and becomes x. False where a is singular.
template <class T>  // double, std::complex<double>
bool solve_dense(int n, T* a, int columns, T* b);

}  // namespace stickslip
