// When the phase of an analytic function f counts as followed over a step: f'/f at both ends says that ln f
// changes by little, and the change is what the two slopes predict. A zero beside the step, a pair of them,
// or a crowd further off shows in the slopes, so that no whole turn passes unseen.

#include "stability/argument_principle.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <utility>

#include "model/kernel.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

// `change`: of ln f over `step`, its imaginary part within a half turn; the slopes are f'/f at the ends.
inline bool follows(std::complex<double> slope, std::complex<double> next_slope, std::complex<double> step,
                    std::complex<double> change) {
  const std::complex<double> predicted = (slope + next_slope) / 2. * step;
  return std::abs(slope * step) < 0.7 && std::abs(next_slope * step) < 0.7 &&
         std::abs(change - predicted) < 0.2;
}

namespace {

using namespace stretches;

bool right_of(Complex a, Complex b) { return a.real() > b.real(); }

// A polynomial by its values, and the turn of its phase from end to end.
struct Polynomial {
  ContourPiece piece;
  Values f;
  struct Point {
    double x;
    Complex f, slope;  // f'/f with respect to x
  };
  Complex value(Complex x, Complex* slope) const {  // and f'/f
    const Table& c = table();
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
  double turn(const Point& a, const Point& b, PhaseTurn& result, std::size_t zeros, int depth) const {
    if (depth > 60) throw Unsettled();
    const double step = b.x - a.x;
    const Complex change = std::log(b.f / a.f);
    if (follows(a.slope, b.slope, step, change)) {
      if (zeros > 0) zero_near((a.x + b.x) / 2, result, zeros);
      return change.imag();
    }
    const Point m = at((a.x + b.x) / 2);
    return turn(a, m, result, zeros, depth + 1) + turn(m, b, result, zeros, depth + 1);
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
      std::nth_element(all.begin(), all.begin() + zeros, all.end(), right_of);
      all.resize(zeros);
    }
  }
};

class Tree {
 public:
  Tree(const LinearisedOperator& s, PhaseTurn& result, std::size_t zeros)
      : s_(s), result_(result), zeros_(zeros), rows_(s), own_(own_rate(s)) {}

  void follow(const ContourPiece& piece, int depth = 0) {
    if (depth > 40) throw Unsettled();
    Level level;
    if (build(rows_, piece, level)) return descend(piece, std::move(level), depth);
    for (int side : {0, 1}) follow(piece.half(side), depth + 1);
  }

 private:
  // What counts as settled where the line is in so many maps: a product over m nodes carries round-off of
  // some m epsilon, below which no shorter piece brings it.
  double settled_over(std::size_t maps) const {
    return settled +
           8 * std::numeric_limits<double>::epsilon() * double(rows_.last - rows_.first) / double(maps);
  }

  // Joins neighbours on ever shorter pieces until one map is left. Where the joined maps are settled on the
  // whole piece, it is not halved.
  void descend(const ContourPiece& piece, Level level, int depth) {
    if (depth > 60) throw Unsettled();
    if (level.map.size() == 1) return finish(piece, level, depth);
    const bool settled_ends = level.ended ||
                              level.map.size() * shortest * 16 > std::size_t(rows_.last - rows_.first) ||
                              close_ends(rows_, piece, level);
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
  Values determinant(const Level& level) const {
    const Map& m = level.map[0];
    Values f;
    const Complex shift = level.log[P / 2];
    for (int t = 0; t < P; ++t) {
      Complex x;
      if (s_.scene.ring()) {
        // D2 is symmetric on a ring, so the waves multiply by mu and 1/mu round it: det (T - 1) = 2 - trace T
        x = 2. * std::exp(-m.shift - m.slope * table().x[t]) - m.e[0][0][t] - m.e[1][1][t];
      } else {
        const Complex q = m.e[0][0][t] * level.end[0][t] + m.e[0][1][t] * level.end[1][t];
        const Complex J = m.e[1][0][t] * level.end[0][t] + m.e[1][1][t] * level.end[1][t];
        x = J * level.end[2][t] - q * level.end[3][t];
      }
      f.put(t, x * std::exp(level.log[t] - shift));
    }
    return f;
  }

  // The turn of its phase, on halves of the piece where it is not settled.
  void finish(const ContourPiece& piece, Level& level, int depth, int halvings = 0) {
    const bool settled_ends = level.ended || close_ends(rows_, piece, level);
    const Values f = determinant(level);
    const double size = largest(f);
    if (!(size > 0) || !std::isfinite(size)) throw Unsettled();
    // Beside a zero round-off of the maps may outweigh what counts as settled: enough that the phase is
    // known.
    double least = size;
    for (int t = 0; t < P; ++t) least = std::min(least, std::abs(f[t]));
    const double unsettled = last_coefficients(f);
    const bool known = unsettled <= 100 * settled_over(1) * size ||
                       ((level.noise > 1 || halvings > 5) && unsettled <= 1e-3 * least);
    if (!settled_ends || !known) {
      if (depth > 60 || std::abs(piece.to - piece.from) < 1e-13 * (own_ + std::abs(piece.from)))
        throw Unsettled();
      Level half[2];
      for (Level& side : half) side.map.resize(1);
      join_two_(&level.map[0], nullptr, &half[0].map[0], &half[1].map[0]);
      halve_rest(level, half);
      for (int side : {0, 1}) finish(piece.half(side), half[side], depth + 1, halvings + 1);
      return;
    }
    ++result_.pieces;
    result_.turn += 2 * level.map[0].slope.imag();
    Polynomial{piece, f}.turn(result_, zeros_);
  }

  const LinearisedOperator& s_;
  PhaseTurn& result_;
  std::size_t zeros_;
  const Rows rows_;
  const double own_;
};

void keep_rightmost(std::vector<Complex>& zeros, std::size_t count) {
  std::sort(zeros.begin(), zeros.end(), right_of);
  if (zeros.size() > count) zeros.resize(count);
}

// The sums, and the rightmost zeros of all ranks, on every rank.
void gather(MPI_Comm comm, PhaseTurn& result, std::size_t zeros) {
  result.turn = sum_over(comm, result.turn);
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &result.pieces, 1, MPI_LONG, MPI_SUM, comm));
  const int ranks = ranks_in(comm), mine = int(2 * result.zeros.size());
  std::vector<int> counts(ranks), starts(ranks);
  SS_TRY(MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, comm));
  for (std::size_t k = 1; k < starts.size(); ++k) starts[k] = starts[k - 1] + counts[k - 1];
  std::vector<Complex> all((starts.back() + counts.back()) / 2);
  SS_TRY(MPI_Allgatherv(result.zeros.data(), mine, MPI_DOUBLE, all.data(), counts.data(), starts.data(),
                        MPI_DOUBLE, comm));
  keep_rightmost(all, zeros);
  result.zeros = std::move(all);
}

}  // namespace

std::optional<PhaseTurn> follow_phase(MPI_Comm comm, const LinearisedOperator& s, Complex from, Complex to,
                                      std::size_t zeros) {
  if (s.size() < shortest_line || !(s.K1 > 0)) return std::nullopt;
  // further left, where no wave of the line may be slower, the factor of viscosity has its zero
  if (s.N > 0 && !(std::min(from.real(), to.real()) > -s.K1 / s.N)) return std::nullopt;
  const int ranks = ranks_in(comm), rank = rank_in(comm);
  PhaseTurn result;
  bool failed = false;
  const int parts = ranks == 1 ? 1 : 4 * ranks;
  try {
    for (int k = rank; k < parts; k += ranks) {
      const ContourPiece piece{from + (to - from) * (double(k) / parts),
                               from + (to - from) * (double(k + 1) / parts)};
      Tree(s, result, zeros).follow(piece);
    }
  } catch (const Unsettled&) {
    failed = true;
  }
  // round-off may differ where the segment is cut: every rank tries it in one piece, as one rank alone would
  if (on_any_rank(comm, failed))
    return ranks > 1 ? follow_phase(PETSC_COMM_SELF, s, from, to, zeros) : std::nullopt;
  keep_rightmost(result.zeros, zeros);
  if (ranks > 1) gather(comm, result, zeros);
  if (s.N > 0) result.turn += double(s.size()) * std::arg(viscous_factor(s, to) / viscous_factor(s, from));
  return result;
}

// The number of eigenvalues right of a line, by the argument principle.

namespace {

// Follows the phase of the characteristic polynomial f along straight segments.
class Phase {
 public:
  Phase(const LinearisedOperator& s, double evaluations) : sliding_(s), left_(evaluations) {}

  struct Point {
    Complex z;
    LogDet f;
    Complex slope;  // f'/f, by a difference over 1e-3 of
    double reach;   // the length of the pieces that end here
  };
  Point at(Complex z, double reach) {
    left_ -= 2;
    const double step = 1e-3 * reach;
    const LogDet f = sliding_.factor(z, lu_), near = sliding_.factor(z + Complex(0, step), lu_);
    return {z, f, change(f, near) / Complex(0, step), reach};
  }
  bool failed() const { return failed_; }

  // The turn of the phase from a to b; visit(middle, turn) for every piece.
  template <class Visit>
  double turn(Point a, Point b, Visit&& visit, int depth = 0) {
    if (failed_ || left_ < 0 || depth > 60) {
      failed_ = true;
      return 0;
    }
    for (Point* p : {&a, &b})
      if (std::abs(b.z - a.z) < 0.02 * p->reach) *p = at(p->z, std::abs(b.z - a.z));
    const Complex moved = change(a.f, b.f);
    if (follows(a.slope, b.slope, b.z - a.z, moved)) {
      visit((a.z + b.z) / 2., moved.imag());
      return moved.imag();
    }
    const Point m = at((a.z + b.z) / 2., std::abs(b.z - a.z) / 2);
    return turn(a, m, visit, depth + 1) + turn(m, b, visit, depth + 1);
  }

 private:
  static Complex change(const LogDet& a, const LogDet& b) {  // of ln f, its phase within a half turn
    return {b.log_abs - a.log_abs, std::arg(b.unit * std::conj(a.unit))};
  }
  const LinearisedOperator& sliding_;
  double left_;
  bool failed_ = false;
  BandLU lu_;
};

// The count by following the phase with one determinant a point: short lines, and those the tree cannot take.
std::optional<long> count_directly(const LinearisedOperator& s, double a, double right, double height,
                                   std::vector<Complex>& where) {
  Phase phase(s, 3e8 / double(s.size()));
  double total = 0;
  Phase::Point last = phase.at(right, height / double(s.size()));
  const auto follow = [&](Complex to, int pieces, const auto& visit) {
    const Complex from = last.z;
    const double reach = std::abs(to - from) / pieces;
    for (int k = 1; k <= pieces && !phase.failed(); ++k) {
      const Phase::Point next = phase.at(from + (to - from) * (double(k) / pieces), reach);
      total += phase.turn(last, next, visit);
      last = next;
    }
  };
  const int pieces = int(s.size()) / 4 + 8;
  const auto nothing = [](Complex, double) {};
  follow({right, height}, pieces, nothing);
  follow({a, height}, pieces, nothing);
  // (frequency, turn) down the line, where the eigenvalues are near
  std::vector<std::pair<double, double>> line;
  follow(a, 4 * pieces, [&](Complex z, double turn) { line.emplace_back(z.imag(), turn); });
  if (phase.failed()) return std::nullopt;
  const double count = total / M_PI;
  if (std::abs(count - std::round(count)) > 0.01) return std::nullopt;
  // runs over which the phase turns against the many eigenvalues on the left
  std::vector<std::pair<double, double>> runs;  // (turn, frequency)
  double run = 0, weighted = 0;
  line.emplace_back(0, -1);
  for (const auto& [w, turn] : line) {
    if (turn > 0) {
      run += turn;
      weighted += turn * w;
    } else if (run > 0) {
      if (run > 0.3) runs.emplace_back(run, weighted / run);
      run = weighted = 0;
    }
  }
  std::sort(runs.rbegin(), runs.rend());
  for (const auto& [turn, w] : runs) where.emplace_back(a, w);
  return std::lround(count);
}

// ---- long lines

// Right of this S/lambda has a positive real part, at least Re lambda/A + beta - |q|/(Re lambda + r), where
// D2 is symmetric; or is diagonally dominant.
double right_of_all(const LinearisedOperator& s) {
  if (!s.symmetric()) return 1.01 * s.imaginary_bound();
  double x = 1e-3 * spring_frequency(s);
  for (std::size_t i = 0; i < s.size(); ++i) {
    const LinearPoint p = s.point(i);
    while (x / p.A + p.beta() - (p.has_state ? std::abs(p.q()) / (x + p.r()) : 0) <= 0) x *= 1.1;
  }
  return x;
}

// The phase of det S(lambda), turned continuously from 0 at real lambda far to the right, for Re lambda >=
// right_of_all(): there the pivots of S/lambda have a positive real part as S/lambda has.
double phase_right(const LinearisedOperator& s, Complex lambda) {
  BandLU lu;
  s.assemble(lambda, 1. / lambda, lu);
  double phase = double(s.size()) * std::arg(lambda);
  for (const Complex& pivot : lu.pivots()) phase += std::arg(pivot);
  return phase;
}

// The turn of the phase of det S from one place to another, both well to the right of all eigenvalues, by its
// pivots, each followed in steps over which it changes by less than half. Empty where that takes too many
// steps.
std::optional<double> follow_pivots(const LinearisedOperator& s, Complex from, Complex to) {
  BandLU lu;
  const auto pivots = [&](Complex lambda) {
    s.assemble(lambda, 1, lu);
    return lu.pivots();
  };
  double turn = 0, at = 0, step = 0.1;
  std::vector<Complex> last = pivots(from);
  for (int k = 0; at < 1; ++k) {
    if (k == 400) return std::nullopt;
    const double next_at = std::min(1., at + step);
    std::vector<Complex> next = pivots(from + (to - from) * next_at);
    double change = 0;
    bool follows = true;
    for (std::size_t i = 0; i < next.size() && follows; ++i) {
      follows = std::norm(next[i] - last[i]) < 0.25 * std::norm(last[i]);
      change += std::arg(next[i] * std::conj(last[i]));
    }
    if (!follows) {
      step /= 2;
      continue;
    }
    turn += change;
    at = next_at;
    step *= 1.5;
    last = std::move(next);
  }
  return turn;
}

// The count by the tree of stretches (argument_principle.hpp). det S has a pole at every -r_i.
std::optional<long> count_by_tree(MPI_Comm comm, const LinearisedOperator& s, double a, double height,
                                  std::vector<Complex>& where) {
  const double right = right_of_all(s), spacing = s.spacing();
  if (a >= right) return 0;
  // Far to the right waves decay between the nodes like the stencil's own solutions: the tree begins further
  // left.
  const double begin = std::max(a, std::min(right, 0.3 * s.rate_of(s.K1) / spacing));
  const std::optional<double> far = begin < right ? follow_pivots(s, {right, height}, {begin, height}) : 0;
  if (!far) return std::nullopt;
  const std::optional<PhaseTurn> top = follow_phase(comm, s, {begin, height}, {a, height});
  if (!top) return std::nullopt;
  const std::optional<PhaseTurn> line = follow_phase(comm, s, {a, height}, a, 32);
  if (!line) return std::nullopt;
  long poles = 0;
  for (std::size_t i = 0; i < s.size(); ++i) poles += s.has_state() && -s.point(i).r() > a;
  const double count = (phase_right(s, {right, height}) + *far + top->turn + line->turn) / M_PI;
  if (!(std::abs(count - std::round(count)) < 0.01)) return std::nullopt;
  for (const Complex& z : line->zeros) where.push_back(z.imag() >= 0 ? z : std::conj(z));
  return std::lround(count) + poles;
}

}  // namespace

std::optional<long> count_right(MPI_Comm comm, const LinearisedOperator& s, double a, double height,
                                double effort, std::vector<Complex>* where) {
  const double node_cost = 12;  // of the tree at every halving, in determinants of a node
  const double n = double(s.size());
  std::vector<Complex> places;
  std::optional<long> count;
  // the tree knows equal links
  if (!s.scene.medium.links_differ() && n * std::log2(n) * node_cost <= effort)
    count = count_by_tree(comm, s, a, height, places);
  // Right of this there is nothing, and the phase turns slowly there: half as far away again as the box is
  // high.
  if (!count && 120 * n * n <= effort)
    count = count_directly(s, a, std::max(s.real_bound(), a) + 0.5 * height, height, places);
  if (where) *where = std::move(places);
  return count;
}

}  // namespace stickslip
