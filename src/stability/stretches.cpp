// The wide part of a stencil taken off, row by row (argument_principle.hpp). Local to the process.

#include "stability/argument_principle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "model/kernel.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip::stretches {

using namespace chebyshev;

// The stencil of half-width b on the nodes of a line, in units of K1/h^2: S = -D2 + eps_i. Its wide part is
// taken off by the congruence S = U M U^T, M tridiagonal and U unit upper triangular with b - 1 diagonals
// above, row by row from the right: what came before fades by a constant factor at every row, as the
// stencil's own solutions do. With t = U^T 1 and z = U^-1 eps the rows of diag(t) M diag(t) sum to t_k z_k,
// small and free of cancellation.
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
      set(r.u[m], -w_[m + 1]);
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

// Rows after which a start of the sweep is forgotten to all digits, by half-width (the stencils' own
// solutions fade by 0.07 a node at order 4, 0.1 at 6, 0.13 at 8, where the waves do not fade).
constexpr int rows_to_forget[widest] = {0, 16, 18, 22};

Rows::Rows(const LinearisedOperator& J)
    : s(J), b(J.scene.order / 2), fading(rows_to_forget[b - 1]), weights(second_difference(J.scene.order)),
      unit(J.spacing() * J.spacing() / J.K1) {
  const long m = s.size();
  if (s.scene.ring()) {
    last = last_node = m;
    return;
  }
  // rows near the ends must not reach beyond b nodes further in
  const PetscInt order = s.scene.order, n = s.scene.n;
  for (first = b; s.coupling.node[first] < order; ++first) {
  }
  for (last = m - b; s.coupling.node[last - 1] >= n - order; --last) {
  }
  for (const bool left : {true, false}) {
    const long rows = left ? first : m - last;
    for (long i = 0; i < rows; ++i)
      for (const Coupling::Term& t : s.coupling.row(left ? i : m - 1 - i))
        if ((left ? long(t.column) : m - 1 - long(t.column)) >= rows + b) throw Unsettled();
  }
  first_node = first + b - 1;
  last_node = last - fading - std::max(fading, b) + 1;
  if (last_node < first_node + 2 * long(shortest)) throw Unsettled();
}

namespace {

bool alike(const Values& a, const Values& c) {
  double apart = 0;
  for (int t = 0; t < P; ++t) apart = std::max(apart, std::abs(a[t] - c[t]));
  return apart < 1e-12;
}

// The sweep over the line, from the right, and the maps that its rows make.
class Builder {
 public:
  Builder(const Rows& rows, const ContourPiece& piece, Level& level)
      : rows_(rows), level_(level), symbol_(rows, piece), sweep_(rows.b, rows.weights) {}

  bool run() {
    const int b = rows_.b;
    const bool ring = rows_.s.scene.ring();
    const long begin = rows_.last + b + 2 * rows_.fading;
    level_.theta = symbol_.theta();
    level_.map.resize((rows_.last_node - rows_.first_node + shortest - 1) / shortest);
    set(level_.log, 0);
    Values eps, seam;
    set(seam, 0);
    for (Values& f : faded_) set(f, 1);
    symbol_.beside(begin, eps);
    sweep_.start(begin, eps);
    for (long i = begin; i > rows_.first_node - b; --i) {
      symbol_.beside(i, eps);
      sweep_.step(i, eps);
      if (b > 1 && i < begin - rows_.fading && i >= begin - 2 * rows_.fading)
        fade(i, i == begin - 2 * rows_.fading);
      if (ring && b > 1 && i == rows_.last - 1) seam = sweep_[i].e;
      if (ring && b > 1 && i == -1 && !alike(seam, sweep_[i].e)) throw Unsettled();
      const long k = i + b - 1;  // the row that is known altogether now
      if (k < rows_.last_node && k >= rows_.first_node && !take(k)) return false;
    }
    level_.ended = ring;
    return true;
  }

 private:
  // How what the solution takes from the right of the line's interior, and the start of the sweep, fades
  // there.
  void fade(long i, bool last) {
    Values next;
    set(next, 0);
    for (int l = 1; l < rows_.b; ++l) add_product(next, sweep_[i].u[l], faded_[l - 1], -1);
    for (int l = rows_.b - 1; l >= 1; --l) faded_[l] = faded_[l - 1];
    faded_[0] = next;
    if (last && !(largest(next) < 1e-11)) throw Unsettled();
  }

  // Row k into the map of its stretch; false where a map that is complete is not settled.
  bool take(long k) {
    const bool wide = rows_.b > 1;
    const std::size_t place = k - rows_.first_node;
    Map& map = level_.map[place / shortest];
    if (map_ != &map) {
      map_ = &map;
      set(map.e[0][0], 1), set(map.e[1][1], 1), set(map.e[0][1], 0), set(map.e[1][0], 0);
      set(product_, 1);
    }
    // q' = q + J'/(t_k e_k t_{k+1}), J' = J - t_k z_k q
    const Row& row = sweep_[k];
    Values conductance, sigma = row.z;
    if (wide) {
      multiply(sigma, row.t);
      conductance = row.t;
      multiply(conductance, sweep_[k + 1].t);
      invert(conductance);
      multiply(conductance, row.inverse);
      if (k + 1 < rows_.last_node || rows_.s.scene.ring()) multiply(product_, row.e);
    } else {
      set(conductance, -1 / rows_.weights[1]);
    }
    scale(conductance, level_.theta);
    scale(sigma, 1 / level_.theta);
    for (auto& e : map.e) {
      const Values first = e[0];
      e[0] = e[1];
      add_product(e[0], first, conductance);
      e[1] = e[0];
      e[0] = first;
      add_product(e[0], e[1], sigma, -1);
    }
    if (place % shortest > 0) return true;
    normalise(map);
    if (!(map.tail <= settled)) return false;
    for (int l = 1; l < rows_.b; ++l)
      if (!(largest(row.u[l]) < 2)) throw Unsettled();
    if (!wide) return true;
    const Complex middle = 1. / product_[P / 2];
    for (int t = 0; t < P; ++t) {
      const Complex l = std::log(product_[t] * middle);
      level_.log.re[t] += l.real();
      level_.log.im[t] += l.imag();
    }
    return true;
  }

  const Rows& rows_;
  Level& level_;
  const Symbol symbol_;
  Sweep sweep_;
  std::array<Values, widest> faded_;
  Map* map_ = nullptr;
  Values product_;
};

struct Build {
  bool operator()(const Rows* rows, const ContourPiece* piece, Level* level) const {
    return Builder(*rows, *piece, *level).run();
  }
};

}  // namespace

bool build(const Rows& rows, const ContourPiece& piece, Level& level) {
  using Function = std::function<bool(const Rows*, const ContourPiece*, Level*)>;
  static const Function loop = kernel::compiled<Function>(Build());
  return loop(&rows, &piece, &level);
}

// ---- the ends

namespace {

// Rows of the sweep that are kept, at one point of the piece: what the few equations at an end are made of.
class Kept {
 public:
  // Rows `to` .. `from`, swept leftwards from far enough right of them.
  Kept(const Rows& rows, const Symbol& symbol, long from, long to)
      : rows_(rows), to_(to), kept_(from - to + 1) {
    Sweep sweep(rows.b, rows.weights);
    Values eps;
    symbol.beside(from + 2 * rows.fading, eps);
    sweep.start(from + 2 * rows.fading, eps);
    for (long i = from + 2 * rows.fading; i > to - rows.b; --i) {
      symbol.beside(i, eps);
      sweep.step(i, eps);
      for (const long k : {i, i + rows.b - 1})  // the second one's t is known
        if (k >= to && k <= from) kept_[k - to] = sweep[k];
    }
  }

  int point = 0;   // of the piece
  long bound = 0;  // first node that is not forgotten

  // Row k of M U^T: add(column, value), columns k - b .. k + 1.
  template <class Add>
  void reduced(long k, const Add& add) const {
    for (long j = std::max(k - rows_.b, bound); j <= k + 1; ++j) {
      Complex sum = 0;
      for (long l = std::max({j, k - 1, bound}); l <= std::min(k + 1, j + rows_.b - 1); ++l)
        sum += (l == k ? row(k).d[point] : row(std::min(l, k)).e[point]) * upper(j, l - j);
      add(j, sum);
    }
  }
  // A component of the state at the interface between nodes j and j + 1, q or J; q_j = sum U_{j-l,j} p_{j-l}.
  template <class Add>
  void state(long j, int component, double theta, const Add& add) const {
    const Complex t0 = row(j).t[point], t1 = row(j + 1).t[point];
    if (component == 0) return q(j + 1, 1. / t1, add);
    const Complex e = row(j).e[point] / theta;
    q(j + 1, e * t0, add);
    q(j, -e * t1, add);
  }

 private:
  const Row& row(long i) const { return kept_[i - to_]; }
  Complex upper(long i, long l) const {
    if (l <= 0 || l >= rows_.b) return l == 0 ? 1 : 0;
    return row(i).u[l][point];
  }
  template <class Add>
  void q(long j, Complex factor, const Add& add) const {
    for (long l = 0; l < rows_.b && j - l >= bound; ++l) add(j - l, factor * upper(j - l, l));
  }

  const Rows& rows_;
  const long to_;
  std::vector<Row> kept_;
};

// Determinants of the few equations at each end.
class Ends {
 public:
  Ends(const Rows& rows, const Symbol& symbol, double theta)
      : rows_(rows), theta_(theta), m_(rows.s.size()), middle_(rows.last - rows.fading),
        right_(rows, symbol, rows.last + rows.b, rows.last_node - 1),
        left_(rows, symbol, rows.first + 2 * rows.b, rows.first - rows.b), eps_(rows.first + m_ - middle_) {
    right_.bound = rows.last_node - 1;
    for (long i = 0; i < m_; i = i + 1 == rows.first ? middle_ : i + 1) symbol.at(i, eps_[kept(i)]);
  }

  // On the left the state at the first interface is the one solution that does not grow inwards like the
  // stencil's own: a component of it, at a point of the piece.
  LogDet left(int point, int component) {
    left_.point = point;
    const long size = rows_.first + rows_.b;
    lu_.reset(size, size - 1, size - 1);
    const auto into = [&](long r) {
      return [this, r](long column, Complex value) { lu_.add(r, column, value); };
    };
    for (long i = 0; i < rows_.first; ++i) plain(i, point, into(i));
    for (long k = rows_.first; k < size - 1; ++k) left_.reduced(k, into(k));
    left_.state(size - 2, component, theta_, into(size - 1));
    return lu_.factor();
  }

  // On the right what a component of the state at the last interface is met with; what is further left is
  // forgotten.
  LogDet right(int point, int component) {
    right_.point = point;
    const long a = right_.bound;
    lu_.reset(m_ - a, m_ - rows_.last + rows_.b, std::max<long>(rows_.b, m_ - rows_.last));
    const auto into = [&](long r) {
      return [this, r, a](long column, Complex value) {
        if (column >= a) lu_.add(r - a, column - a, value);
      };
    };
    right_.state(a, component, theta_, into(a));
    for (long k = a + 1; k < middle_; ++k) right_.reduced(k, into(k));
    for (long i = middle_; i < m_; ++i) plain(i, point, into(i));
    return lu_.factor();
  }

 private:
  // Row i of S as it stands in the equations.
  template <class Add>
  void plain(long i, int point, const Add& add) const {
    for (const Coupling::Term& t : rows_.s.coupling.row(i)) add(t.column, rows_.s.K1 * t.value * rows_.unit);
    add(i, eps_[kept(i)][point]);
  }
  std::size_t kept(long i) const { return i < rows_.first ? i : rows_.first + i - middle_; }

  const Rows& rows_;
  const double theta_;
  const long m_, middle_;  // rows from middle_ on are taken as they stand
  Kept right_, left_;
  std::vector<Values> eps_;  // of the rows that are taken as they stand
  BandLU lu_;
};

}  // namespace

bool close_ends(const Rows& rows, const ContourPiece& piece, Level& level) {
  const Symbol symbol(rows, piece);
  Ends ends(rows, symbol, level.theta);
  double reference[2] = {0, 0};
  for (int step = 0; step < P; ++step) {
    const int t = (step + P / 2) % P;  // the reference first
    const LogDet det[4] = {ends.left(t, 0), ends.left(t, 1), ends.right(t, 0), ends.right(t, 1)};
    for (int k = 0; k < 4; ++k) {
      double& ref = reference[k / 2];
      if (step == 0 && k % 2 == 0) ref = std::max(det[k].log_abs, det[k + 1].log_abs);
      level.end[k].put(t, std::exp(det[k].log_abs - ref) * det[k].unit);
    }
  }
  level.ended = true;
  for (int side : {0, 2}) {
    const double size = std::max(largest(level.end[side]), largest(level.end[side + 1]));
    for (int k : {side, side + 1})
      level.ended = level.ended && last_coefficients(level.end[k]) <= settled * size;
  }
  return level.ended;
}

}  // namespace stickslip::stretches
