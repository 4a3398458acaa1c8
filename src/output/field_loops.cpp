#include "output/field_watch.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "model/kernel.hpp"

namespace stickslip {

namespace {

constexpr PetscInt piece = 256;  // nodes whose psi stands in the first-level cache at a time

double least(double a, double b) { return b < a ? b : a; }
double largest(double a, double b) { return b > a ? b : a; }

template <int dof>
struct Sums {
  FieldSums operator()(const FieldRange& f) const {
    Lanes low(HUGE_VAL), high(-HUGE_VAL), psi_sum(0), eta_sum(0);
    const double* const u = f.u;
    in_lanes(f.count, [&](PetscInt i, int k) {
      const double psi = u[i * dof];
      low.of[k] = least(low.of[k], psi);
      high.of[k] = largest(high.of[k], psi);
      psi_sum.of[k] += psi;
      eta_sum.of[k] += u[i * dof + 1];
    });
    return {low.least_of_all(), high.largest_of_all(), psi_sum.sum(), eta_sum.sum()};
  }
};

struct NodeRanges {
  double *low, *high;
};

template <int dof>
struct Widen {
  Extremes operator()(const FieldRange& f, const NodeRanges& ranges) const {
    Lanes low(HUGE_VAL), high(-HUGE_VAL);
    const double* const u = f.u;
    double *const node_low = ranges.low, *const node_high = ranges.high;
    in_lanes(f.count, [&](PetscInt i, int k) {
      const double psi = u[i * dof];
      low.of[k] = least(low.of[k], psi);
      high.of[k] = largest(high.of[k], psi);
      node_low[i] = least(node_low[i], psi);
      node_high[i] = largest(node_high[i], psi);
    });
    return {low.least_of_all(), high.largest_of_all()};
  }
};

template <int dof>
struct Widest {
  LastExtremes operator()(const FieldRange& f, const NodeRanges& ranges) const {
    Lanes low(HUGE_VAL), high(-HUGE_VAL), range(0);
    const double *const u = f.u, *const node_low = ranges.low, *const node_high = ranges.high;
    in_lanes(f.count, [&](PetscInt i, int k) {
      const double psi = u[i * dof];
      low.of[k] = least(low.of[k], psi);
      high.of[k] = largest(high.of[k], psi);
      range.of[k] = largest(range.of[k], largest(node_high[i], psi) - least(node_low[i], psi));
    });
    return {low.least_of_all(), high.largest_of_all(), range.largest_of_all()};
  }
};

struct Level {
  double value, depth;
};

// Nodes that lie on one side, and those on none, need not be looked at one by one.
template <int dof>
struct Survey {
  Fronts operator()(const FieldRange& f, const Level& level) const {
    Fronts found;
    Lanes steepest(0);
    const double *const u = f.u, depth = level.depth;
    for (PetscInt begin = 0; begin < f.count; begin += piece) {
      const PetscInt count = std::min(piece, f.count - begin);
      alignas(64) double off[piece + 1];  // and that of the node behind
      Lanes low(HUGE_VAL), high(-HUGE_VAL);
      in_lanes(count, [&](PetscInt i, int k) {
        off[i] = u[(begin + i) * dof] - level.value;
        low.of[k] = least(low.of[k], off[i]);
        high.of[k] = largest(high.of[k], off[i]);
      });
      off[count] = begin + count < f.count ? u[(begin + count) * dof] - level.value : off[count - 1];
      in_lanes(count, [&](PetscInt i, int k) {
        steepest.of[k] = largest(steepest.of[k], std::abs(off[i + 1] - off[i]));
      });
      const bool below = low.least_of_all()<-depth, above = high.largest_of_all()> depth;
      if (below != above) found.passages.add(below ? -1 : 1);
      for (PetscInt i = 0; i < count && below && above; ++i)
        found.passages.add(off[i] < -depth ? -1 : off[i] > depth ? 1 : 0);
    }
    found.steepest = steepest.largest_of_all();
    return found;
  }
};

// The loop for so many unknowns a node that suits this processor, applied.
template <template <int> class Loop, class Result, class... More>
Result apply(const FieldRange& field, const More&... more) {
  using Function = std::function<Result(const FieldRange&, const More&...)>;
  static const Function of_two = kernel::compiled<Function>(Loop<2>{}),
                        of_three = kernel::compiled<Function>(Loop<3>{});
  return field.dof == 3 ? of_three(field, more...) : of_two(field, more...);
}

}  // namespace

FieldSums sums_of(const FieldRange& field) { return apply<Sums, FieldSums>(field); }

Extremes widen(const FieldRange& field, double* low, double* high) {
  return apply<Widen, Extremes>(field, NodeRanges{low, high});
}

LastExtremes widest(const FieldRange& field, const double* low, const double* high) {
  if (!low) {
    const FieldSums sums = sums_of(field);
    return {sums.low, sums.high, 0};
  }
  return apply<Widest, LastExtremes>(field, NodeRanges{const_cast<double*>(low), const_cast<double*>(high)});
}

Fronts fronts_of(const FieldRange& field, double level, double depth) {
  return apply<Survey, Fronts>(field, Level{level, depth});
}

}  // namespace stickslip

namespace stickslip::event_loops {

namespace {

struct AddStep {
  StepSums operator()(const StepOfNodes& s) const {
    Lanes work(0), squares(0), ends(0);
    const double *const p0 = s.p0, *const p = s.p, *const p1 = s.p1, *const F0 = s.F0, *const F = s.F,
                        *const F1 = s.F1;
    double *const slip = s.slip, *const slipped = s.slipped;
    const double part = s.dt / 6;
    in_lanes(PetscInt(s.count), [&](PetscInt i, int k) {
      const double step = part * (p0[i] + 4 * p[i] + p1[i]);
      slip[i] += step;
      slipped[i] += step;
      work.of[k] += p0[i] * F0[i] + 4 * p[i] * F[i] + p1[i] * F1[i];
      squares.of[k] += p0[i] * p0[i] + 4 * p[i] * p[i] + p1[i] * p1[i];
      ends.of[k] += p1[i] * p1[i];
    });
    return {work.sum(), squares.sum(), ends.sum()};
  }
};

struct FindMiddle {
  void operator()(const MiddleOfNodes& s) const {
    const MiddleOfNodes m = s;
#pragma GCC ivdep
    for (std::size_t k = 0; k < m.count; ++k) {
      const double m0 = m.A * (m.eta0[k] - m.B * m.p0[k] - m.F0[k]),
                   m1 = m.A * (m.eta1[k] - m.B * m.p1[k] - m.F1[k]);
      m.p[k] = (m.p0[k] + m.p1[k]) / 2 + m.dt / 8 * (m0 - m1);
    }
  }
};

struct Aim {
  void operator()(const AimedNodes& s) const {
    const AimedNodes m = s;
    constexpr double least = std::numeric_limits<double>::min();
#pragma GCC ivdep
    for (std::size_t k = 0; k < m.count; ++k) {
      const double aside = m.p0[k] + m.p1[k] < 0 ? -least : least;
      m.aimed[k] = m.psi[k] == 0 ? aside : m.psi[k];
    }
  }
};

struct Separate {
  void operator()(const InterleavedNodes& s) const {
    const InterleavedNodes m = s;
    if (m.dof == 2) {
#pragma GCC ivdep
      for (std::size_t i = 0; i < m.count; ++i) {
        m.psi[i] = m.u[2 * i];
        m.eta[i] = m.u[2 * i + 1];
      }
    } else {
#pragma GCC ivdep
      for (std::size_t i = 0; i < m.count; ++i) {
        m.psi[i] = m.u[3 * i];
        m.eta[i] = m.u[3 * i + 1];
        m.state[i] = m.u[3 * i + 2];
      }
    }
  }
};

struct CountUnknown {
  std::size_t operator()(const EarlierNodes& s) const {
    const EarlierNodes m = s;
    std::size_t count = 0;
    for (std::size_t i = 0; i < m.count; ++i) count += (m.p0[i] == 0) | (m.moved[i] == 0);
    return count;
  }
};

struct MarkMoving {
  void operator()(const MovingNodes& s) const {
    const MovingNodes m = s;
#pragma GCC ivdep
    for (std::size_t i = 0; i < m.count; ++i)
      m.moves[i] = int(std::abs(m.p0[i]) > m.velocity) | int(std::abs(m.p1[i]) > m.velocity);  // no branch
  }
};

template <class Loop, class Result, class Nodes>
Result apply(const Nodes& nodes) {
  static const auto loop = kernel::compiled<std::function<Result(const Nodes&)>>(Loop{});
  return loop(nodes);
}

}  // namespace

StepSums add_step(const StepOfNodes& nodes) { return apply<AddStep, StepSums>(nodes); }
void find_middle(const MiddleOfNodes& nodes) { apply<FindMiddle, void>(nodes); }
void aim(const AimedNodes& nodes) { apply<Aim, void>(nodes); }
void separate(const InterleavedNodes& nodes) { apply<Separate, void>(nodes); }
std::size_t count_unknown(const EarlierNodes& nodes) { return apply<CountUnknown, std::size_t>(nodes); }
void mark_moving(const MovingNodes& nodes) { apply<MarkMoving, void>(nodes); }

}  // namespace stickslip::event_loops
