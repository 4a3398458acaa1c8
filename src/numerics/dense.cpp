#include "stickslip/numerics/dense.hpp"

#include <cmath>
#include <complex>
#include <utility>

namespace stickslip {

template <class T>
bool solve_dense(int n, T* a, int columns, T* b) {
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(a[i * n + k]) > std::abs(a[pivot * n + k])) pivot = i;
    if (!(std::abs(a[pivot * n + k]) > 0)) return false;
    if (pivot != k) {
      for (int j = k; j < n; ++j) std::swap(a[k * n + j], a[pivot * n + j]);
      for (int j = 0; j < columns; ++j) std::swap(b[k * columns + j], b[pivot * columns + j]);
    }
    const T inverse = T(1) / a[k * n + k];
    for (int i = k + 1; i < n; ++i) {
      const T factor = a[i * n + k] * inverse;
      if (factor == T(0)) continue;
      for (int j = k + 1; j < n; ++j) a[i * n + j] -= factor * a[k * n + j];
      for (int j = 0; j < columns; ++j) b[i * columns + j] -= factor * b[k * columns + j];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    const T inverse = T(1) / a[k * n + k];
    for (int j = 0; j < columns; ++j) {
      T sum = b[k * columns + j];
      for (int i = k + 1; i < n; ++i) sum -= a[k * n + i] * b[i * columns + j];
      b[k * columns + j] = sum * inverse;
    }
  }
  return true;
}

template bool solve_dense(int, double*, int, double*);
template bool solve_dense(int, std::complex<double>*, int, std::complex<double>*);

}  // namespace stickslip
