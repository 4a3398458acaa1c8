// What is said of a cycle of friction that sticks: its course, measures, multipliers.
#include <algorithm>
#include <cmath>

#include "cycles/stick_return_map.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

constexpr int samples = 10;  // of a step of order 12

// Samples of the motion in order of time; among them is every place where psi of a node, or the mean force of
// the springs, turns.
class Sampling {
 public:
  explicit Sampling(const StickMotion& m, Cycle& cycle) : m_(m), cycle_(cycle) {}

  void operator()(double from, double to, const std::function<void(double, double*)>& at) {
    StickState middle{from, std::vector<double>(m_.size()), {}, {}, 0};  // directions are the same throughout
    at(from + (to - from) / 2, middle.u.data());
    m_.decide(middle);
    const bool rests = m_.all_rest(middle) && !m_.forced();
    const int parts = rests ? 2 : samples;
    std::vector<double> all;
    for (int k = 0; k <= parts; ++k) all.push_back(from + (to - from) * k / parts);
    all.back() = to;
    std::vector<double> u(m_.size()), f(m_.size());
    const auto slopes_at = [&](double t) {
      at(t, u.data());
      m_.rates(middle.direction, u.data(), f.data());
      return slopes(t, f.data());
    };
    std::vector<double> before, behind;
    for (int k = 0; k <= parts && !rests; ++k) {
      behind = slopes_at(all[k]);
      for (std::size_t i = 0; k > 0 && i < behind.size(); ++i)
        if (before[i] * behind[i] < 0)
          all.push_back(find_root([&](double t) { return slopes_at(t)[i]; },
                                  {all[k - 1], before[i], all[k], behind[i]}, 1e-7 * (to - from)));
      before.swap(behind);
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
  // Of psi of each node that is not held and of the mean force of their springs, from rates at t.
  std::vector<double> slopes(double t, const double* f) const {
    std::vector<double> all;
    double sum = 0;
    for (int i = 0; i < m_.nodes(); ++i) {
      if (m_.held(i)) continue;
      all.push_back(f[i * m_.dof()]);
      sum += f[i * m_.dof() + 1];
    }
    const double push = m_.scene().push_velocity(t);  // springs that differ along x bear no such force
    all.push_back(sum / double(all.size()) - (push == 0 ? 0 : m_.scene().K0() * push));
    return all;
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

// The same cycle from phase 0 of its load on.
StickCycle from_phase_0(const StickMotion& m, const StickCycle& cycle) {
  StickCycle from(cycle);
  if (!m.forced() || cycle.load.time == 0) return from;
  StickState p{0, cycle.start, {}, {}, 0};
  p.u.back() = cycle.load.time;
  m.decide(p);
  const double wait = cycle.period - cycle.load.time;
  while (p.t < wait) m.advance(p, wait);
  from.start = p.u;
  from.load.time = 0;
  return from;
}

// Which multiplier is the phase's, and how well the cycle is known: its period, or under a load its start.
void set_error(const StickMotion& m, const StickCycle& from, const StickReturnMap& rough, Cycle& c) {
  if (!m.forced()) {
    for (std::size_t k = 0; k < c.multipliers.size(); ++k)
      if (std::abs(c.multipliers[k] - 1.) < std::abs(c.multipliers[c.phase_mode] - 1.)) c.phase_mode = k;
    c.error_estimate = std::max(1e-15, std::abs(rough.period / from.period - 1));
    return;
  }
  c.phase_mode = c.multipliers.size();
  c.error_estimate = 1e-15;
  for (const std::size_t k : moving_unknowns(m))
    c.error_estimate = std::max(c.error_estimate, std::abs(rough.at.u[k] - from.start[k]) /
                                                      (m.scale(k) + std::abs(from.start[k])));
  double held = 1;  // of an error of the start, by one period
  for (const std::complex<double>& one : c.multipliers) held = std::min(held, std::abs(1. - one));
  c.error_estimate /= held;
}

}  // namespace

Cycle described(const Scene& scene, const StickCycle& cycle) {
  const StickMotion motion(scene), rough(scene, 1e-10);
  const StickCycle from = from_phase_0(motion, cycle);
  Cycle c;
  c.forcing_periods = cycle.load.periods;
  c.dof = motion.dof();
  c.period = cycle.period;
  c.residual = cycle.residual;
  c.tests["graze"] = cycle.depth;
  StickReturnMapOptions wishes;
  wishes.passed = [&, sampling = Sampling(motion, c)](double begin, double end, const auto& at) mutable {
    sampling(begin, end, at);
  };
  c.rests = return_map_of(motion, from, wishes).rests;
  std::sort(c.rests.begin(), c.rests.end(), [](const Rest& a, const Rest& b) { return a.begin < b.begin; });
  std::copy(c.states.begin(), c.states.begin() + long(motion.size()), c.states.end() - long(motion.size()));
  leave_out_held(motion, c);
  for (std::size_t k = 0; k < c.states.size(); k += std::size_t(c.dof))  // a stop is located to round-off
    if (std::abs(c.states[k]) < 1e-13 * motion.psi_scale()) c.states[k] = 0;
  c.multipliers = multipliers_of(moving_unknowns(motion).size(), monodromy_matrix(motion, cycle));
  set_error(motion, from, return_map_of(rough, from, {}), c);
  for (std::size_t k = 0; k < c.times.size(); ++k)  // without the harmonic force
    for (PetscInt i = 0; i < c.nodes; ++i)
      c.states[(k * std::size_t(c.nodes) + std::size_t(i)) * std::size_t(c.dof) + 1] -=
          scene.push(c.times[k]);
  measure(c);
  return c;
}

}  // namespace stickslip
