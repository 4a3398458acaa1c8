#include "stickslip/cycles/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <optional>

#include "base/pulse.hpp"
#include "cycles/settle.hpp"
#include "cycles/stick_motion.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

namespace {

constexpr long most_steps = 1000000;  // of the motion, over the nodes
// distance of psi from steady sliding over its size: there the linear answer holds
constexpr double near_sliding = 0.05;

// of two places of a motion, in eta, and psi and the state of friction over their sizes
constexpr double looks_equal = 1e-4;

// Places of a motion on its section, the last one first: releases of a node, beginnings of a period of the
// load.
class PastStates {
 public:
  // psi is every dof-th unknown, from the first on.
  explicit PastStates(std::size_t dof) : dof_(dof) {}

  void remember(const std::vector<double>& u) {
    seen_.push_front(u);
    if (seen_.size() > most_returns + 1) seen_.pop_back();
  }
  double largest_psi() const {
    double largest = 0;
    for (const std::vector<double>& u : seen_)
      for (std::size_t k = 0; k < u.size(); k += dof_) largest = std::max(largest, std::abs(u[k]));
    return largest;
  }
  // From the last to the one `back` before it.
  double apart(int back, double psi_size, double state_size) const {
    if (std::size_t(back) >= seen_.size()) return StickMotion::never;
    const std::vector<double>&now = seen_[0], &then = seen_[std::size_t(back)];
    double apart = 0;
    for (std::size_t k = 0; k < now.size(); ++k) {
      const double size = k % dof_ == 0 ? psi_size : k % dof_ == 1 ? 1 : state_size;
      apart = std::max(apart, std::abs(now[k] - then[k]) / size);
    }
    return apart;
  }

 private:
  std::size_t dof_;
  std::deque<std::vector<double>> seen_;
};

// A motion that is looked at where it passes a section, until it is known what becomes of it.
class Settling {
 public:
  using Cycle = StickCycle;

  std::optional<StickCycle> close(int back) {
    try {
      return cycle_near(m_, since(back));
    } catch (const Failure&) {
    }
    return std::nullopt;
  }
  double growth(const StickCycle& cycle) const { return growth_in_period(m_, cycle); }
  virtual double returned(int back) const = 0;

 protected:
  explicit Settling(const StickMotion& m, const std::vector<double>& start) : m_(m), p_{0, start, {}, {}, 0} {
    if (m.forced()) p_.u.push_back(0);
    m_.decide(p_);
  }
  virtual ~Settling() = default;
  virtual StickCycle since(int back) const = 0;
  bool end(Fate fate) {
    fate_ = {fate, {}, 0};
    ended_ = true;
    return false;
  }

  const StickMotion& m_;
  StickState p_;
  bool ended_ = false;
  StickFate fate_{Fate::wanders, {}, 0};
};

// With a plate that goes evenly: its releases.
class Releases : public Settling {
 public:
  Releases(const StickMotion& motion, const std::vector<double>& start, int patience)
      : Settling(motion, start), patience_(patience), mean_(motion.scene().averaged()),
        turn_(2 * M_PI / std::sqrt(mean_.A() * mean_.K0())) {
    const Scene& s = mean_;
    if (!std::isfinite(turn_)) turn_ = 2 * M_PI / std::sqrt(s.A() * s.K1());
    escape_ = escape_velocity(s);
    turn_ += (s.B() + std::abs(s.s_delta()) / s.A()) / s.K0();
    released_ = released_now(p_);
  }

  bool pass() {
    const auto turned = [this](double, int node, const double* u) {
      last_ = now_;
      now_ = u[node * m_.dof()];
      if (++turns_ == 1) first_ = now_;
    };
    const long most = most_steps / m_.nodes();
    while (!ended_ && p_.steps < most) {
      while (!changes_.empty()) {
        const Change c = changes_.front();
        changes_.pop_front();
        passed_ = c.before == 0 || c.after == 0 ? 0 : passed_ + 1;
        if (passed_ > patience_ || (passed_ > 1 && released_ && std::isinf(escape_)))
          return end(Fate::oscillates);
        released_ = released_ || (c.before == 0 && m_.size() == 2);
        if (c.before != 0) continue;
        here_ = c;
        at(c).remember(p_.u);
        return true;
      }
      beat("slips");
      const std::vector<Change> changes =
          m_.advance(p_, m_.all_rest(p_) ? m_.never : p_.t + turn_, nullptr, turned);
      if (p_.t == StickMotion::never) return end(Fate::stuck);
      if (size() > escape_) return end(Fate::grows);
      changes_.assign(changes.begin(), changes.end());
      if (!changes.empty()) {
        quiet_ = turns_ = 0;
      } else if (++quiet_ > patience_) {
        if (m_.free_nodes_rest(p_)) return end(Fate::waits);
        if (oscillates()) return end(Fate::oscillates);
        if (!leaves_sliding()) return end(Fate::slides);
      } else if (turns_ > 0 && m_.size() == 2) {
        return end(stable() ? Fate::slides : Fate::oscillates);
      } else if (turns_ > 1 && closing()) {
        return end(Fate::slides);
      }
    }
    return false;
  }
  double returned(int back) const override {
    return past().apart(back, std::max({1e-300, past().largest_psi(), std::abs(m_.scene().v)}),
                        m_.state_scale());
  }
  StickFate fate() const {
    StickFate result = fate_;
    result.time = result.fate == Fate::stuck ? 0 : p_.t;
    result.cycle.clearance = turns_ == 0 ? std::abs(m_.scene().v) : std::abs(first_);
    return result;
  }

 private:
  PastStates& at(const Change& c) {
    return seen_.try_emplace({c.node, c.after}, std::size_t(m_.dof())).first->second;
  }
  const PastStates& past() const { return seen_.at({here_.node, here_.after}); }
  StickCycle since(int back) const override {
    StickCycle near;
    near.start = p_.u;
    near.node = here_.node;
    near.side = here_.after;
    near.releases = back;
    return near;
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
  bool closing() const {
    const double v = m_.scene().v;
    return p_.direction.size() == 1 && std::abs(now_ - v) < near_sliding * std::abs(v) &&
           std::abs(now_ - v) < std::abs(last_ - v) && stable();
  }
  // |psi| to which a node swings at most, less what friction alone makes of eta.
  double size() const {
    double most = 0;
    for (int i = 0; i < m_.nodes() && std::isfinite(escape_); ++i) {
      const double* u = &p_.u[i * m_.dof()];
      const double force = std::max(0., std::abs(u[1]) - 4 * m_.threshold(i, p_.u.data()));
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
  bool oscillates() const {
    double most = 0;
    std::vector<double> f(m_.size());
    m_.rates(p_.direction, p_.u.data(), f.data());
    for (std::size_t i = 0; i < f.size(); i += std::size_t(m_.dof())) most = std::max(most, std::abs(f[i]));
    return most * turn_ > 1e-4 * m_.psi_scale();
  }

  // From sliding that is unstable, once.
  bool leaves_sliding() {
    if (pushed_) return false;
    std::vector<double> J(m_.size() * m_.size());
    m_.jacobian(p_.direction, p_.u.data(), J.data());
    const Eigenpair lead = leading_deviation(int(m_.size()), J);
    if (!(lead.value.real() * turn_ > no_growth)) return false;
    double most = 0;
    for (std::size_t k = 0; k < m_.size(); ++k)
      most = std::max(most, std::abs(lead.vector[k].real()) / (k % std::size_t(m_.dof()) == 0
                                                                   ? std::abs(m_.scene().v)
                                                                   : m_.scale(k)));
    for (std::size_t k = 0; k < m_.size(); ++k) p_.u[k] += push_off * lead.vector[k].real() / most;
    quiet_ = turns_ = 0;
    return pushed_ = true;
  }

  const int patience_;
  const Scene mean_;  // with the mean coefficients, for estimates
  double turn_;       // about the time of one
  double escape_;     // see escape_velocity()
  int quiet_ = 0, turns_ = 0;
  long passed_ = 0;  // passages of psi = 0 without a rest
  bool released_ = false, pushed_ = false;
  double first_ = 0, now_ = 0, last_ = 0;  // psi at turns without a stop, since the last change
  Change here_{};                          // the release
  std::deque<Change> changes_;             // made at one time, not looked at yet
  std::map<std::pair<int, double>, PastStates> seen_;  // releases of a node in a direction
};

// Under a load: beginnings of its periods.
class LoadPeriods : public Settling {
 public:
  LoadPeriods(const StickMotion& m, const std::vector<double>& start)
      : Settling(m, start), period_(m.scene().forcing_period()), escape_(escape_velocity(m.scene())),
        seen_(std::size_t(m.dof())) {}

  // The clock is set back.
  bool pass() {
    if (ended_) return false;
    bool changed = false;
    while (p_.t < period_) {
      beat("slips");
      if (!m_.advance(p_, period_).empty()) changed = true;
    }
    p_.t = p_.u.back() = 0;
    ++periods_;
    if (fastest() > escape_) return end(Fate::grows);
    quiet_ = changed ? 0 : quiet_ + 1;
    seen_.remember(p_.u);
    for (int back = 1; back <= most_returns && quiet_ > most_returns; ++back)
      if (seen_.apart(back, m_.psi_scale(), m_.state_scale()) < looks_equal)
        return end(m_.free_nodes_rest(p_) ? Fate::stuck : Fate::oscillates);
    return true;
  }
  double returned(int back) const override {
    return quiet_ > 0 ? StickMotion::never : seen_.apart(back, m_.psi_scale(), m_.state_scale());
  }
  StickFate fate() const {
    StickFate result = fate_;
    result.time = periods_ * period_;
    result.cycle.start = p_.u;
    return result;
  }

 private:
  double fastest() const {
    double most = 0;
    for (int i = 0; i < m_.nodes(); ++i) most = std::max(most, std::abs(p_.u[i * m_.dof()]));
    return most;
  }
  // The section: the middle of the longest time without a start or a stop.
  StickCycle since(int periods) const override {
    StickState p(p_);
    const double end = periods * period_;
    std::vector<double> times;
    while (p.t < end)
      if (!m_.advance(p, end).empty()) times.push_back(p.t);
    double longest = 0, middle = 0;
    for (std::size_t k = 0; k < times.size(); ++k) {
      const double next = k + 1 < times.size() ? times[k + 1] : times[0] + end;
      if (next - times[k] <= longest) continue;
      longest = next - times[k];
      middle = std::fmod(times[k] + longest / 2, end);
    }
    p = p_;
    while (p.t < middle) m_.advance(p, middle);
    StickCycle c;
    c.start = p.u;
    c.load = {periods, middle, {}};
    for (const double direction : p.direction) c.load.rests.push_back(direction == 0);
    return c;
  }

  double period_, escape_, periods_ = 0;
  int quiet_ = 0;    // periods without a start or a stop
  PastStates seen_;
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

namespace {

template <class Motion>
StickFate fate_of(Motion& motion, double passages) {
  Settled<StickCycle> settled = settle(motion, {passages, looks_equal, false});
  StickFate fate = motion.fate();
  if (settled.cycle) fate = {Fate::repeats, std::move(*settled.cycle), fate.time};
  return fate;
}

StickFate fate_of_releases(const StickMotion& motion, const std::vector<double>& start, int patience = 400) {
  Releases releases(motion, start, patience);
  return fate_of(releases, 50. * patience);
}

}  // namespace

StickFate stick_fate(const Scene& scene, const std::vector<double>& start, int patience) {
  return fate_of_releases(StickMotion(scene), start, patience);
}

StickFate forced_stick_fate(const Scene& scene, const std::vector<double>& start, int patience) {
  const StickMotion motion(scene);
  LoadPeriods periods(motion, start);
  const double turn = 2 * M_PI / scales_of(scene).rate;
  return fate_of(periods, patience * std::max(1., turn / scene.forcing_period()));
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
    if (!std::isfinite(u[2])) u[2] = law->steady_state(0);
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
  const StickFate strong = fate_of_releases(motion, after_rest(motion, long_rest));
  if (strong.fate == Fate::repeats || motion.dof() == 2) return strong;
  const StickFate weak = fate_of_releases(motion, after_rest(motion, short_rest));
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
