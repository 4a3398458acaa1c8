// Analytic functions of one complex variable on the pieces of a segment, by their values at Chebyshev points:
// P of them are enough where a piece is short, and how short it must be shows in the last coefficients. Local
// to the process; allocates nothing. All inline, so that loops over many functions can be compiled for each
// processor (model/kernel.hpp).
//
// Source: L. N. Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, chapters 3 to 8.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>

namespace stickslip::chebyshev {

using Complex = std::complex<double>;

constexpr int P = 16;              // points of a piece
constexpr double settled = 1e-11;  // largest last coefficient of a function that counts as known on its piece

// A piece of a segment of the complex plane; its points are at(x), x in [-1, 1].
struct ContourPiece {
  Complex from, to;
  Complex at(double x) const { return (from + to) / 2. + (to - from) / 2. * x; }
  ContourPiece half(int side) const {
    const Complex middle = (from + to) / 2.;
    return side == 0 ? ContourPiece{from, middle} : ContourPiece{middle, to};
  }
};

// Values of a function at the Chebyshev points of a piece; real and imaginary parts apart, so that loops
// vectorise.
struct alignas(64) Values {
  double re[P], im[P];
  Complex operator[](int j) const { return {re[j], im[j]}; }
  void put(int j, Complex c) { re[j] = c.real(), im[j] = c.imag(); }
};
inline void set(Values& x, Complex c) {
  for (int j = 0; j < P; ++j) x.re[j] = c.real(), x.im[j] = c.imag();
}
inline void add_product(Values& out, const Values& a, const Values& b, double factor = 1) {
  for (int j = 0; j < P; ++j) {
    out.re[j] += factor * (a.re[j] * b.re[j] - a.im[j] * b.im[j]);
    out.im[j] += factor * (a.re[j] * b.im[j] + a.im[j] * b.re[j]);
  }
}
inline void scale(Values& x, double factor) {
  for (int j = 0; j < P; ++j) x.re[j] *= factor, x.im[j] *= factor;
}
inline void multiply(Values& x, const Values& a) {
  for (int j = 0; j < P; ++j) {
    const double re = x.re[j] * a.re[j] - x.im[j] * a.im[j];
    x.im[j] = x.re[j] * a.im[j] + x.im[j] * a.re[j];
    x.re[j] = re;
  }
}
inline void invert(Values& x) {
  for (int j = 0; j < P; ++j) {
    const double d = 1 / (x.re[j] * x.re[j] + x.im[j] * x.im[j]);
    x.re[j] *= d;
    x.im[j] *= -d;
  }
}

// Chebyshev points (first kind) on [-1, 1], which lie symmetrically; interpolation of the even and the odd
// part to the points of the half [0, 1]; the last two coefficients; weights of the barycentric formula.
struct Table {
  double x[P], even[P / 2][P], odd[P / 2][P], tail[2][P], weight[P];
  Table() {
    const auto coefficient = [&](int k, int i) {
      return (k == 0 ? 1. : 2.) / P * std::cos(k * (2 * i + 1) * M_PI / (2 * P));
    };
    for (int i = 0; i < P; ++i) {
      x[i] = std::cos((2 * i + 1) * M_PI / (2 * P));
      weight[i] = (i % 2 ? -1 : 1) * std::sin((2 * i + 1) * M_PI / (2 * P));
      for (int k = 0; k < 2; ++k) tail[k][i] = coefficient(P - 1 - k, i);
    }
    for (int j = 0; j < P; ++j)
      for (int i = 0; i < P / 2; ++i) {
        even[i][j] = odd[i][j] = 0;
        for (int k = 0; k < P; ++k)
          (k % 2 ? odd : even)[i][j] += coefficient(k, i) * std::cos(k * std::acos((x[j] + 1) / 2));
      }
  }
};
inline const Table& table() {
  static const Table the_table;
  return the_table;
}

// How well a function is known on its piece: the size of the last two coefficients.
inline double last_coefficients(const Values& v) {
  const Table& c = table();
  double worst = 0;
  for (const auto& tail : c.tail) {
    double re = 0, im = 0;
    for (int i = 0; i < P; ++i) re += tail[i] * v.re[i], im += tail[i] * v.im[i];
    worst = std::max(worst, std::abs(re) + std::abs(im));
  }
  return worst;
}
inline double largest(const Values& v) {
  double most = 0;
  for (int j = 0; j < P; ++j) most = std::max(most, std::abs(v.re[j]) + std::abs(v.im[j]));
  return most;
}
// The function on either half of the piece: the first ([-1, 0]) and the second.
inline void halve(const double* v, double* first, double* second) {
  const Table& c = table();
  double even[P] = {}, odd[P] = {};
  for (int i = 0; i < P / 2; ++i) {
    const double e = v[i] + v[P - 1 - i], o = v[i] - v[P - 1 - i];
    for (int j = 0; j < P; ++j) {
      even[j] += c.even[i][j] * e;
      odd[j] += c.odd[i][j] * o;
    }
  }
  for (int j = 0; j < P; ++j) {
    second[j] = even[j] + odd[j];
    first[P - 1 - j] = even[j] - odd[j];
  }
}
inline void halve(const Values& v, Values& first, Values& second) {
  halve(v.re, first.re, second.re);
  halve(v.im, first.im, second.im);
}

}  // namespace stickslip::chebyshev
