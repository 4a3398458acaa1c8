#include "stickslip/stability/argument_principle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "model/kernel.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

constexpr int P = 16;               // values of every function on a piece, at Chebyshev points
constexpr double settled = 1e-11;   // largest last coefficient of a function that counts as known on its piece
constexpr std::size_t stretch = 8;  // nodes in the shortest stretches

// Values of a function at the Chebyshev points of a piece; real and imaginary parts apart, so that loops vectorise.
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

// Chebyshev points (first kind) on [-1, 1], which lie symmetrically; interpolation of the even and the odd part to the
// points of the half [0, 1]; the last two coefficients; weights of the barycentric formula.
struct Chebyshev {
  double x[P], even[P / 2][P], odd[P / 2][P], tail[2][P], weight[P];
  Chebyshev() {
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
const Chebyshev& chebyshev() {
  static const Chebyshev table;
  return table;
}

inline double last_coefficients(const Values& v) {
  const Chebyshev& c = chebyshev();
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
  const Chebyshev& c = chebyshev();
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

struct Unsettled {};  // thrown where the phase cannot be followed

// A piece of the segment.
struct Piece {
  Complex from, to;
  Complex at(double x) const { return (from + to) / 2. + (to - from) / 2. * x; }
  Piece half(int side) const {
    const Complex middle = (from + to) / 2.;
    return side == 0 ? Piece{from, middle} : Piece{middle, to};
  }
};

// What a stretch does to the state (q, J) at its left end: exp(shift + slope x) e, x in [-1, 1] on the piece.
struct Map {
  Values e[2][2];
  Complex shift = 0, slope = 0;
  double tail = 0;  // how well it is settled
};

// Entries of size 1. Where one of the two waves outweighs the other by all digits, its oscillation in lambda is taken
// out, so that the rest needs no shorter pieces when stretches are joined.
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
    const Chebyshev& c = chebyshev();
    const Complex a = (*most)[P / 2 - 1], b = (*most)[P / 2], rate = std::log(a / b) / (c.x[P / 2 - 1] - c.x[P / 2]);
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

// Neighbours on either half of their piece, or on all of it (second null); the last one may stand alone (r null).
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

// The stencil of half-width b on the nodes of a line, in units of K1/h^2: S = -D2 + eps_i. Its wide part is taken off
// by the congruence S = U M U^T, M tridiagonal and U unit upper triangular with b - 1 diagonals above, row by row from
// the right: what came before fades by a constant factor at every row, as the stencil's own solutions do. With
// t = U^T 1 and z = U^-1 eps the rows of diag(t) M diag(t) sum to t_k z_k, small and free of cancellation.
constexpr int widest = 4;  // half-width, of the stencil of order 8
struct Row {
  Values u[widest];   // u[m] = U_{i,i+m}, u[0] unused
  Values e, inverse;  // M_{i,i+1} and 1/e
  Values d, z;        // M_{i,i}
  Values t;           // known b - 1 rows later
  Values g[widest];   // (M U^T)_{i+m,i}
};

class Sweep {
 public:
  Sweep(int half_width, const std::array<double, 5>& w) : b_(half_width), w_(w) {}
  Row& operator[](long i) { return row_[i & 7]; }

  // Rows right of `next` as if nothing coupled them: forgotten after some rows.
  void start(long next, const Values& eps) {
    for (long i = next + b_; i > next; --i) {
      Row& r = (*this)[i];
      for (int m = 0; m < b_; ++m) set(r.u[m], 0);
      set(r.e, -w_[1]);
      set(r.inverse, -1 / w_[1]);
      set(r.t, 1);
      r.z = r.d = eps;
      for (int j = 0; j < P; ++j) r.d.re[j] -= w_[0];
      finish(i);
    }
  }
  void step(long i, const Values& eps) {
    Row& r = (*this)[i];
    for (int m = b_ - 1; m >= 1; --m) {
      set(r.u[m], -w_[std::size_t(m) + 1]);
      for (int k = m + 1; k < b_; ++k) add_product(r.u[m], r.u[k], (*this)[i + m + 1].g[k - m - 1], -1);
      multiply(r.u[m], (*this)[i + m].inverse);
    }
    set(r.e, -w_[1]);
    r.z = r.d = eps;
    for (int j = 0; j < P; ++j) r.d.re[j] -= w_[0];
    for (int m = 1; m < b_; ++m) {
      add_product(r.e, r.u[m], (*this)[i + 1].g[m - 1], -1);
      add_product(r.z, r.u[m], (*this)[i + m].z, -1);
    }
    for (int m = 1; m < b_; ++m) {
      Values part;  // what u_m is multiplied with in S_ii
      set(part, 0);
      add_product(part, r.u[m], (*this)[i + m].d, -1);
      if (m > 1) add_product(part, r.u[m - 1], (*this)[i + m - 1].e, -2);
      for (int j = 0; m == 1 && j < P; ++j) part.re[j] -= 2 * r.e.re[j], part.im[j] -= 2 * r.e.im[j];
      add_product(r.d, part, r.u[m]);
    }
    if (b_ == 1) set(r.t, 1);
    if (b_ > 1) {
      r.inverse = r.e;
      invert(r.inverse);
      Values& t = (*this)[i + b_ - 1].t;
      set(t, 1);
      for (int m = 1; m < b_; ++m)
        for (int j = 0; j < P; ++j) {
          t.re[j] += (*this)[i + b_ - 1 - m].u[m].re[j];
          t.im[j] += (*this)[i + b_ - 1 - m].u[m].im[j];
        }
    }
    finish(i);
  }

 private:
  void finish(long i) {
    Row& r = (*this)[i];
    for (int m = 0; m + 1 < b_; ++m) {
      set(r.g[m], 0);
      if (m == 0) r.g[m] = r.d;
      if (m == 1) r.g[m] = r.e;
      if (m > 1) add_product(r.g[m], r.u[m - 1], (*this)[i + m - 1].e);
      if (m > 0) add_product(r.g[m], r.u[m], (*this)[i + m].d);
      add_product(r.g[m], r.u[m + 1], (*this)[i + m].e);
    }
  }

  const int b_;
  std::array<double, 5> w_;
  std::array<Row, 8> row_;
};

// The line on one piece: the maps of its stretches, ln of the product of the M_{i,i+1}, and its ends: what comes from
// the left one as a state (0, 1), and the determinants with which either component is met at the right one (2, 3).
struct Level {
  std::vector<Map> map;
  Values log;
  Values end[4];
  double theta = 1;    // the unit of J
  double noise = 1;    // round-off, in units of what counts as settled; more where waves grow and shrink along the line
  int stuck = 0;       // halvings since maps were joined
  bool ended = false;  // the ends are known; they are not before the stretches are as long as what an end takes in
};

// Rows after which a start of the sweep is forgotten to all digits, by half-width (the stencils' own solutions fade by
// 0.07 a node at order 4, 0.1 at 6, 0.13 at 8, where the waves do not fade).
constexpr int rows_to_forget[widest] = {0, 16, 18, 22};

class Tree {
 public:
  Tree(const LinearisedOperator& s, PhaseTurn& result, std::size_t zeros)
      : s_(s), result_(result), zeros_(zeros), b_(s.scene.order / 2), fading_(rows_to_forget[b_ - 1]) {
    const long m = long(s.size());
    const PetscInt order = s.scene.order, n = s.scene.n;
    if (s.scene.ring()) {
      first_ = first_node_ = 0;
      last_ = last_node_ = m;
    } else {
      // rows near the ends are taken as they are; they must not reach beyond b nodes further in
      for (first_ = b_; s.coupling.node[std::size_t(first_)] < order; ++first_) {
      }
      for (last_ = m - b_; s.coupling.node[std::size_t(last_ - 1)] >= n - order; --last_) {
      }
      for (const bool left : {true, false}) {
        const long rows = left ? first_ : m - last_;
        for (long i = 0; i < rows; ++i)
          for (const auto& [column, value] : s.coupling.row(std::size_t(left ? i : m - 1 - i)))
            if ((left ? long(column) : m - 1 - long(column)) >= rows + b_) throw Unsettled();
      }
      first_node_ = first_ + b_ - 1;
      last_node_ = last_ - fading_ - std::max(fading_, b_) + 1;
      if (last_node_ < first_node_ + 2 * long(stretch)) throw Unsettled();
    }
    unit_ = s.spacing() * s.spacing() / s.K1;
    weights_ = second_difference(s.scene.order);
  }

  void follow(const Piece& piece, int depth = 0) {
    if (depth > 40) throw Unsettled();
    Level level;
    if (build_(this, &piece, &level)) return descend(piece, std::move(level), depth);
    for (int side : {0, 1}) follow(piece.half(side), depth + 1);
  }

 private:
  // eps_i at the points of a piece.
  struct Symbol {
    const LinearisedOperator* s;
    double unit;
    Values z, plain;  // lambda; lambda^2/A + K0
    Symbol(const LinearisedOperator& J, double unit_of_symbol, const Piece& piece) : s(&J), unit(unit_of_symbol) {
      for (int t = 0; t < P; ++t) {
        const Complex lambda = piece.at(chebyshev().x[t]);
        z.put(t, lambda);
        plain.put(t, unit * (s->K0 + lambda * lambda / s->A));
      }
    }
    // J is taken in units of this, so that q and J are alike in size.
    double theta() const {
      Values eps;
      at(s->size() / 2, eps);
      return std::clamp(std::sqrt(std::abs(eps[P / 2])), 1e-7, 1.);
    }
    void at(std::size_t i, Values& eps) const {
      const double beta = unit * s->point(i).beta();
      for (int t = 0; t < P; ++t) {
        eps.re[t] = plain.re[t] + beta * z.re[t];
        eps.im[t] = plain.im[t] + beta * z.im[t];
      }
      if (!s->has_state()) return;
      const double q = unit * s->point(i).q(), r = s->point(i).r();
      for (int t = 0; t < P; ++t) {  // q z/(z + r)
        const double re = z.re[t] + r, im = z.im[t], d = q / (re * re + im * im);
        eps.re[t] += d * (z.re[t] * re + z.im[t] * im);
        eps.im[t] += d * (z.im[t] * re - z.re[t] * im);
      }
    }
  };

  struct Build {
    bool operator()(Tree* tree, const Piece* piece, Level* level) const { return tree->build(*piece, *level); }
  };
  const std::function<bool(Tree*, const Piece*, Level*)> build_ =
      kernel::compiled<std::function<bool(Tree*, const Piece*, Level*)>>(Build());

  // The stretches of the line; false where they are not settled on this piece.
  bool build(const Piece& piece, Level& level) {
    const long m = long(s_.size());
    const bool ring = s_.scene.ring();
    const Symbol symbol(s_, unit_, piece);
    const double theta = level.theta = symbol.theta();
    Values eps;
    const auto at = [&](long i) { return std::size_t(ring ? (i % m + m) % m : std::clamp(i, 0L, m - 1)); };

    level.map.resize(std::size_t(last_node_ - first_node_ + long(stretch) - 1) / stretch);
    set(level.log, 0);
    Sweep sweep(b_, weights_);
    const long begin = last_ + b_ + 2 * fading_;
    symbol.at(at(begin), eps);
    sweep.start(begin, eps);
    Values seam;
    set(seam, 0);
    // how what the solution takes from the right of the line's interior, and the start of the sweep, fades there
    std::array<Values, std::size_t(widest)> faded;
    for (Values& f : faded) set(f, 1);
    Map* map = nullptr;
    Values product;
    set(product, 1);
    for (long i = begin; i > first_node_ - b_; --i) {
      symbol.at(at(i), eps);
      sweep.step(i, eps);
      if (b_ > 1 && i < begin - fading_ && i >= begin - 2 * fading_) {
        Values next;
        set(next, 0);
        for (int l = 1; l < b_; ++l) add_product(next, sweep[i].u[l], faded[std::size_t(l - 1)], -1);
        for (int l = b_ - 1; l >= 1; --l) faded[std::size_t(l)] = faded[std::size_t(l - 1)];
        faded[0] = next;
        if (i == begin - 2 * fading_ && !(largest(next) < 1e-11)) throw Unsettled();
      }
      if (ring && b_ > 1 && i == m - 1) seam = sweep[i].e;
      if (ring && b_ > 1 && i == -1 && !alike(seam, sweep[i].e)) throw Unsettled();
      const long k = i + b_ - 1;  // the row that is known altogether now
      const Row& row = sweep[k];
      if (k >= last_node_ || k < first_node_) continue;
      const std::size_t cell = std::size_t(k - first_node_) / stretch;
      if (!map || map != &level.map[cell]) {
        map = &level.map[cell];
        set(map->e[0][0], 1), set(map->e[1][1], 1), set(map->e[0][1], 0), set(map->e[1][0], 0);
        set(product, 1);
      }
      // q' = q + J'/(t_k e_k t_{k+1}), J' = J - t_k z_k q
      Values conductance, sigma = row.z;
      if (b_ > 1) {
        multiply(sigma, row.t);
        conductance = row.t;
        multiply(conductance, sweep[k + 1].t);
        invert(conductance);
        multiply(conductance, row.inverse);
        if (k + 1 < last_node_ || ring) multiply(product, row.e);
      } else {
        set(conductance, -1 / weights_[1]);
      }
      scale(conductance, theta);
      scale(sigma, 1 / theta);
      for (auto& e : map->e) {
        const Values first = e[0];
        e[0] = e[1];
        add_product(e[0], first, conductance);
        e[1] = e[0];
        e[0] = first;
        add_product(e[0], e[1], sigma, -1);
      }
      if (std::size_t(k - first_node_) % stretch > 0) continue;
      normalise(*map);
      if (!(map->tail <= settled)) return false;
      for (int l = 1; l < b_; ++l)
        if (!(largest(row.u[l]) < 2)) throw Unsettled();
      if (b_ > 1) {
        const Complex middle = 1. / product[P / 2];
        for (int t = 0; t < P; ++t) {
          const Complex l = std::log(product[t] * middle);
          level.log.re[t] += l.real();
          level.log.im[t] += l.imag();
        }
      }
    }
    level.ended = ring;
    return true;
  }

  static bool alike(const Values& a, const Values& c) {
    double apart = 0;
    for (int t = 0; t < P; ++t) apart = std::max(apart, std::abs(a[t] - c[t]));
    return apart < 1e-12;
  }

  // S_i as it stands in the equations; `place` gives the columns.
  template <class Add>
  void plain_row(std::size_t i, Complex eps, const Add& add) const {
    for (const auto& [column, value] : s_.coupling.row(i)) add(long(column), s_.K1 * value * unit_);
    add(long(i), eps);
  }

  // Both ends, by determinants of the few equations there. On the left the state at the first interface is the one
  // solution that does not grow inwards like the stencil's own; on the right what the state at the last interface is
  // met with. False where they are not settled on this piece.
  bool ends(const Piece& piece, Level& level) const {
    const long m = long(s_.size());
    const double theta = level.theta;
    const Symbol symbol(s_, unit_, piece);
    // the rows of the sweep from one place leftwards to another, the last one first
    const auto rows_of = [&](long from, long to) {
      std::vector<Row> rows(std::size_t(from - to) + 1);
      Sweep sweep(b_, weights_);
      Values eps;
      const auto at = [&](long i) { return std::size_t(std::clamp(i, 0L, m - 1)); };
      symbol.at(at(from + 2 * fading_), eps);
      sweep.start(from + 2 * fading_, eps);
      for (long i = from + 2 * fading_; i > to - b_; --i) {
        symbol.at(at(i), eps);
        sweep.step(i, eps);
        for (const long k : {i, i + b_ - 1})  // the second one's t is known
          if (k >= to && k <= from) rows[std::size_t(k - to)] = sweep[k];
      }
      return rows;
    };
    const std::vector<Row> right = rows_of(last_ + b_, last_node_ - 1), left = rows_of(first_ + 2 * b_, first_ - b_);
    std::vector<Values> eps(std::size_t(first_ + m - last_ + fading_) + 1);
    const long middle = last_ - fading_;  // rows from here on are taken as they stand
    for (long i = 0; i < first_; ++i) symbol.at(std::size_t(i), eps[std::size_t(i)]);
    for (long i = middle; i < m; ++i) symbol.at(std::size_t(i), eps[std::size_t(first_ + i - middle)]);
    BandLU lu;
    double reference[2] = {0, 0};
    for (int step = 0; step < P; ++step) {
      const int t = (step + P / 2) % P;  // the reference first
      // ---- left: p_0 .. p_{first_+b-1}; q_j = sum U_{j-l,j} p_{j-l}
      const long base = first_ - b_, size = first_ + b_;
      const auto row = [&](const std::vector<Row>& rows, long start, long i) -> const Row& {
        return rows[std::size_t(i - start)];
      };
      const auto upper = [&](const std::vector<Row>& rows, long start, long i, long l) -> Complex {
        if (l <= 0 || l >= b_) return l == 0 ? 1 : 0;
        return row(rows, start, i).u[l][t];
      };
      // row k of M U^T, columns k - b .. k + 1, none before `bound`
      const auto reduced = [&](const std::vector<Row>& rows, long start, long k, long bound, const auto& add) {
        for (long j = std::max(k - b_, bound); j <= k + 1; ++j) {
          Complex sum = 0;
          for (long l = std::max(j, k - 1); l <= std::min(k + 1, j + b_ - 1); ++l) {
            if (l < bound) continue;
            sum += (l == k ? row(rows, start, k).d[t] : row(rows, start, std::min(l, k)).e[t]) *
                   upper(rows, start, j, l - j);
          }
          add(j, sum);
        }
      };
      const auto q_row = [&](const std::vector<Row>& rows, long start, long j, long bound, Complex factor,
                             const auto& add) {
        for (long l = 0; l < b_ && j - l >= bound; ++l) add(j - l, factor * upper(rows, start, j - l, l));
      };
      const auto state_row = [&](const std::vector<Row>& rows, long start, long j, long bound, int component,
                                 const auto& add) {
        const Complex t0 = row(rows, start, j).t[t], t1 = row(rows, start, j + 1).t[t];
        if (component == 0) return q_row(rows, start, j + 1, bound, 1. / t1, add);
        const Complex e = row(rows, start, j).e[t] / theta;
        q_row(rows, start, j + 1, bound, e * t0, add);
        q_row(rows, start, j, bound, -e * t1, add);
      };
      LogDet det[4];
      for (int component : {0, 1}) {
        lu.reset(std::size_t(size), int(size) - 1, int(size) - 1);
        const auto into = [&](long r) {
          return [&lu, r](long column, Complex value) { lu.add(std::size_t(r), std::size_t(column), value); };
        };
        for (long i = 0; i < first_; ++i) plain_row(std::size_t(i), eps[std::size_t(i)][t], into(i));
        for (long k = first_; k < first_ + b_ - 1; ++k) reduced(left, base, k, 0, into(k));
        state_row(left, base, first_ + b_ - 2, 0, component, into(size - 1));
        det[component] = lu.factor();
      }
      // ---- right: p_a .. p_{m-1}, what is further left forgotten
      const long a = last_node_ - 1, length = m - a;
      for (int component : {0, 1}) {
        lu.reset(std::size_t(length), int(m - last_ + b_), int(std::max<long>(b_, m - last_)));
        const auto into = [&](long r) {
          return [&lu, r, a](long column, Complex value) {
            if (column >= a) lu.add(std::size_t(r), std::size_t(column - a), value);
          };
        };
        state_row(right, a, a, a, component, into(0));
        for (long k = a + 1; k < middle; ++k) reduced(right, a, k, a, into(k - a));
        for (long i = middle; i < m; ++i)
          plain_row(std::size_t(i), eps[std::size_t(first_ + i - middle)][t], into(i - a));
        det[2 + component] = lu.factor();
      }
      for (int k = 0; k < 4; ++k) {
        double& ref = reference[k / 2];
        if (step == 0 && k % 2 == 0) ref = std::max(det[k].log_abs, det[k + 1].log_abs);
        level.end[k].put(t, std::exp(det[k].log_abs - ref) * det[k].unit);
      }
    }
    level.ended = true;
    for (int side : {0, 2}) {
      const double size = std::max(largest(level.end[side]), largest(level.end[side + 1]));
      for (int k : {side, side + 1}) level.ended = level.ended && last_coefficients(level.end[k]) <= settled * size;
    }
    return level.ended;
  }

  // What counts as settled where the line is in so many maps: a product over m nodes carries round-off of some m
  // epsilon, below which no shorter piece brings it.
  double settled_over(std::size_t maps) const {
    return settled + 8 * std::numeric_limits<double>::epsilon() * double(last_ - first_) / double(maps);
  }

  // Joins neighbours on ever shorter pieces until one map is left. Where the joined maps are settled on the whole
  // piece, it is not halved.
  void descend(const Piece& piece, Level level, int depth) {
    if (depth > 60) throw Unsettled();
    if (level.map.size() == 1) return finish(piece, level, depth);
    const bool settled_ends =
        level.ended || level.map.size() * stretch * 16 > std::size_t(last_ - first_) || ends(piece, level);
    double tail = 0;
    for (const Map& m : level.map) tail = std::max(tail, m.tail);
    if (tail < 1e-14 && settled_ends) {
      std::vector<Map> joined;
      if (join_all(level, &joined, nullptr)) {
        level.map = std::move(joined);
        return descend(piece, std::move(level), depth);
      }
    }
    // a function that so many halvings do not settle is not short of points: what is left is round-off
    if (settled_ends && level.stuck > 2) level.noise *= 10;
    if (settled_over(1) * level.noise > 1e-4) throw Unsettled();
    Level half[2];
    const bool joined = settled_ends && join_all(level, &half[0].map, &half[1].map);
    for (Level& side : half) {
      side.noise = level.noise;
      side.stuck = joined ? 0 : level.stuck + int(settled_ends);
    }
    if (!joined) {
      for (Level& side : half) side.map.resize(level.map.size());
      for (std::size_t k = 0; k < level.map.size(); ++k)
        join_two_(&level.map[k], nullptr, &half[0].map[k], &half[1].map[k]);
    }
    halve_rest(level, half);
    level.map = {};
    for (int side : {0, 1}) descend(piece.half(side), std::move(half[side]), depth + 1);
  }
  static void halve_rest(const Level& level, Level (&half)[2]) {
    halve(level.log, half[0].log, half[1].log);
    for (Level& side : half) {
      side.theta = level.theta;
      side.ended = level.ended;
    }
    for (int k = 0; level.ended && k < 4; ++k) halve(level.end[k], half[0].end[k], half[1].end[k]);
  }

  using Joining = std::function<void(const Map*, const Map*, Map*, Map*)>;
  const Joining join_two_ = kernel::compiled<Joining>(JoinTwo());

  bool join_all(const Level& level, std::vector<Map>* first, std::vector<Map>* second) {
    const std::size_t size = (level.map.size() + 1) / 2;
    first->resize(size);
    if (second) second->resize(size);
    const double allowed = settled_over(size) * level.noise;
    for (std::size_t k = 0; k < size; ++k) {
      const bool pair = 2 * k + 1 < level.map.size();
      Map &to = (*first)[k], *to_second = second ? &(*second)[k] : nullptr;
      join_two_(&level.map[2 * k], pair ? &level.map[2 * k + 1] : nullptr, &to, to_second);
      if (!(to.tail <= allowed) || (to_second && !(to_second->tail <= allowed))) return false;
    }
    return true;
  }

  // The last map closed by the ends: a polynomial with the zeros of det S.
  void finish(const Piece& piece, Level& level, int depth, int halvings = 0) {
    const Map& m = level.map[0];
    const bool settled_ends = level.ended || ends(piece, level);
    Values f;
    const Complex shift = level.log[P / 2];
    for (int t = 0; t < P; ++t) {
      Complex x;
      if (s_.scene.ring()) {
        // D2 is symmetric on a ring, so the waves multiply by mu and 1/mu round it: det (T - 1) = 2 - trace T
        x = 2. * std::exp(-m.shift - m.slope * chebyshev().x[t]) - m.e[0][0][t] - m.e[1][1][t];
      } else {
        const Complex q = m.e[0][0][t] * level.end[0][t] + m.e[0][1][t] * level.end[1][t];
        const Complex J = m.e[1][0][t] * level.end[0][t] + m.e[1][1][t] * level.end[1][t];
        x = J * level.end[2][t] - q * level.end[3][t];
      }
      f.put(t, x * std::exp(level.log[t] - shift));
    }
    const double size = largest(f);
    if (!(size > 0) || !std::isfinite(size)) throw Unsettled();
    // Beside a zero round-off of the maps may outweigh what counts as settled: enough that the phase is known.
    double least = size;
    for (int t = 0; t < P; ++t) least = std::min(least, std::abs(f[t]));
    const double unsettled = last_coefficients(f);
    const bool known =
        unsettled <= 100 * settled_over(1) * size || ((level.noise > 1 || halvings > 5) && unsettled <= 1e-3 * least);
    if (!settled_ends || !known) {
      if (depth > 60 || std::abs(piece.to - piece.from) < 1e-13 * (1 + std::abs(piece.from))) throw Unsettled();
      Level half[2];
      for (Level& side : half) side.map.resize(1);
      join_two_(&m, nullptr, &half[0].map[0], &half[1].map[0]);
      halve_rest(level, half);
      for (int side : {0, 1}) finish(piece.half(side), half[side], depth + 1, halvings + 1);
      return;
    }
    ++result_.pieces;
    result_.turn += 2 * m.slope.imag();
    Polynomial{piece, f}.turn(result_, zeros_);
  }

  // A polynomial by its values, and the turn of its phase from end to end.
  struct Polynomial {
    Piece piece;
    Values f;
    struct Point {
      double x;
      Complex f, slope;  // f'/f with respect to x
    };
    Complex value(Complex x, Complex* slope) const {  // and f'/f
      const Chebyshev& c = chebyshev();
      Complex above = 0, below = 0, above2 = 0, below2 = 0;
      for (int i = 0; i < P; ++i) {
        double re = x.real() - c.x[i], im = -x.imag();  // 1/(x - x_i), times |x - x_i|^2
        if (re * re + im * im < 1e-28) re = 1e-14, im = 0;
        const double d = 1 / (re * re + im * im);
        re *= d, im *= d;
        const double w = c.weight[i], wr = w * re, wi = w * im;
        const double gr = wr * f.re[i] - wi * f.im[i], gi = wr * f.im[i] + wi * f.re[i];
        above += Complex(gr, gi);
        below += Complex(wr, wi);
        above2 -= Complex(gr * re - gi * im, gr * im + gi * re);
        below2 -= Complex(wr * re - wi * im, wr * im + wi * re);
      }
      *slope = above2 / above - below2 / below;
      return above / below;
    }
    Point at(double x) const {
      Point p{x, 0, 0};
      p.f = value(x, &p.slope);
      return p;
    }
    // As for the count on short lines: followed where both slopes predict the change and it is small.
    double turn(const Point& a, const Point& b_, PhaseTurn& result, std::size_t zeros, int depth) const {
      if (depth > 60) throw Unsettled();
      const double step = b_.x - a.x;
      const Complex predicted = (a.slope + b_.slope) / 2. * step, measured = std::log(b_.f / a.f);
      if (std::abs(a.slope * step) < 0.7 && std::abs(b_.slope * step) < 0.7 && std::abs(measured - predicted) < 0.2) {
        if (zeros > 0) zero_near((a.x + b_.x) / 2, result, zeros);
        return measured.imag();
      }
      const Point m = at((a.x + b_.x) / 2);
      return turn(a, m, result, zeros, depth + 1) + turn(m, b_, result, zeros, depth + 1);
    }
    void turn(PhaseTurn& result, std::size_t zeros) const {
      Point last = at(-1);
      for (int k = 1; k <= 4; ++k) {
        const Point next = at(-1 + k / 2.);
        result.turn += turn(last, next, result, zeros, 0);
        last = next;
      }
    }
    // Newton's iteration to a zero beside the piece. Of all zeros the rightmost are kept.
    void zero_near(double x, PhaseTurn& result, std::size_t zeros) const {
      Complex y = x;
      bool found = false;
      for (int k = 0; k < 12 && !found; ++k) {
        Complex slope;
        value(y, &slope);
        Complex step = 1. / slope;
        found = std::norm(step) < 1e-10;
        if (std::norm(step) > 0.25) step /= 2 * std::abs(step);
        y -= step;
        if (!(std::abs(y) < 3)) return;
      }
      if (!found || std::abs(y.real()) > 1.05 || std::abs(y.imag()) > 2.5) return;
      const Complex z = (piece.from + piece.to) / 2. + (piece.to - piece.from) / 2. * y;
      const double near = 1e-3 * std::abs(piece.to - piece.from);
      std::vector<Complex>& all = result.zeros;
      for (std::size_t k = all.size(); k-- > 0 && k + 8 > all.size();)
        if (std::abs(all[k] - z) < near) return;
      all.push_back(z);
      if (all.size() >= 8 * zeros) {
        std::nth_element(all.begin(), all.begin() + long(zeros), all.end(), right_of);
        all.resize(zeros);
      }
    }
  };
  static bool right_of(Complex a, Complex c) { return a.real() > c.real(); }

  const LinearisedOperator& s_;
  PhaseTurn& result_;
  std::size_t zeros_;
  const int b_, fading_;                 // half-width of the stencil; rows_to_forget
  long first_ = 0, last_ = 0;            // rows first_ .. last_ - 1 are those of the interior
  long first_node_ = 0, last_node_ = 0;  // those that the maps are made of
  double unit_ = 1;
  std::array<double, 5> weights_{};
};

}  // namespace

std::optional<PhaseTurn> follow_phase(MPI_Comm comm, const LinearisedOperator& s, Complex from, Complex to, std::size_t zeros) {
  if (s.size() < shortest_line || !(s.K1 > 0)) return std::nullopt;
  int ranks = 1, rank = 0;
  MPI_Comm_size(comm, &ranks);
  MPI_Comm_rank(comm, &rank);
  PhaseTurn result;
  int failed = 0;
  const int parts = ranks == 1 ? 1 : 4 * ranks;
  try {
    for (int k = rank; k < parts; k += ranks) {
      const Piece piece{from + (to - from) * (double(k) / parts), from + (to - from) * (double(k + 1) / parts)};
      Tree(s, result, zeros).follow(piece);
    }
  } catch (const Unsettled&) {
    failed = 1;
  }
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, comm));
  // round-off may differ where the segment is cut: every rank tries it in one piece, as one rank alone would
  if (failed) return ranks > 1 ? follow_phase(PETSC_COMM_SELF, s, from, to, zeros) : std::nullopt;
  // the rightmost zeros of all ranks
  const auto keep = [zeros](std::vector<Complex>& all) {
    std::sort(all.begin(), all.end(), [](Complex a, Complex b) { return a.real() > b.real(); });
    if (all.size() > zeros) all.resize(zeros);
  };
  keep(result.zeros);
  if (ranks > 1) {
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &result.turn, 1, MPI_DOUBLE, MPI_SUM, comm));
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &result.pieces, 1, MPI_LONG, MPI_SUM, comm));
    int mine = int(2 * result.zeros.size());
    std::vector<int> counts(static_cast<std::size_t>(ranks)), starts(static_cast<std::size_t>(ranks), 0);
    SS_TRY(MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, comm));
    for (std::size_t k = 1; k < starts.size(); ++k) starts[k] = starts[k - 1] + counts[k - 1];
    std::vector<Complex> all(std::size_t(starts.back() + counts.back()) / 2);
    SS_TRY(MPI_Allgatherv(result.zeros.data(), mine, MPI_DOUBLE, all.data(), counts.data(), starts.data(), MPI_DOUBLE,
                          comm));
    keep(all);
    result.zeros = std::move(all);
  }
  return result;
}

}  // namespace stickslip
