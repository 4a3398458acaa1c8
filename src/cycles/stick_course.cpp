// What is said of a cycle of friction that sticks: its course, measures, multipliers.
#include <algorithm>
#include <cmath>

#include "cycles/stick_return_map.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

constexpr int samples = 10;  // of a step of order 12

// Samples of the motion in order of time; extrema of psi of each node and of the mean eta are among them.
class Sampling {
 public:
  explicit Sampling(const StickMotion& m, Cycle& cycle) : m_(m), cycle_(cycle) {}

  void operator()(double from, double to, const std::function<void(double, double*)>& at) {
    const int parts = resting(from, at) ? 2 : samples;
    std::vector<double> times;
    for (int k = 0; k <= parts; ++k) times.push_back(from + (to - from) * k / parts);
    times.back() = to;
    std::vector<std::vector<double>> u;
    for (const double t : times) {
      u.emplace_back(m_.size());
      at(t, u.back().data());
    }
    std::vector<double> all(times);
    for (int function = 0; parts == samples && function <= m_.nodes(); ++function)
      for (int k = 1; k < parts; ++k) {
        const double here = value(function, u[k].data()), before = value(function, u[k - 1].data());
        const double behind = value(function, u[k + 1].data());
        if ((here - before) * (behind - here) >= 0) continue;
        const double sign = here > before ? -1 : 1;
        std::vector<double> there(m_.size());
        all.push_back(find_least(
                          [&](double t) {
                            at(t, there.data());
                            return sign * value(function, there.data());
                          },
                          times[k - 1], times[k + 1], 1e-6 * (to - from), [](double) { return false; })
                          .x);
      }
    std::sort(all.begin(), all.end());
    for (const double t : all) {
      if (!cycle_.times.empty() && t <= cycle_.times.back()) continue;
      cycle_.times.push_back(t);
      std::vector<double> there(m_.size());
      at(t, there.data());
      cycle_.states.insert(cycle_.states.end(), there.begin(), there.end());
    }
  }

 private:
  bool resting(double from, const std::function<void(double, double*)>& at) const {
    std::vector<double> u(m_.size()), f(m_.size());
    at(from, u.data());
    StickState p{from, u, {}, {}, 0};
    m_.decide(p);
    return std::all_of(p.direction.begin(), p.direction.end(), [](double d) { return d == 0; });
  }
  double value(int function, const double* u) const {
    if (function < m_.nodes()) return u[function * m_.dof()];
    double sum = 0;
    for (int i = 0; i < m_.nodes(); ++i) sum += u[i * m_.dof() + 1];
    return sum / m_.nodes();
  }

  const StickMotion& m_;
  Cycle& cycle_;
};

// What is said of a cycle is said of the nodes that are not held.
void leave_out_held(const StickMotion& m, Cycle& c) {
  const std::vector<std::size_t> moving = moving_unknowns(m);
  c.nodes = PetscInt(moving.size()) / c.dof;
  std::vector<double> states;
  for (std::size_t at = 0; at < c.states.size(); at += m.size())
    for (const std::size_t k : moving) states.push_back(c.states[at + k]);
  c.states = std::move(states);
  c.rests.erase(
      std::remove_if(c.rests.begin(), c.rests.end(), [&](const Rest& r) { return m.held(int(r.node)); }),
      c.rests.end());
  for (Rest& rest : c.rests) rest.node -= m.held(0) ? 1 : 0;
}

}  // namespace

Cycle described(const Scene& scene, const StickCycle& cycle) {
  const StickMotion motion(scene), rough(scene, 1e-10);
  Cycle c;
  c.dof = motion.dof();
  c.period = cycle.period;
  c.residual = cycle.residual;
  c.tests["graze"] = cycle.depth;
  StickReturnMapOptions wishes;
  wishes.passed = [&, sampling = Sampling(motion, c)](double from, double to, const auto& at) mutable {
    sampling(from, to, at);
  };
  c.rests = return_map_of(motion, cycle, wishes).rests;
  std::sort(c.rests.begin(), c.rests.end(), [](const Rest& a, const Rest& b) { return a.begin < b.begin; });
  std::copy(c.states.begin(), c.states.begin() + long(motion.size()), c.states.end() - long(motion.size()));
  for (std::size_t k = 0; k < c.states.size(); k += std::size_t(c.dof))  // a stop is located to round-off
    if (std::abs(c.states[k]) < 1e-13 * (1 + std::abs(scene.v))) c.states[k] = 0;
  leave_out_held(motion, c);
  c.multipliers = multipliers_of(moving_unknowns(motion).size(), monodromy_matrix(motion, cycle));
  for (std::size_t k = 0; k < c.multipliers.size(); ++k)
    if (std::abs(c.multipliers[k] - 1.) < std::abs(c.multipliers[c.phase_mode] - 1.)) c.phase_mode = k;
  c.error_estimate = std::max(1e-15, std::abs(return_map_of(rough, cycle, {}).period / cycle.period - 1));
  measure(c);
  return c;
}

}  // namespace stickslip
