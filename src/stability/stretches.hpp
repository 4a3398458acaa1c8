// A long line on one piece of a segment of the lambda plane, as transfer matrices of its stretches
// (argument_principle.hpp). Local to the process.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "numerics/chebyshev.hpp"
#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip::stretches {

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
