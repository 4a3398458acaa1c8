// Small dense matrices by Eigen, and row-major arrays seen as such. For sources only: Eigen takes long to
// compile.
#pragma once

#include <Eigen/Core>

namespace stickslip {

template <class T>
using Matrix = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <class T>
Eigen::Map<Matrix<T>> as_matrix(T* rows, Eigen::Index count, Eigen::Index columns) {
  return {rows, count, columns};
}
template <class T>
Eigen::Map<const Matrix<T>> as_matrix(const T* rows, Eigen::Index count, Eigen::Index columns) {
  return {rows, count, columns};
}

}  // namespace stickslip
