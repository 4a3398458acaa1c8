#include "cycles/stick_motion.hpp"

#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

constexpr double deep = 0.1;             // of psi_scale(): a slip that would go beyond is far from grazing
constexpr int most_changes = 2000;       // in one period
constexpr long most_steps = 50000;       // in one period
constexpr double settled = 1e-12;        // change of Newton's method
constexpr double passes_section = 1e-7;  // psi of a node that is to rest there, over psi_scale()

std::string name_of(const Change& c) {
  return std::to_string(c.node) +
         (c.after == 0  ? "."
          : c.after > 0 ? "+"
                        : "-") +
         (c.before != 0 && c.after != 0 ? "!" : "");
}

std::vector<double> on_section(const StickMotion& m, const StickCycle& c) {
  std::vector<double> u(c.start);
  if (m.forced()) {
    u.back() = c.load.time;
    return u;
  }
  u[c.node * m.dof()] = 0;
  u[c.node * m.dof() + 1] = c.side * m.threshold(c.node, u.data()) - m.neighbour_force(c.node, u.data());
  return u;
}

}  // namespace

std::vector<std::size_t> free_unknowns(const StickMotion& m, const StickCycle& c) {
  const auto bound = [&](int i, int k) {
    if (k < 2 && m.held(i)) return true;
    return m.forced() ? k == 0 && c.load.rests[i] : k < 2 && i == c.node;
  };
  std::vector<std::size_t> free;
  for (int i = 0; i < m.nodes(); ++i)
    for (int k = 0; k < m.dof(); ++k)
      if (!bound(i, k)) free.push_back(std::size_t(i * m.dof() + k));
  return free;
}

StickReturnMap return_map_of(const StickMotion& m, const StickCycle& from,
                             const StickReturnMapOptions& wishes) {
  StickReturnMap result;
  StickState& p = result.at;
  p.u = on_section(m, from);
  m.decide(p);
  const double load_ends = from.load.periods * m.scene().forcing_period();
  if (!m.forced() && p.direction[from.node] != from.side)
    throw Failure("exact stick: a node at its threshold does not start");
  p.deviations = wishes.deviations;
  p.count = p.deviations.size() / m.size();
  const double deepest = -deep * m.psi_scale();
  result.depth = deepest;
  result.clearance = StickMotion::never;
  const auto turned = [&](double, int node, const double* u) {
    result.clearance = std::min(result.clearance, std::abs(u[node * m.dof()]));
  };
  std::vector<double> rests_since(m.nodes(), -1.);
  for (int i = 0; i < m.nodes(); ++i)
    if (p.direction[i] == 0) rests_since[i] = 0;
  // of a slip
  const Scene mean = m.scene().averaged();
  const double patience = 400 * 2 * M_PI / std::sqrt(mean.A() * (mean.K0() + 1e-3 * mean.K1()));
  const long most = std::min(most_steps, m.most_steps(p.count));
  int released = 0;
  std::vector<double> was(p.direction);
  if (wishes.changed) wishes.changed(was, p);
  const auto goes_on = [&] { return m.forced() ? p.t < load_ends : released < from.releases; };
  for (int count = 0; goes_on(); ++count) {
    if (count == most_changes || p.steps > most) throw Failure("exact stick: the motion does not repeat");
    beat("slips");
    const double until = m.forced() ? load_ends : m.all_rest(p) ? m.never : p.t + patience;
    const std::vector<Change> changes = m.advance(p, until, wishes.passed, turned);
    if (changes.empty() && !m.forced()) throw Failure("exact stick: a slip does not come to rest");
    if (wishes.changed) wishes.changed(was, p);
    was = p.direction;
    for (const Change& c : changes) {
      result.sequence += name_of(c) + " ";
      if (c.before != 0 && wishes.turns)
        result.depth = std::max(result.depth, m.turn_beyond(p, c.node, c.before, deepest));
      double& since = rests_since[c.node];
      if (c.after == 0)
        since = c.t;
      else if (since >= 0) {
        result.rests.push_back({c.node, since, c.t});
        since = -1;
      }
      if (c.node == from.node && c.before == 0 && c.after == from.side) ++released;
    }
  }
  result.period = m.forced() ? load_ends : p.t;
  result.excess = p.excess;
  for (int i = 0; i < m.nodes(); ++i)  // rests that go on into the next period
    if (const double since = rests_since[i]; since >= 0) {
      const auto first =
          std::find_if(result.rests.begin(), result.rests.end(), [&](const Rest& r) { return r.node == i; });
      if (since > 0 && first != result.rests.end() && first->begin == 0) {
        first->begin = since;
        first->end += result.period;
      } else {
        result.rests.push_back({i, since, result.period});
      }
    }
  return result;
}

namespace {

// Deviations of the free unknowns, which stand before the release, go to the section and past the release of
// every node that is released there.
void pass_release(const StickMotion& m, const StickCycle& c, StickState& p) {
  const std::size_t dof = std::size_t(m.dof()), section = std::size_t(c.node) * dof;
  const double slope = m.threshold_slope(c.node, p.u.data());
  for (std::size_t j = 0; j < p.count; ++j) {
    double* y = &p.deviations[j * m.size()];
    y[section + 1] = (dof == 3 ? c.side * slope * y[section + 2] : 0) - m.neighbour_force(c.node, y);
  }
  m.decide(p);
  std::vector<double> resting(p.direction);
  for (int i = 0; i < m.nodes(); ++i)
    if (p.u[std::size_t(i) * dof] == 0) resting[i] = 0;
  m.pass_jumps(resting, p);
}

}  // namespace

MapAt map_at(const StickMotion& m, const StickCycle& c) {
  const std::size_t size = m.size(), dof = std::size_t(m.dof()), section = std::size_t(c.node) * dof;
  const std::vector<std::size_t> free = free_unknowns(m, c);
  const std::size_t n = free.size();
  StickState p{0, on_section(m, c), {}, std::vector<double>(n * size), n};
  for (std::size_t j = 0; j < n; ++j) p.deviations[j * size + free[j]] = 1;
  if (!m.forced()) pass_release(m, c, p);
  StickReturnMapOptions wishes;
  wishes.deviations = std::move(p.deviations);
  MapAt result{return_map_of(m, c, wishes), {}, std::vector<double>(n * n)};
  const StickState& end = result.round.at;
  for (const std::size_t k : free) result.image.push_back(end.u[k]);
  // the deviations, taken along the motion back to the section
  std::vector<double> after(size);
  m.rates(end.direction, end.u.data(), after.data());
  const double end_slope = m.forced() ? 0 : m.threshold_slope(c.node, end.u.data());
  const auto event = [&](const double* d) {
    return c.side * (d[section + 1] + m.neighbour_force(c.node, d)) -
           (dof == 3 ? end_slope * d[section + 2] : 0);
  };
  for (std::size_t j = 0; j < n; ++j) {
    const double* d = &end.deviations[j * size];
    const double late = m.forced() ? 0 : event(d) / event(after.data());
    for (std::size_t i = 0; i < n; ++i) result.slopes[i * n + j] = d[free[i]] - after[free[i]] * late;
  }
  return result;
}

std::vector<double> free_values(const StickMotion& m, const StickCycle& c) {
  const std::vector<double> u = on_section(m, c);
  std::vector<double> values;
  for (const std::size_t k : free_unknowns(m, c)) values.push_back(u[k]);
  return values;
}

// A velocity that is 0 to the accuracy of Newton's method is 0: a node rests there, and does not begin with a
// slip of 1e-29 whose stop would be one more change of the sequence.
void set_free_values(const StickMotion& m, const std::vector<double>& values, StickCycle& c) {
  const std::vector<std::size_t> free = free_unknowns(m, c);
  const double still = settled * m.psi_scale();
  for (std::size_t i = 0; i < free.size(); ++i) {
    const bool rests = !m.forced() && free[i] % std::size_t(m.dof()) == 0 && std::abs(values[i]) < still;
    c.start[free[i]] = rests ? 0 : values[i];
  }
  c.start = on_section(m, c);
}

void close_cycle(const StickMotion& m, StickCycle& c) {
  StickReturnMapOptions wishes;
  wishes.turns = true;
  const StickReturnMap round = return_map_of(m, c, wishes);
  c.start = on_section(m, c);
  c.period = round.period;
  c.sequence = round.sequence;
  c.depth = round.depth;
  c.clearance = round.clearance;
  c.residual = 0;
  for (const std::size_t k : m.forced() ? moving_unknowns(m) : free_unknowns(m, c))
    c.residual = std::max(c.residual, std::abs(round.at.u[k] - c.start[k]));
  if (m.forced() && c.residual > passes_section * m.psi_scale())
    throw Failure("exact stick: a start or a stop passes the phase of the load at which the map is taken");
}

StickCycle polished(const StickMotion& m, const StickCycle& guess) {
  StickCycle c(guess);
  std::vector<double> x = free_values(m, c);
  const std::vector<std::size_t> free = free_unknowns(m, c);
  const int n = int(x.size());
  double last = StickMotion::never;
  for (int iteration = 0; n > 0; ++iteration) {
    set_free_values(m, x, c);
    MapAt map = map_at(m, c);
    std::vector<double> change(x);  // (DP - 1) change = x - P(x)
    double missed = 0, largest = 0;
    const auto relative = [&](std::size_t i) {
      return std::abs(change[i]) / (m.scale(free[i]) + std::abs(x[i]));
    };
    for (int i = 0; i < n; ++i) {
      change[i] -= map.image[i];
      missed = std::max(missed, relative(i));
      map.slopes[i * n + i] -= 1;
    }
    if (!solve_dense(n, map.slopes.data(), 1, change.data()))
      throw Failure("exact stick: the return map is singular");
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] += change[i];
      largest = std::max(largest, relative(i));
    }
    if (!std::isfinite(largest) || iteration > 30)
      throw Failure("exact stick: Newton's method on the return map fails");
    // what hardly comes back (a multiplier near 1) is known to round-off of the map, not of the start
    if (largest < settled || (largest >= last && (missed < settled || largest < 1e-9))) break;
    last = largest;
  }
  set_free_values(m, x, c);
  close_cycle(m, c);
  return c;
}

std::vector<std::size_t> moving_unknowns(const StickMotion& m) {
  std::vector<std::size_t> moving;
  for (int i = 0; i < m.nodes(); ++i)
    for (int k = 0; k < m.dof() && !m.held(i); ++k) moving.push_back(std::size_t(i * m.dof() + k));
  return moving;
}

std::vector<double> monodromy_matrix(const StickMotion& m, const StickCycle& cycle) {
  const std::vector<std::size_t> moving = moving_unknowns(m);
  StickReturnMapOptions wishes;
  wishes.deviations.assign(m.size() * moving.size(), 0.);
  for (std::size_t k = 0; k < moving.size(); ++k) wishes.deviations[k * m.size() + moving[k]] = 1;
  const std::vector<double> all = return_map_of(m, cycle, wishes).at.deviations;
  std::vector<double> map;
  for (std::size_t k = 0; k < moving.size(); ++k)
    for (const std::size_t j : moving)  // in units of the unknowns
      map.push_back(all[k * m.size() + j] * (m.scale(moving[k]) / m.scale(j)));
  return map;
}

std::vector<std::complex<double>> multipliers_of(std::size_t size, const std::vector<double>& map) {
  std::vector<double> unit(size * size, 0.);
  for (std::size_t k = 0; k < size; ++k) unit[k * size + k] = 1;
  return generalised_eigenvalues(int(size), map, unit);  // of the transposed, which are the same
}

namespace {

double distance(const StickMotion& m, const std::vector<double>& one, const std::vector<double>& other) {
  double apart = 0;
  for (const std::size_t k : moving_unknowns(m))
    apart = std::max(apart, std::abs(one[k] - other[k]) / m.scale(k));
  return apart;
}

// What a motion repeats exactly is a cycle, whether or not Newton's method has an answer there (its
// deviations may be none that are linear): the motion itself goes on until it comes no nearer.
std::optional<StickCycle> repeated(const StickMotion& m, const StickCycle& near) {
  constexpr double exactly = 1e-9;
  StickCycle c(near);
  try {
    for (double last = exactly;;) {
      c.start = on_section(m, c);
      const std::vector<double> image = return_map_of(m, c, {}).at.u;
      const double apart = distance(m, image, c.start);
      if (last == exactly && !(apart < exactly)) return std::nullopt;
      if (!(apart < last)) break;
      last = apart;
      c.start = image;
    }
    close_cycle(m, c);
  } catch (const Failure&) {
    return std::nullopt;
  }
  return c;
}

StickCycle solved(const StickMotion& m, const StickCycle& near) {
  try {
    return polished(m, near);
  } catch (const Failure&) {
    if (std::optional<StickCycle> same = repeated(m, near)) return *same;
    throw;
  }
}

StickCycle shortest(const StickMotion& m, const StickCycle& found) {
  constexpr double same = 1e-7;
  int& (*const count_of)(StickCycle&) = [](StickCycle& c) -> int& {
    return c.load.periods > 0 ? c.load.periods : c.releases;
  };
  StickCycle part(found);
  const int whole = count_of(part);
  for (int count = 1; count < whole; ++count) {
    if (whole % count != 0) continue;
    count_of(part) = count;
    if (m.forced()) part.load.time = std::fmod(found.load.time, count * m.scene().forcing_period());
    try {
      if (distance(m, return_map_of(m, part, {}).at.u, found.start) < same) return solved(m, part);
    } catch (const Failure&) {
    }
  }
  return found;
}

}  // namespace

std::optional<StickCycle> cycle_near(const StickMotion& m, const StickCycle& near) {
  constexpr double far = 1e-2;
  const StickCycle exact = solved(m, near);
  if (distance(m, exact.start, near.start) > far) return std::nullopt;
  return shortest(m, exact);
}

double growth_in_period(const StickMotion& m, const StickCycle& cycle) {
  return std::log(
      std::abs(multipliers_of(moving_unknowns(m).size(), monodromy_matrix(m, cycle)).front()));
}

// What is said of a cycle of friction that sticks: its course, measures, multipliers.

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
  try {
    c.multipliers = multipliers_of(moving_unknowns(motion).size(), monodromy_matrix(motion, cycle));
  } catch (const Failure& e) {
    c.not_linear = e.what();
  }
  set_error(motion, from, return_map_of(rough, from, {}), c);
  for (std::size_t k = 0; k < c.times.size(); ++k)  // without the harmonic force
    for (PetscInt i = 0; i < c.nodes; ++i)
      c.states[(k * std::size_t(c.nodes) + std::size_t(i)) * std::size_t(c.dof) + 1] -=
          scene.push(c.times[k]);
  measure(c);
  return c;
}

}  // namespace stickslip
