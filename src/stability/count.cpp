// The number of eigenvalues right of a line, by the argument principle.
#include <algorithm>
#include <cmath>
#include <utility>

#include "stability/phase_steps.hpp"
#include "stickslip/stability/argument_principle.hpp"
#include "stickslip/stability/continuum.hpp"
#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

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
// ---------------------------------------------------------------------------------------------------

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
