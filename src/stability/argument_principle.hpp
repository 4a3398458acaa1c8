// How many eigenvalues lie right of a line, by the turns of det S along it.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <optional>
#include <vector>

#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip::chebyshev {

// Analytic functions of one complex variable on the pieces of a segment, by their values at Chebyshev points:
// P of them are enough where a piece is short, and how short it must be shows in the last coefficients. Local
// to the process; allocates nothing. All inline, so that loops over many functions can be compiled for each
// processor (model/kernel.hpp).
//
// Source: L. N. Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, chapters 3 to 8.

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

namespace stickslip::stretches {

// A long line on one piece of a segment of the lambda plane, as transfer matrices of its stretches.
// Local to the process.

using namespace chebyshev;

constexpr std::size_t shortest = 8;  // nodes in the shortest stretches

struct Unsettled {};  // thrown where the phase cannot be followed

// What a stretch does to the state (q, J) at its left end: exp(shift + slope x) e, x in [-1, 1] on the piece.
struct Map {
  Values e[2][2];
  Complex shift = 0, slope = 0;
  double tail = 0;  // how well it is settled
};

// Entries of size 1. Where one of the two waves outweighs the other by all digits, its oscillation in lambda
// is taken out, so that the rest needs no shorter pieces when stretches are joined.
inline void normalise(Map& m) {
  double size = 0;
  const Values* most = &m.e[0][0];
  for (const auto& row : m.e)
    for (const Values& v : row)
      if (const double l = largest(v); l > size) size = l, most = &v;
  if (!(size > 0) || !std::isfinite(size)) throw Unsettled();
  const double factor = 1 / size;
  for (auto& row : m.e)
    for (Values& v : row) scale(v, factor);
  m.shift += std::log(size);
  const auto tail = [&m] {
    double worst = 0;
    for (const auto& row : m.e)
      for (const Values& v : row) worst = std::max(worst, last_coefficients(v));
    return worst;
  };
  if (m.shift.real() > 28) {
    const Table& c = table();
    const Complex a = (*most)[P / 2 - 1], b = (*most)[P / 2],
                  rate = std::log(a / b) / (c.x[P / 2 - 1] - c.x[P / 2]);
    if (std::abs(rate) > 0.3 && std::isfinite(std::abs(rate))) {
      Values turn;
      for (int j = 0; j < P; ++j) turn.put(j, std::exp(-rate * c.x[j]));
      for (auto& row : m.e)
        for (Values& v : row) multiply(v, turn);
      m.slope += rate;
    }
  }
  m.tail = tail();
}

inline void join(const Map& left, const Map& right, Map& out) {
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) {
      set(out.e[i][j], 0);
      for (int k = 0; k < 2; ++k) add_product(out.e[i][j], right.e[i][k], left.e[k][j]);
    }
  out.shift = left.shift + right.shift;
  out.slope = left.slope + right.slope;
  normalise(out);
}
inline void halve(const Map& m, Map& first, Map& second) {
  for (int i = 0; i < 2; ++i)
    for (int j = 0; j < 2; ++j) halve(m.e[i][j], first.e[i][j], second.e[i][j]);
  first.slope = second.slope = m.slope / 2.;
  first.shift = m.shift - m.slope / 2.;
  second.shift = m.shift + m.slope / 2.;
}

// What viscosity multiplies the coupling K1 D2 by.
inline Complex viscous_factor(const LinearisedOperator& s, Complex lambda) {
  return 1. + lambda * (s.N / s.K1);
}

// Neighbours on either half of their piece, or on all of it (second null); the last one may stand alone (r
// null).
struct JoinTwo {
  void operator()(const Map* l, const Map* r, Map* first, Map* second) const {
    if (!second) {
      if (r) return join(*l, *r, *first);
      *first = *l;
      return;
    }
    if (!r) {
      halve(*l, *first, *second);
      normalise(*first);
      return normalise(*second);
    }
    Map left[2], right[2];
    halve(*l, left[0], left[1]);
    halve(*r, right[0], right[1]);
    join(left[0], right[0], *first);
    join(left[1], right[1], *second);
  }
};

// The line on one piece: the maps of its stretches, ln of the product of the M_{i,i+1}, and its ends: what
// comes from the left one as a state (0, 1), and the determinants with which either component is met at the
// right one (2, 3).
struct Level {
  std::vector<Map> map;
  Values log;
  Values end[4];
  double theta = 1;  // the unit of J
  // round-off, in units of what counts as settled; more where waves grow and shrink along the line
  double noise = 1;
  int stuck = 0;  // halvings since maps were joined
  // the ends are known; they are not before the stretches are as long as what an end takes in
  bool ended = false;
};

// The rows of a line: those near the ends are taken as they stand in the equations, the interior is swept.
struct Rows {
  // Throws Unsettled where the line is too short, or its ends reach further in than can be.
  explicit Rows(const LinearisedOperator& s);
  const LinearisedOperator& s;
  // half-width of the stencil; rows after which a start of the sweep is forgotten
  const int b, fading;
  std::array<double, 5> weights;       // of the stencil
  double unit;                         // 1/(K1/h^2)
  long first = 0, last = 0;            // rows first .. last - 1 are those of the interior
  long first_node = 0, last_node = 0;  // those that the maps are made of
};

// eps_i at the points of a piece. With viscosity between neighbours S = (1 + lambda N/K1) (K1 (-D2) + diag
// eps_i), eps_i divided by that factor: the stencil stays what it is, and the factor, n times, is known.
class Symbol {
 public:
  Symbol(const Rows& rows, const ContourPiece& piece)
      : s_(rows.s), unit_(rows.unit), own_nodes_(s_.scene.medium.nodes_differ()) {
    for (int t = 0; t < P && s_.N > 0; ++t) stiffer_.put(t, 1. / viscous_factor(s_, piece.at(table().x[t])));
    for (int t = 0; t < P; ++t) {
      const Complex lambda = piece.at(table().x[t]);
      z_.put(t, lambda);
      plain_.put(t, unit_ * (s_.K0 + lambda * lambda / s_.A));
      squares_.put(t, unit_ * lambda * lambda);
    }
  }
  // J is taken in units of this, so that q and J are alike in size.
  double theta() const {
    Values eps;
    at(s_.size() / 2, eps);
    return std::clamp(std::sqrt(std::abs(eps[P / 2])), 1e-7, 1.);
  }
  void at(std::size_t i, Values& eps) const {
    const LinearPoint p = s_.point(i);
    const double beta = unit_ * p.beta();
    if (own_nodes_) {
      const double K0 = unit_ * p.K0, per_A = 1 / p.A;
      for (int t = 0; t < P; ++t) {
        eps.re[t] = K0 + squares_.re[t] * per_A + beta * z_.re[t];
        eps.im[t] = squares_.im[t] * per_A + beta * z_.im[t];
      }
    } else {
      for (int t = 0; t < P; ++t) {
        eps.re[t] = plain_.re[t] + beta * z_.re[t];
        eps.im[t] = plain_.im[t] + beta * z_.im[t];
      }
    }
    if (p.has_state) add_state(p, eps);
    if (s_.N > 0) multiply(eps, stiffer_);
  }
  // The same by places along the line: round a ring, or beyond its ends as at them.
  void beside(long i, Values& eps) const {
    const long m = s_.size();
    at(s_.scene.ring() ? (i % m + m) % m : std::clamp(i, 0L, m - 1), eps);
  }

 private:
  void add_state(const LinearPoint& p, Values& eps) const {
    const double q = unit_ * p.q(), r = p.r();
    for (int t = 0; t < P; ++t) {  // q z/(z + r)
      const double re = z_.re[t] + r, im = z_.im[t], d = q / (re * re + im * im);
      eps.re[t] += d * (z_.re[t] * re + z_.im[t] * im);
      eps.im[t] += d * (z_.im[t] * re - z_.re[t] * im);
    }
  }

  const LinearisedOperator& s_;
  double unit_;
  bool own_nodes_;              // with A and K0 of their own
  Values z_, plain_, squares_;  // lambda; lambda^2/A + K0, and lambda^2, in the unit
  Values stiffer_;              // one over the factor, where there is viscosity
};

// The stretches of the line: map and log of the level. False where they are not settled on this piece.
bool build(const Rows& rows, const ContourPiece& piece, Level& level);
// Both ends of a line that is no ring: `end` and `ended` of the level. False where they are not settled on
// this piece.
bool close_ends(const Rows& rows, const ContourPiece& piece, Level& level);

}  // namespace stickslip::stretches

namespace stickslip {

// The phase of det S(lambda) along a straight segment of the lambda plane, for long lines: O(n log n)
// altogether, however many eigenvalues stand beside the segment.
//
// S is banded with constant coefficients off its diagonal, so that its wide part can be taken off by a
// congruence S = U M U^T, M tridiagonal, row by row from the right: det S = det M, and M p = 0 is a
// recurrence in two components, a product of 2x2 transfer matrices. As functions of lambda these are
// analytic, and a stretch of m nodes needs few values on a piece of length about 1/m of the segment: the
// pieces are halved as neighbouring stretches are joined, until one polynomial in lambda is left for the
// whole line on each. Where one of the two waves outweighs the other by all digits its oscillation is divided
// out, and the pieces stay long.
//
// Nothing is assumed about where eigenvalues stand. What can fail is told: polynomials that do not settle, a
// congruence that does not forget its start (a grid so coarse that the waves between the nodes decay as fast
// as the stencil's own solutions).
struct PhaseTurn {
  double turn = 0;             // of the phase, from one end of the segment to the other
  std::vector<Complex> zeros;  // beside the segment, the rightmost found first; none surely
  long pieces = 0;             // polynomials used
};

// Collective over comm, which shares the work; the same on every rank. Empty where it fails (see above), or
// the scene has no line to speak of (viscosity between neighbours, which is not in the maps; K1 = 0, fewer
// than `shortest_line` nodes). At most `zeros` zeros are told.
constexpr std::size_t shortest_line = 64;
std::optional<PhaseTurn> follow_phase(MPI_Comm comm, const LinearisedOperator& J, Complex from, Complex to,
                                      std::size_t zeros = 0);

}  // namespace stickslip
