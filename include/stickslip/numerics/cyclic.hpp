// Linear chains that close on themselves: y_{i+1} = Phi_i y_i + r_i, i = 0..N-1, y_N = bloch_phase y_0.
//
// Eliminated from the left by orthogonal transformations of two block rows at a time, which is stable whether
// the Phi grow or shrink, in O(N d^3). T is double or std::complex<double>. Small matrices are row-major.
// Local to the process.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

namespace stickslip {

namespace detail {
inline double conjugate(double x) { return x; }
inline std::complex<double> conjugate(const std::complex<double>& x) { return std::conj(x); }
}  // namespace detail

template <class T>
class CyclicChain {
 public:
  // Phi: N matrices of d x d.
  CyclicChain(int d, std::size_t N, const std::vector<T>& phi) : d_(d), n_(N) {
    const std::size_t dd = std::size_t(d) * d;
    q_.resize((N - 1) * 4 * dd);
    r_.resize((N - 1) * dd);
    e_.resize((N - 1) * dd);
    f_.resize((N - 1) * dd);
    std::vector<T> first(dd), last(dd), work(2 * dd * 5);
    // the relation first y_0 + last y_k = rhs
    for (int a = 0; a < d; ++a)
      for (int b = 0; b < d; ++b) {
        first[a * d + b] = -phi[a * d + b];
        last[a * d + b] = a == b ? 1. : 0.;
      }
    const int width = 5 * d;  // columns: y_k | y_0 | y_{k+1} | the transformation itself (2 d)
    for (std::size_t k = 1; k < N; ++k) {
      std::fill(work.begin(), work.end(), T(0));
      for (int a = 0; a < d; ++a) {
        for (int b = 0; b < d; ++b) {
          work[a * width + b] = last[a * d + b];
          work[a * width + d + b] = first[a * d + b];
          work[(d + a) * width + b] = -phi[k * dd + std::size_t(a * d + b)];
        }
        work[(d + a) * width + 2 * d + a] = 1.;
        work[a * width + 3 * d + a] = 1.;
        work[(d + a) * width + 4 * d + a] = 1.;
      }
      triangularise(work.data(), width);
      for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b) {
          const std::size_t at = (k - 1) * dd + std::size_t(a * d + b);
          r_[at] = work[a * width + b];
          e_[at] = work[a * width + d + b];
          f_[at] = work[a * width + 2 * d + b];
          first[a * d + b] = work[(d + a) * width + d + b];
          last[a * d + b] = work[(d + a) * width + 2 * d + b];
        }
      for (int a = 0; a < 2 * d; ++a)
        for (int b = 0; b < 2 * d; ++b)
          q_[(k - 1) * 4 * dd + std::size_t(a * 2 * d + b)] = work[a * width + 3 * d + b];
    }
    first_ = first;
    last_ = last;
  }

  // The d x d matrix of the relation that is left, first y_0 + last y_N = rhs, closed by y_N = bloch_phase
  // y_0.
  std::vector<T> closure(T bloch_phase) const {
    std::vector<T> m(first_.size());
    for (std::size_t i = 0; i < m.size(); ++i) m[i] = first_[i] + bloch_phase * last_[i];
    return m;
  }
  const std::vector<T>& first() const { return first_; }
  const std::vector<T>& last() const { return last_; }

  // Eliminates in `columns` right-hand sides (rhs[(i d + a) columns + col], destroyed); returns the d x
  // columns right-hand side of the closure.
  std::vector<T> reduce(int columns, std::vector<T>& rhs) const {
    const int d = d_;
    const std::size_t dc = std::size_t(d) * columns, dd = std::size_t(d) * d;
    std::vector<T> carried(rhs.begin(), rhs.begin() + long(dc)), both(2 * dc);
    for (std::size_t k = 1; k < n_; ++k) {
      std::copy(carried.begin(), carried.end(), both.begin());
      std::copy(rhs.begin() + long(k * dc), rhs.begin() + long((k + 1) * dc), both.begin() + long(dc));
      const T* q = &q_[(k - 1) * 4 * dd];
      for (int a = 0; a < 2 * d; ++a)
        for (int c = 0; c < columns; ++c) {
          T sum = 0;
          for (int b = 0; b < 2 * d; ++b) sum += q[a * 2 * d + b] * both[b * columns + c];
          if (a < d) {
            rhs[k * dc + std::size_t(a * columns + c)] = sum;
          } else {
            carried[(a - d) * columns + c] = sum;
          }
        }
    }
    return carried;
  }

  // From y_0 and the phase, y_0..y_{N-1} for the combination of the reduced columns with weights w.
  std::vector<T> expand(int columns, const std::vector<T>& reduced, const T* w, const T* y0,
                        T bloch_phase) const {
    const int d = d_;
    const std::size_t dd = std::size_t(d) * d;
    std::vector<T> y(n_ * std::size_t(d));
    for (int a = 0; a < d; ++a) y[a] = y0[a];
    for (std::size_t k = n_; k-- > 1;) {
      const T* r = &r_[(k - 1) * dd];
      for (int a = d - 1; a >= 0; --a) {
        T sum = 0;
        for (int c = 0; c < columns; ++c)
          sum +=
              w[c] * reduced[(k * std::size_t(d) + std::size_t(a)) * std::size_t(columns) + std::size_t(c)];
        for (int b = 0; b < d; ++b) {
          const T next = k + 1 < n_ ? y[(k + 1) * std::size_t(d) + std::size_t(b)] : bloch_phase * y0[b];
          sum -= e_[(k - 1) * dd + std::size_t(a * d + b)] * y0[b] +
                 f_[(k - 1) * dd + std::size_t(a * d + b)] * next;
        }
        for (int b = a + 1; b < d; ++b) sum -= r[a * d + b] * y[k * std::size_t(d) + std::size_t(b)];
        y[k * std::size_t(d) + std::size_t(a)] = sum / r[a * d + a];
      }
    }
    return y;
  }

 private:
  // Householder reflections on the first d columns of a 2 d x width matrix.
  void triangularise(T* m, int width) const {
    const int rows = 2 * d_;
    std::vector<T> u(rows), dot(static_cast<std::size_t>(width));
    for (int k = 0; k < d_; ++k) {
      double norm = 0;
      for (int i = k; i < rows; ++i) norm = std::hypot(norm, std::abs(m[i * width + k]));
      if (norm == 0) continue;
      const double pivot = std::abs(m[k * width + k]);
      const T sign = pivot > 0 ? m[k * width + k] / pivot : T(1);
      double length2 = 0;
      for (int i = k; i < rows; ++i) {
        u[i] = m[i * width + k];
        if (i == k) u[i] += sign * norm;
        length2 += std::norm(u[i]);
      }
      std::fill(dot.begin(), dot.end(), T(0));
      for (int i = k; i < rows; ++i) {
        const T with = detail::conjugate(u[i]);
        for (int j = k; j < width; ++j) dot[j] += with * m[i * width + j];
      }
      for (T& entry : dot) entry *= 2 / length2;
      for (int i = k; i < rows; ++i)
        for (int j = k; j < width; ++j) m[i * width + j] -= dot[j] * u[i];
    }
  }

  int d_;
  std::size_t n_;
  std::vector<T> q_, r_, e_, f_, first_, last_;
};

}  // namespace stickslip
