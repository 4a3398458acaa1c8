// Linear chains that close on themselves: y_{i+1} = Phi_i y_i + r_i, i = 0..N-1, y_N = bloch_phase y_0.
//
// Eliminated from the left by orthogonal transformations of two block rows at a time, which is stable whether
// the Phi grow or shrink, in O(N d^3). T is double or std::complex<double>. Arrays of small matrices are
// row-major. Local to the process.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "numerics/matrix.hpp"

namespace stickslip {

template <class T>
class CyclicChain {
 public:
  // Phi: N matrices of d x d.
  CyclicChain(int d, std::size_t N, const std::vector<T>& phi);
  // The d x d matrix of the relation that is left, first y_0 + last y_N = rhs, closed by y_N = bloch_phase
  // y_0.
  Matrix<T> closure(T bloch_phase) const { return first_ + bloch_phase * last_; }
  const Matrix<T>& first() const { return first_; }
  const Matrix<T>& last() const { return last_; }
  // Eliminates in `columns` right-hand sides (rhs[(i d + a) columns + col], destroyed); returns the d x
  // columns right-hand side of the closure.
  Matrix<T> reduce(int columns, std::vector<T>& rhs) const;
  // From y_0 and the phase, y_0..y_{N-1}, one behind the other, for the combination of the reduced columns
  // with weights w.
  std::vector<T> expand(int columns, const std::vector<T>& reduced, const T* w, const T* y0,
                        T bloch_phase) const;

 private:
  Eigen::Index d_, n_;
  struct Reflections {  // of two block rows, d of them: I - tau v v^*, v = (1, what is below the diagonal)
    Matrix<T> v;        // 2d x d
    std::vector<T> tau;
    void apply(Matrix<T>& rows) const;
  };
  std::vector<Reflections> transforms_;
  std::vector<Matrix<T>> rows_;  // of y_k, upper triangular, y_0 and y_{k+1}
  Matrix<T> first_, last_;
};

}  // namespace stickslip
