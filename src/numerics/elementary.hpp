// What loops over nodes are made of: functions without branches, numbers that carry derivatives, lanes.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

namespace stickslip::elementary {

// exp, expm1, log, log1p and tanh without branches, tables or calls, of + - * / and moves of bits alone: the
// compiler makes vector code of a loop over them, and a value has the same bits in any loop, of any vector
// length, on any processor (no library's vector versions promise that). Errors, in units of the last place,
// against long double (tests/test_kernel.cpp): exp and log at most 1, expm1 and log1p below 2, tanh below 3.
// Infinities, NaN and subnormal numbers as std's. Local.
//
// Each reduces its argument to a small one by a power of 2 and takes a polynomial there: coefficients are
// those of interpolation at Chebyshev's points, of a relative error of the function below 2e-17.
inline std::uint64_t bits_of(double x) {
  std::uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}
inline double of_bits(std::uint64_t bits) {
  double x;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}
// All bits where the sign is set, else none; not by a comparison, of which the compiler may make a jump
// again.
inline std::uint64_t if_negative(double x) { return 0 - (bits_of(x) >> 63); }
inline double select(std::uint64_t mask, double a, double b) {
  return of_bits((bits_of(a) & mask) | (bits_of(b) & ~mask));
}

// 1 with the sign of x, and 0 where x is.
inline double sign_of(double x) { return of_bits(bits_of(1.) | (bits_of(x) & bits_of(-0.))); }
inline double sign_or_zero(double x) {
  return of_bits(bits_of(sign_of(x)) & if_negative(0 - x * sign_of(x)));
}

// ln(2) as a sum: any integer below 2^20 times the first part is exact.
inline constexpr double ln2_high = 0x1.62e42fee00000p-1, ln2_low = 0x1.a39ef35793c76p-33;
inline constexpr double infinity = std::numeric_limits<double>::infinity();

// 2^k for k = x - 1.5 * 2^52, an integer from -1022 to 1023.
inline double power_of_2(double x) { return of_bits((bits_of(x) << 52) + bits_of(1.)); }

// exp(x) = 2^k (1 + p), |p| < 0.42; x is taken into a range beyond which exp overflows or is 0.
struct ReducedExp {
  static constexpr double shift = 0x1.8p52, most = 710, least = -746;
  double k, p;

  explicit ReducedExp(double x) {
    const double y = select(if_negative(most - x), most, select(if_negative(x - least), least, x));
    k = (y * 0x1.71547652b82fep0 + shift) - shift;  // the nearest integer to y/ln(2)
    const double high = y - k * ln2_high, low = k * ln2_low, r = high - low;
    // (exp(r) - 1 - r)/r^2, |r| < ln(2)/2
    const double r2 = r * r, r4 = r2 * r2;
    const double c0 = 0x1.0000000000001p-1 + r * 0x1.5555555555556p-3;
    const double c2 = 0x1.5555555553d63p-5 + r * 0x1.11111111109b3p-7;
    const double c4 = 0x1.6c16c1788bd90p-10 + r * 0x1.a01a01a7c41d5p-13;
    const double c6 = 0x1.a019b90d2ae7ap-16 + r * 0x1.71de0dae63bb3p-19;
    const double c8 = 0x1.289185613a3d6p-22 + r * 0x1.af38a9b0ec855p-26;
    p = high + (r2 * ((c0 + r2 * c2) + r4 * ((c4 + r2 * c6) + r4 * c8)) - low);
  }
};

inline double exp(double x) {
  constexpr double shift = ReducedExp::shift;
  const ReducedExp e(x);
  // 2^k in two factors, of which neither leaves the range
  const double half = e.k * 0.5 + shift, rest = (e.k - (half - shift)) + shift;
  return (1 + e.p) * power_of_2(half) * power_of_2(rest) + (x == x ? 0 : x);
}

// exp(x) - 1 for x <= 709.
inline double expm1(double x) {
  const ReducedExp e(x);
  const double k = select(if_negative(e.k + 1000), -1000, e.k), power = power_of_2(k + ReducedExp::shift);
  return power * e.p + (power - 1) + (x == x ? 0 : x);
}

inline double tanh(double x) {
  const std::uint64_t sign = bits_of(x) & bits_of(-0.);
  const double magnitude = of_bits(bits_of(x) ^ sign), y = select(if_negative(22 - magnitude), 22, magnitude);
  const double t = expm1(2 * y);
  return of_bits(bits_of(t / (t + 2)) | sign) + (x == x ? 0 : x);
}

inline double log(double x) {
  constexpr double root = 0x1.6a09e667f3bcdp-1;  // sqrt(1/2)
  constexpr std::uint64_t mantissa = 0x000fffffffffffff;
  const std::uint64_t tiny = if_negative(x - std::numeric_limits<double>::min());
  const double y = x * of_bits(bits_of(1.) + (tiny & (std::uint64_t(54) << 52)));
  // y = 2^k (1 + f), sqrt(1/2) <= 1 + f < sqrt(2)
  const std::uint64_t off = bits_of(y) - bits_of(root), raised = off + bits_of(1.);
  const double k =
      (of_bits((raised >> 52) | bits_of(0x1p52)) - (0x1p52 + 1023)) - of_bits(tiny & bits_of(54));
  const double f = of_bits((off & mantissa) + bits_of(root)) - 1;
  // ln(1 + f) = 2 artanh(s) = f - f^2/2 + s (f^2/2 + z R(z)),  s = f/(2 + f), z = s^2
  const double s = f / (2 + f), z = s * s, z2 = z * z, square = 0.5 * f * f;
  const double c0 = 0x1.5555555555558p-1 + z * 0x1.99999999952d7p-2;
  const double c2 = 0x1.2492492df281ap-2 + z * 0x1.c71c62e3f11e6p-3;
  const double c4 = 0x1.7462b51cb66b1p-3 + z * 0x1.39fe51a7c18f9p-3;
  const double R = (c0 + z2 * c2) + z2 * z2 * (c4 + z2 * 0x1.2b5900de53b32p-3);
  const double value = k * ln2_high + (f - (square - (s * (square + z * R) + k * ln2_low)));
  // NaN below 0, -infinity at 0, x beyond what is finite
  const double below = of_bits(if_negative(x + 0.) & bits_of(std::numeric_limits<double>::quiet_NaN()));
  const double zero =
      of_bits(if_negative(x - std::numeric_limits<double>::denorm_min()) & bits_of(-infinity));
  return value + (below + zero + (x <= std::numeric_limits<double>::max() ? 0 : x));
}

inline double value_of(double x) { return x; }
template <class Real>
double value_of(const Real& x) {
  return x.value;
}
// x < bound ? a : b of any number type; of double by masks, so that both are computed.
inline double where_less(double x, double bound, double a, double b) {
  return select(if_negative(x - bound), a, b);
}
template <class Real>
Real where_less(const Real& x, double bound, const Real& a, const Real& b) {
  return x < bound ? a : b;
}

// log(u + c), |c| no more than u's last place: with the digits that u has lost. Of any number type.
template <class Real>
Real log_sum(Real u, Real c) {
  return log(u) + c / u;
}
// log(1 + x) for finite x.
inline double log1p(double x) {
  const double u = 1 + x;
  return log_sum(u, x - (u - 1));
}

}  // namespace stickslip::elementary

namespace stickslip {

// Truncated Taylor series in two variables: a number that carries its first and second derivatives in (x, y),
// so that a formula written for any number type gives its derivatives with it (forward automatic
// differentiation; A. Griewank and A. Walther, Evaluating Derivatives, SIAM 2008, chapter 13). Local.
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

namespace stickslip::kernel {

// Eight numbers at once, one in each lane of a vector: what is written once for them is done in registers of
// any width, lane by lane in the same order, so that each lane has the same bits whatever instructions run.
constexpr int lanes = 8;

// Eight values, as they lie among others. Clang takes what a reference leads to for aligned whatever the type
// says: so memory is spoken of by pointers, and values have a type of their own there.
typedef double LanesInMemory __attribute__((vector_size(64), aligned(8), may_alias));
#if defined(__clang__)
typedef double Lanes __attribute__((vector_size(64)));
#else
typedef LanesInMemory Lanes;
#endif
inline const LanesInMemory* lanes_at(const double* a) { return reinterpret_cast<const LanesInMemory*>(a); }
inline LanesInMemory* lanes_at(double* a) { return reinterpret_cast<LanesInMemory*>(a); }

}  // namespace stickslip::kernel
