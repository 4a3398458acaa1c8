// Truncated Taylor series in two variables: a number that carries its first and second derivatives in (x, y),
// so that a formula written for any number type gives its derivatives with it (forward automatic
// differentiation; A. Griewank and A. Walther, Evaluating Derivatives, SIAM 2008, chapter 13). Local.
#pragma once

#include <cmath>

namespace stickslip {

struct Jet {
  double value = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;

  Jet() = default;
  Jet(double constant) : value(constant) {}
  Jet(double v, double dx, double dy, double dxx, double dxy, double dyy)
      : value(v), x(dx), y(dy), xx(dxx), xy(dxy), yy(dyy) {}
  static Jet of_x(double value) { return {value, 1, 0, 0, 0, 0}; }
  static Jet of_y(double value) { return {value, 0, 1, 0, 0, 0}; }
};

// f(a) with f, f' and f'' at a.value.
inline Jet compose(const Jet& a, double f, double f1, double f2) {
  return {f,
          f1 * a.x,
          f1 * a.y,
          f1 * a.xx + f2 * a.x * a.x,
          f1 * a.xy + f2 * a.x * a.y,
          f1 * a.yy + f2 * a.y * a.y};
}

inline Jet operator-(const Jet& a) { return {-a.value, -a.x, -a.y, -a.xx, -a.xy, -a.yy}; }
inline Jet operator+(const Jet& a, const Jet& b) {
  return {a.value + b.value, a.x + b.x, a.y + b.y, a.xx + b.xx, a.xy + b.xy, a.yy + b.yy};
}
inline Jet operator-(const Jet& a, const Jet& b) { return a + -b; }
inline Jet operator*(const Jet& a, const Jet& b) {
  return {a.value * b.value,
          a.x * b.value + a.value * b.x,
          a.y * b.value + a.value * b.y,
          a.xx * b.value + 2 * a.x * b.x + a.value * b.xx,
          a.xy * b.value + a.x * b.y + a.y * b.x + a.value * b.xy,
          a.yy * b.value + 2 * a.y * b.y + a.value * b.yy};
}
inline Jet operator/(const Jet& a, const Jet& b) {
  const double w = 1 / b.value;
  return a * compose(b, w, -w * w, 2 * w * w * w);
}

// Comparisons go by the value: a branch of a formula is that of the point.
inline bool operator<(const Jet& a, const Jet& b) { return a.value < b.value; }
inline bool operator>(const Jet& a, const Jet& b) { return a.value > b.value; }
inline bool operator<=(const Jet& a, const Jet& b) { return a.value <= b.value; }
inline bool operator>=(const Jet& a, const Jet& b) { return a.value >= b.value; }
inline bool operator==(const Jet& a, const Jet& b) { return a.value == b.value; }
inline bool operator!=(const Jet& a, const Jet& b) { return a.value != b.value; }

inline Jet abs(const Jet& a) { return a.value < 0 ? -a : a; }
inline Jet exp(const Jet& a) {
  const double e = std::exp(a.value);
  return compose(a, e, e, e);
}
inline Jet log(const Jet& a) {
  const double w = 1 / a.value;
  return compose(a, std::log(a.value), w, -w * w);
}
inline Jet log1p(const Jet& a) {
  const double w = 1 / (1 + a.value);
  return compose(a, std::log1p(a.value), w, -w * w);
}
inline Jet sqrt(const Jet& a) {
  const double root = std::sqrt(a.value), slope = 0.5 / root;
  return compose(a, root, slope, -slope / (2 * a.value));
}
inline Jet tanh(const Jet& a) {
  const double t = std::tanh(a.value), slope = 1 - t * t;
  return compose(a, t, slope, -2 * t * slope);
}
inline Jet asinh(const Jet& a) {
  const double w = 1 / std::sqrt(1 + a.value * a.value);
  return compose(a, std::asinh(a.value), w, -a.value * w * w * w);
}

}  // namespace stickslip
