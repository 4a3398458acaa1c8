#include "stickslip/cycles/stick_cycle.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "base/pulse.hpp"
#include "cycles/past_states.hpp"
#include "cycles/stick_return_map.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/dense.hpp"

namespace stickslip {

namespace {

constexpr long most_steps = 1000000;  // of the motion, over the nodes
// distance of psi from steady sliding over its size: there the linear answer holds
constexpr double near_sliding = 0.05;

// What is seen of the motion on its way to a cycle.
class OrbitSearch {
 public:
  OrbitSearch(const StickMotion& motion, int patience)
      : m_(motion), patience_(patience), mean_(motion.scene().averaged()),
        turn_(2 * M_PI / std::sqrt(mean_.A() * mean_.K0())) {
    const Scene& s = mean_;
    if (!std::isfinite(turn_)) turn_ = 2 * M_PI / std::sqrt(s.A() * s.K1());
    escape_ = escape_velocity(s);
    turn_ += (s.B() + std::abs(s.s_delta()) / s.A()) / s.K0();
  }

  StickFate operator()(const std::vector<double>& start) {
    StickState p{0, start, {}, {}, 0};
    m_.decide(p);
    const auto turned = [this](double, int node, const double* u) {
      last_ = now_;
      now_ = u[node * m_.dof()];
      if (++turns_ == 1) first_ = now_;
    };
    const long most = most_steps / m_.nodes();
    bool released = released_now(p);
    for (long releases = 0, next_try = 0, passed = 0; releases < 50L * patience_ && p.steps < most;) {
      beat("slips");
      const std::vector<Change> changes =
          m_.advance(p, m_.all_rest(p) ? m_.never : p.t + turn_, nullptr, turned);
      if (p.t == StickMotion::never) return {Fate::stuck, {}, 0};
      if (size(p) > escape_) return {Fate::grows, {}, p.t};
      if (changes.empty()) {
        if (++quiet_ > patience_)
          return ended(p, m_.free_nodes_rest(p) ? Fate::waits
                          : oscillates(p)       ? Fate::oscillates
                                                : Fate::slides);
        if (turns_ > 0 && m_.size() == 2) return ended(p, stable() ? Fate::slides : Fate::oscillates);
        if (turns_ > 1 && closing(p)) return ended(p, Fate::slides);
        continue;
      }
      quiet_ = turns_ = 0;
      for (const Change& c : changes) {
        passed = c.before == 0 || c.after == 0 ? 0 : passed + 1;
        if (passed > patience_ || (passed > 1 && released && std::isinf(escape_)))
          return {Fate::oscillates, {}, p.t};
        released = released || (c.before == 0 && m_.size() == 2);
        if (c.before == 0 && ++releases && repeats(c, p) && releases >= next_try) {
          if (const std::optional<StickCycle> found = cycle(c, p)) return {Fate::repeats, *found, p.t};
          // what only seems to repeat (beside a fold, say) does so for long
          next_try = releases + releases / 2;
        }
      }
    }
    return ended(p, Fate::wanders);
  }

 private:
  StickFate ended(const StickState& p, Fate fate) const {
    StickFate result{fate, {}, p.t};
    result.cycle.clearance = turns_ == 0 ? std::abs(m_.scene().v) : std::abs(first_);
    return result;
  }

  bool stable() const {  // uniform sliding
    const Scene& s = m_.scene();
    const double side = s.v < 0 ? -1 : 1;
    const std::shared_ptr<const Friction> law = Friction::of(s.friction);
    const double state = m_.dof() == 3 ? law->steady_state(s.v) : 0;
    return LinearPoint(mean_, law->sliding_partials(s.v, state, side), law->sliding_rate(s.v, state, side))
        .stable(0);
  }
  // One node that turns nearer and nearer to sliding that is stable.
  bool closing(const StickState& p) const {
    const double v = m_.scene().v;
    return p.direction.size() == 1 && std::abs(now_ - v) < near_sliding * std::abs(v) &&
           std::abs(now_ - v) < std::abs(last_ - v) && stable();
  }
  // |psi| to which a node swings at most, less what friction alone makes of eta.
  double size(const StickState& p) const {
    double most = 0;
    for (int i = 0; i < m_.nodes() && std::isfinite(escape_); ++i) {
      const double* u = &p.u[i * m_.dof()];
      const double force = std::max(0., std::abs(u[1]) - 4 * m_.threshold(i, p.u.data()));
      most = std::max(most, std::hypot(u[0], force * std::sqrt(mean_.A() / mean_.K0())));
    }
    return most;
  }
  // One node without a state, right at its threshold: in the plane of psi and eta motions do not cross, so
  // that a slip that comes back to psi = 0 beyond the threshold, and passes on into the next one, goes round
  // outside itself forever.
  bool released_now(const StickState& p) const {
    return m_.size() == 2 && p.u[0] == 0 && p.direction[0] != 0 &&
           std::abs(p.u[1]) <= m_.threshold(0, p.u.data()) * (1 + 1e-12);
  }
  bool oscillates(const StickState& p) const {
    double most = 0;
    std::vector<double> f(m_.size());
    m_.rates(p.direction, p.u.data(), f.data());
    for (std::size_t i = 0; i < f.size(); i += std::size_t(m_.dof())) most = std::max(most, std::abs(f[i]));
    return most * turn_ > 1e-4 * m_.psi_scale();
  }

  // Whether this release looks like one before; fills releases_.
  bool repeats(const Change& c, const StickState& p) {
    PastStates& seen = seen_.try_emplace({c.node, c.after}, std::size_t(m_.dof())).first->second;
    const double size = std::max({1e-300, seen.largest_psi(), std::abs(m_.scene().v)});
    releases_ = seen.repeats_after(p.u, size, m_.state_scale());
    return releases_ > 0;
  }
  std::optional<StickCycle> cycle(const Change& c, const StickState& p) const {
    StickCycle near;
    near.start = p.u;
    near.node = c.node;
    near.side = c.after;
    near.releases = releases_;
    return accepted_cycle(m_, near);
  }

  const StickMotion& m_;
  const int patience_;
  const Scene mean_;  // with the mean coefficients, for estimates
  double turn_;       // about the time of one
  double escape_;     // see escape_velocity()
  int quiet_ = 0, turns_ = 0, releases_ = 0;
  double first_ = 0, now_ = 0, last_ = 0;              // psi at turns without a stop, since the last change
  std::map<std::pair<int, double>, PastStates> seen_;  // releases of a node in a direction
};

}  // namespace

std::string to_string(Fate fate) {
  switch (fate) {
    case Fate::repeats: return "sticks and slips periodically";
    case Fate::slides: return "slides steadily";
    case Fate::oscillates: return "oscillates without rest";
    case Fate::stuck: return "rests permanently";
    case Fate::waits: return "rests without a slip";
    case Fate::grows: return "grows without bound";
    default: return "sticks and slips without repeating";
  }
}

Scene one_node_of(const Scene& scene) {
  Scene one = scene;
  one.n = 1;
  one.length = scene.form == Form::chain ? 1 : scene.h();
  one.left = one.right = End::periodic;
  return one;
}

StickFate stick_fate(const Scene& scene, const std::vector<double>& start, int patience) {
  const StickMotion motion(scene);
  return OrbitSearch(motion, patience)(start);
}

namespace {

bool never_slips(const Scene& s) { return s.v == 0 || (s.v < 0 && !s.friction.back_slip); }

// Nothing damps, and friction never rises with velocity. The distance from sliding in (psi, eta), measured by
// the energy, then never shrinks; a slip begins at psi = 0, at a distance of at least |v|, and so comes back
// to psi = 0 in its first turn round sliding or a later one, which can be thousands of turns later where
// friction hardly falls. Whether it rests there is another question: one that comes back beyond the threshold
// passes.
bool always_returns(const Scene& s) {
  if (s.friction.has_state() || s.B() != 0 || s.s_delta() != 0) return false;
  const std::shared_ptr<const Friction> law = Friction::of(s.friction);
  const double side = s.v < 0 ? -1 : 1;
  for (int k = -20; k <= 20; ++k)
    if (law->partials(side * std::ldexp(std::abs(s.v), k), 0).F_psi > 0) return false;
  return true;
}

// Right before the release of one node that has rested for `cycles` times of loading and of healing since it
// slid at v.
std::vector<double> after_rest(const StickMotion& m, double cycles) {
  const Scene& s = m.scene();
  std::vector<double> u(m.size(), 0.);
  if (m.dof() == 3) {
    const std::shared_ptr<const Friction> law = Friction::of(s.friction);
    u[2] = law->steady_state(s.v);
    const double load = m.threshold(0, u.data()) / (s.K0() * std::abs(s.v));
    u[2] = law->state_at_rest(u[2], cycles * (load + law->time_at_rest(u[2])));
  }
  u[1] = (s.v < 0 ? -1 : 1) * m.threshold(0, u.data());
  return u;
}
constexpr double long_rest = 20, short_rest = 0.5;  // in those times
constexpr int most_rounds = 45;  // settled by then, but for the last millionth of the way to a fold

}  // namespace

StickFate uniform_stick_fate(const Scene& s) {
  const StickMotion motion(s);
  if (never_slips(s)) return {Fate::stuck, {}, 0};
  const StickFate strong = OrbitSearch(motion, 400)(after_rest(motion, long_rest));
  if (strong.fate == Fate::repeats || motion.dof() == 2) return strong;
  const StickFate weak = OrbitSearch(motion, 400)(after_rest(motion, short_rest));
  return weak.fate == Fate::repeats ? weak : strong;
}

namespace {

Grazing grazing_of(const StickMotion& m, const StickReturnMap& once) {
  Grazing found{std::isfinite(once.clearance) ? once.clearance : once.depth, once.period, false};
  if (found.distance > 0 && always_returns(m.scene())) found = {-std::abs(m.scene().v), 0, false};
  if (!(once.excess > found.distance)) return found;
  return {once.excess, once.period, true};
}

}  // namespace

Grazing distance_from_graze(const Scene& s, double tolerance) {
  if (never_slips(s)) return {std::nan(""), 0};
  if (always_returns(s) && !s.friction.back_slip) return {-std::abs(s.v), 0};
  StickMotion motion(s, tolerance);
  motion.stop_at_turns();
  motion.stop_slips_back();
  StickCycle c;
  c.side = s.v < 0 ? -1 : 1;
  c.start = after_rest(motion, long_rest);
  double from = std::nan(""),
         change = from;  // of the last round: the state it began with, and by how much it changed
  try {
    for (int round = 0; round < most_rounds; ++round) {
      StickReturnMapOptions wishes;
      wishes.turns = motion.dof() == 2;
      const StickReturnMap once = return_map_of(motion, c, wishes);
      const double now = once.at.u.back(), last = c.start.back();
      if (motion.dof() == 2) return grazing_of(motion, once);
      c.start = once.at.u;
      if (std::abs(now - last) < 10 * tolerance * (motion.state_scale() + std::abs(now))) {
        wishes.turns = true;
        return grazing_of(motion, return_map_of(motion, c, wishes));
      }
      // by the secant, where the map's slope is that of a cycle that attracts
      const double slope = 1 + (now - last - change) / (last - from),
                   limit = last + (now - last) / (1 - slope);
      const double far = 100 * (motion.state_scale() + std::abs(now));
      if (std::abs(slope) < 1 && std::abs(limit - now) < far) c.start.back() = limit;
      from = last;
      change = now - last;
    }
  } catch (const Failure&) {
  }
  return {std::abs(s.v), 0};
}

StickCycle polish(const Scene& scene, const StickCycle& near) { return polished(StickMotion(scene), near); }

double uniform_multiplier(const Scene& one_node, const StickCycle& cycle) {
  const StickMotion motion(one_node);
  const std::vector<double> map = monodromy_matrix(motion, cycle);
  double trace = 0;
  for (std::size_t k = 0; k < motion.size(); ++k) trace += map[k * motion.size() + k];
  return trace - 1;  // the phase has 1, psi, which a rest wipes out, 0
}

}  // namespace stickslip
