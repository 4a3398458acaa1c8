#include "output/event_loops.hpp"

#include <cmath>
#include <functional>
#include <limits>

#include "model/kernel.hpp"
#include "output/lanes.hpp"

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
