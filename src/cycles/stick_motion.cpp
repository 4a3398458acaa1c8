#include "cycles/stick_motion.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/pulse.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

using namespace stick_rule;

namespace {

constexpr double most_work = 1e6;     // between two changes, as steps of one node or of one deviation of it
constexpr double least_steps = 5000;  // that are allowed for all that
constexpr double round_off = 4e-16;   // relative, of a sum
constexpr double of_step = 1e-14;     // the same, of a step and its 36 evaluations
constexpr double evaluations_of_step = 36;
constexpr double longest_step =
    1.2;  // in units of one over the highest frequency: no change comes and goes twice within it

double fastest(const Scene& s) {
  if (s.medium.varies()) return wave_frequency(s);
  const double kappa2 = s.n > 1 ? largest_symbol(s.order, s.spacing()) : 0;
  return std::sqrt(s.A() * (s.K0() + s.K1() * kappa2));
}

}  // namespace

StickMotion::StickMotion(const Scene& scene, double tolerance)
    : scene_(scene), nodes_(int(scene.n)), dof_(scene.friction.has_state() ? 3 : 2),
      half_width_(scene.n == 1 ? 0 : scene.order / 2), tolerance_(tolerance), law_(scene, 0, scene.n),
      amplitude_(friction_amplitude(scene, 0, scene.n)), right_hand_side_(scene, 0, scene.n),
      point_(scene, 0), own_(coefficients_along(scene, 0, scene.n)), factors_(amplitude_.size()),
      method_(size()), method_with_deviations_(0) {
  if (!scene.friction.sticks())
    throw UsageError("friction_law " + to_string(scene.friction.law) +
                     " does not stick: its oscillation has no rests");
  for (int j = -half_width_; j < 0; ++j) halo_.push_back(halo_node(scene, j));
  for (int j = 0; j < half_width_; ++j) halo_.push_back(halo_node(scene, nodes_ + j));
  for (int i = 0; i < nodes_ && nodes_ > 1; ++i) d2_.push_back(row_over_mean(scene, i));
  const Scales scales = scales_of(scene).slip;
  for (std::size_t k = 0; k < size(); ++k) scales_.push_back(scales.of(int(k) % dof_));
  longest_ = longest_step / fastest(scene);
  if (forced()) scales_.back() = longest_;  // of the load's time
  if (scene.nu > 0 && nodes_ > 1) longest_ = std::min(longest_, longest_step / viscous_rate(scene));
  if (forced()) longest_ = std::min(longest_, longest_step * scene.smooth_time() / M_PI);
}

// Two solutions of s_t = g(s) that start close together: their distance goes like g.
double StickMotion::state_contraction(int node, double s0, double s1, double wait) const {
  const RatePartials g0 = law_[node].sliding_rate(0, s0, 0);
  const bool moves = std::abs(g0.g) > 1e-8 * (std::abs(s0) + state_scale()) / longest_;
  return moves ? law_[node].sliding_rate(0, s1, 0).g / g0.g : std::exp(g0.g_state * wait);
}

bool StickMotion::all_rest(const StickState& p) const {
  return std::all_of(p.direction.begin(), p.direction.end(), [](double d) { return d == 0; });
}

bool StickMotion::free_nodes_rest(const StickState& p) const {
  for (int i = 0; i < nodes_; ++i)
    if (!held(i) && p.direction[i] != 0) return false;
  return true;
}

// Nodes without friction slide through psi = 0: only what their state sees of psi turns there.
bool StickMotion::follow_frictionless(StickState& p) const {
  bool turned = false;
  for (int i = 0; i < nodes_; ++i) {
    const double side = p.u[i * dof_] < 0 ? -1 : 1;
    if (!never_rests(i) || p.direction[i] == side) continue;
    p.direction[i] = side;
    turned = true;
  }
  return turned;
}

// At psi = 0 a node beyond its threshold, or at it and gaining on it, begins to slip.
void StickMotion::decide(StickState& p) const {
  p.direction.assign(nodes_, 0.);
  for (int i = 0; i < nodes_; ++i) p.direction[i] = sign_of(p.u[i * dof_]);
  follow_frictionless(p);
  std::vector<double> f(size());
  rates(p.direction, p.u.data(), f.data());
  for (int i = 0; i < nodes_; ++i) {
    double& going = p.direction[i];
    if (held(i) || going != 0) continue;
    const double limit = threshold(i, p.u.data());
    for (const double side : {1., -1.}) {
      if (side < 0 && !scene_.friction.back_slip) continue;
      const PossibleChange c{i, side, true, false, false};
      const double excess = beyond(c, p.u.data()), by = neighbour_force(i, p.u.data());
      const double none =
          // what eta set to limit - neighbour force leaves of it
          by == 0 ? 0 : round_off * (limit + std::abs(by));
      if (begins(excess, limit, growth(c, p.u.data(), f.data()), none)) going = side;
    }
  }
  if (scene_.nu > 0) lift(p);
}

// What begins to slip does not begin backwards by the round-off of what its neighbours add.
void StickMotion::lift(StickState& p) const {
  std::vector<double> f(size());
  bool lifted = true;
  for (double step = round_off; lifted && step < close; step *= 2) {
    lifted = false;
    rates(p.direction, p.u.data(), f.data());
    for (int i = 0; i < nodes_; ++i) {
      const double side = p.direction[i];
      if (held(i) || side == 0 || p.u[i * dof_] != 0 || side * f[i * dof_] >= 0) continue;
      p.u[i * dof_ + 1] += side * step * threshold(i, p.u.data());
      lifted = true;
    }
  }
}

// How far a node is beyond its change, and how fast it goes there.
double StickMotion::beyond(const PossibleChange& c, const double* u) const {
  if (!c.rests) return -c.side * u[c.node * dof_];
  return c.side * (u[c.node * dof_ + 1] + neighbour_force(c.node, u)) - threshold(c.node, u);
}
double StickMotion::growth(const PossibleChange& c, const double* u, const double* f) const {
  if (!c.rests) return -c.side * f[c.node * dof_];
  const double own =
      threshold_rate(c.node, u) + (dof_ == 3 ? threshold_slope(c.node, u) * f[c.node * dof_ + 2] : 0);
  return c.side * (f[c.node * dof_ + 1] + neighbour_force(c.node, f)) - own;
}

// `into` becomes u after h, with `count` deviations behind it.
double StickMotion::step_from(const StickState& p, const double* f0, double h, std::size_t count,
                              double* into) const {
  work(evaluations_of_step * double(nodes_) * (1 + double(count)));
  const auto f = [&](const double* y, double* g) { derivative(p, y, count, g); };
  if (count == 0) return method_.step(f, p.u.data(), f0, h, size(), tolerance_, scales_.data(), into);
  std::vector<double> y(p.u), g0((count + 1) * size());
  y.insert(y.end(), p.deviations.begin(), p.deviations.end());
  f(y.data(), g0.data());
  method_with_deviations_ = Extrapolation(y.size());
  return method_with_deviations_.step(f, y.data(), g0.data(), h, size(), tolerance_, scales_.data(), into);
}

// Where the change of a candidate, or with `turning` the end of its growth, comes, between `low`, which lies
// before it, and `high`.
double StickMotion::locate(const StickState& p, const double* f0, const PossibleChange& c, double low,
                           double high, bool turning) const {
  std::vector<double> u(size()), f(size());
  const auto at = [&](double h) {
    step_from(p, f0, h, 0, u.data());
    if (!turning) return beyond(c, u.data());
    rates(p.direction, u.data(), f.data());
    return -growth(c, u.data(), f.data());
  };
  double below = low > 0 ? at(low) : turning ? -growth(c, p.u.data(), f0) : beyond(c, p.u.data());
  const double above = at(high);
  if (!turning && low == 0 && !(below < 0))  // begins at its change: the first place where it is before it
    for (low = high / 2; low > 1e-12 * high && !((below = at(low)) < 0);) low /= 2;
  if (!(below < 0)) return low;
  if (!turning) {  // Newton's method, from the end that is nearer
    double h = -below < above ? low : high;
    for (int k = 0; k < 12; ++k) {
      const double value = at(h);
      rates(p.direction, u.data(), f.data());
      const double change = -value / growth(c, u.data(), f.data());
      if (!(h + change > low && h + change <= high)) break;
      h += change;
      if (std::abs(change) < 1e-15 * high) return h;
    }
  }
  return find_root(at, {low, below, high, above}, 1e-16 * high);
}

// The first change within a step from p to y1, as a length of it (`h`: none), and the nodes that were looked
// at.
double StickMotion::first_change(const StickState& p, const double* f0, const double* y1, const double* f1,
                                 double h, std::vector<PossibleChange>& at, const Turned& turned) const {
  double first = h;
  at.clear();
  const auto examine = [&](PossibleChange c) {
    const double before = growth(c, p.u.data(), f0), behind = growth(c, y1, f1);
    // right at its start: psi_t against it is round-off
    const bool begins = !c.rests && beyond(c, p.u.data()) == 0;
    double until = h;
    c.to_come = beyond(c, y1) >= 0;
    if (!c.to_come && !begins && before > 0 && behind < 0) {  // it may have come and gone
      until = locate(p, f0, c, 0, h, true);
      std::vector<double> u(size());
      step_from(p, f0, until, 0, u.data());
      c.to_come = beyond(c, u.data()) >= 0;
      if (!c.to_come && !c.rests && turned) turned(p.t + until, c.node, u.data());
      c.turns = stops_at_turns_ && !c.to_come && !c.rests;
    }
    at.push_back(c);
    if (c.turns)
      first = std::min(first, until);
    else if (c.to_come)
      first = std::min(first, locate(p, f0, c, 0, until, false));
  };
  for (int i = 0; i < nodes_; ++i) {
    const double going = p.direction[i];
    if (held(i) || never_rests(i)) continue;
    if (going != 0) {
      examine({i, going, false, false, false});
      continue;
    }
    examine({i, 1, true, false, false});
    if (scene_.friction.back_slip) examine({i, -1, true, false, false});
  }
  return first;
}

void StickMotion::accept(StickState& p, const double* y, double h, const double* f0,
                         const Passed& passed) const {
  if (passed) passed(p.t, p.t + h, [&](double t, double* u) { step_from(p, f0, t - p.t, 0, u); });
  std::copy(y, y + size(), p.u.begin());
  std::copy(y + size(), y + (p.count + 1) * size(), p.deviations.begin());
  p.t += h;
}

// Nodes whose change has come get their psi or eta exactly, every psi first. h: the step that led here.
void StickMotion::snap(StickState& p, const std::vector<PossibleChange>& candidates, double h) const {
  std::vector<double> f(size());
  rates(p.direction, p.u.data(), f.data());
  std::vector<PossibleChange> reached, stopped;
  for (const PossibleChange& c : candidates) {
    const double speed = std::abs(growth(c, p.u.data(), f.data())), psi = p.u[c.node * dof_];
    const auto renew = [&] {
      if (!c.rests && law_[c.node].renewed_at_stops) p.u[c.node * dof_ + 2] = 0;
    };
    if (c.turns && speed * h < 1e-9 * (psi_scale() + std::abs(psi))) {
      stopped.push_back(c);
      renew();
    }
    const double lost = c.rests ? of_step * threshold(c.node, p.u.data()) : 1e-15 * psi_scale();
    if (!c.to_come || beyond(c, p.u.data()) < -std::max(close * h * speed, lost)) continue;
    renew();
    const bool back = stops_slips_back_ && !c.rests && c.side * scene_.v < 0;
    if (back)
      p.excess = std::max(p.excess, -c.side * (p.u[c.node * dof_ + 1] + neighbour_force(c.node, p.u.data())) -
                                        threshold(c.node, p.u.data()));
    (back ? stopped : reached).push_back(c);
  }
  for (const std::vector<PossibleChange>* list : {&stopped, &reached})
    for (const PossibleChange& c : *list)
      if (!c.rests) p.u[c.node * dof_] = 0;
  const auto eta = [&](int node) -> double& { return p.u[node * dof_ + 1]; };
  for (const PossibleChange& c : stopped) {
    const double most = (1 - 10 * close) * threshold(c.node, p.u.data()),
                 by = neighbour_force(c.node, p.u.data());
    eta(c.node) = std::clamp(eta(c.node) + by, -most, most) - by;
  }
  for (const PossibleChange& c : reached)
    if (c.rests) eta(c.node) = c.side * threshold(c.node, p.u.data()) - neighbour_force(c.node, p.u.data());
}

// The directions anew, and what becomes of deviations.
std::vector<Change> StickMotion::change(StickState& p) const {
  const std::vector<double> was = p.direction;
  decide(p);
  std::vector<Change> changes;
  std::vector<PetscInt> nodes;
  for (int i = 0; i < nodes_; ++i) {
    if (was[i] == p.direction[i] || never_rests(i)) continue;
    changes.push_back({p.t, i, was[i], p.direction[i]});
    nodes.push_back(i);
  }
  p.idling.at(p.t, nodes, 1e-14 * longest_);
  if (p.count > 0) pass_jumps(was, p);
  return changes;
}

void StickMotion::pass_jumps(const std::vector<double>& was, StickState& p) const {
  const std::vector<double> deviations(p.deviations);
  for (const Jump& jump : jumps(was, p)) {
    const int i = jump.change.node;
    for (std::size_t c = 0; c < p.count; ++c)
      jump.matrix.apply(&p.deviations[c * size() + std::size_t(i * dof_)],
                        jump.change.before == 0 ? neighbour_force(i, &deviations[c * size()]) : 0);
  }
}

std::vector<StickMotion::Jump> StickMotion::jumps(const std::vector<double>& was, const StickState& p) const {
  std::vector<double> before(size()), after(size());
  rates(was, p.u.data(), before.data());
  rates(p.direction, p.u.data(), after.data());
  std::vector<Jump> jumps;
  for (int i = 0; i < nodes_; ++i) {
    const double from = was[i], to = p.direction[i];
    if (from == to || never_rests(i)) continue;
    const double *b = &before[i * dof_], *a = &after[i * dof_];
    jumps.push_back({{p.t, i, from, to},
                     from == 0 ? JumpMatrix::at_start(
                                     dof_, to, threshold_slope(i, p.u.data()), b, a,
                                     neighbour_force(i, before.data()) - to * threshold_rate(i, p.u.data()))
                               : JumpMatrix::at_stop(dof_, b, a, law_[i].renewed_at_stops)});
  }
  const auto begins_to_slip = [&](int node) { return was[node] == 0 && p.direction[node] != 0; };
  for (const Jump& jump : jumps) {
    const int i = jump.change.node;
    if (scene_.nu == 0 || jumps.size() < 2 || !begins_to_slip(i) || after[i * dof_] == 0) continue;
    for (const auto& [other, weight] : d2_[i])
      if (other != i && begins_to_slip(int(other)))
        throw Failure(
            "exact stick: with viscosity between neighbours several nodes begin to slip at once with a jump "
            "in "
            "their "
            "acceleration: motions beside it do it one by one");
  }
  return jumps;
}

// While everything rests.
std::vector<Change> StickMotion::pass_rest(StickState& p, double until, const Passed& passed) const {
  std::vector<double> f(size());
  rates(p.direction, p.u.data(), f.data());
  double wait = never;
  for (int i = 0; i < nodes_; ++i) {
    if (held(i)) continue;
    for (const double side : {1., -1.}) {
      if (side < 0 && !scene_.friction.back_slip) continue;
      const double state = dof_ == 3 ? p.u[i * dof_ + 2] : 0;
      const RestingNode node{law_[i], amplitude_[i], side, p.u[i * dof_ + 1], state, f[i * dof_ + 1]};
      wait = std::min(wait, release(node, {}, wait).wait);
    }
  }
  const bool ends = p.t + wait > until;
  if (ends) wait = until - p.t;
  if (!std::isfinite(wait)) {
    p.t = never;
    return {};
  }
  const std::vector<double> start(p.u);
  const auto after = [&](double time, double* u) {
    for (int i = 0; i < nodes_; ++i) {
      for (int k = 0; k < 2; ++k) u[i * dof_ + k] = start[i * dof_ + k] + time * f[i * dof_ + k];
      if (dof_ == 3) u[i * dof_ + 2] = law_[i].state_at_rest(start[i * dof_ + 2], time);
    }
  };
  if (passed && wait > 0) passed(p.t, p.t + wait, [&](double t, double* u) { after(t - p.t, u); });
  after(wait, p.u.data());
  p.t += wait;
  for (int i = 0; i < nodes_; ++i) {
    if (dof_ == 3 && p.count > 0) {
      const std::size_t state = std::size_t(i * dof_ + 2);
      const double ratio = state_contraction(i, start[state], p.u[state], wait);
      for (std::size_t c = 0; c < p.count; ++c) p.deviations[c * size() + state] *= ratio;
    }
    if (ends || held(i)) continue;
    const double limit = threshold(i, p.u.data());
    double& eta = p.u[i * dof_ + 1];
    for (const double side : {1., -1.})
      if (std::abs(side * eta - limit) <= close * limit &&
          growth({i, side, true, true, false}, p.u.data(), f.data()) > 0)
        eta = side * limit;
  }
  if (ends) return {};
  return change(p);
}

long StickMotion::most_steps(std::size_t deviations) const {
  return std::lround(std::max(least_steps, most_work / (double(nodes_) * (1 + double(deviations)))));
}

std::vector<Change> StickMotion::advance(StickState& p, double until, const Passed& passed,
                                         const Turned& turned) const {
  std::vector<double> f0(size()), f1(size()), y1((p.count + 1) * size());
  std::vector<PossibleChange> candidates;
  rates(p.direction, p.u.data(), f0.data());
  double h = longest_ / 4;
  const long most = most_steps(p.count);
  for (long step = 0; p.t < until; ++step) {
    if (step > most) throw Failure("exact stick: no end of steps at t = " + number_text(p.t));
    if (all_rest(p) && !forced()) {
      std::vector<Change> changes = pass_rest(p, until, passed);
      if (!changes.empty() || p.t >= until) return changes;
      rates(p.direction, p.u.data(), f0.data());
      continue;  // all but at the threshold, by round-off
    }
    ++p.steps;
    h = std::min({h, longest_, until - p.t});
    const double error = step_from(p, f0.data(), h, p.count, y1.data()), next = Extrapolation::next(h, error);
    if (!(error <= 1)) {
      h = next;
      if (!(h > 1e-12 * longest_))
        throw Failure("exact stick: the motion cannot be integrated at t = " + number_text(p.t));
      continue;
    }
    rates(p.direction, y1.data(), f1.data());
    const double place = first_change(p, f0.data(), y1.data(), f1.data(), h, candidates, turned);
    const bool changes = std::any_of(candidates.begin(), candidates.end(),
                                     [](const PossibleChange& c) { return c.to_come || c.turns; });
    if (changes) {
      step_from(p, f0.data(), place, p.count, y1.data());
      accept(p, y1.data(), place, f0.data(), passed);
      snap(p, candidates, place);
      std::vector<Change> found = change(p);
      if (!found.empty()) return found;
      rates(p.direction, p.u.data(), f0.data());
      h = std::max(place, longest_ / 64);
      continue;
    }
    accept(p, y1.data(), h, f0.data(), passed);
    std::swap(f0, f1);
    if (follow_frictionless(p)) rates(p.direction, p.u.data(), f0.data());
    h = next;
  }
  return {};
}

double StickMotion::turn_beyond(const StickState& stopped, int node, double direction, double deepest) const {
  StickState p{stopped.t, stopped.u, stopped.direction, {}, 0};
  p.direction[node] = direction;
  const std::size_t at = std::size_t(node * dof_);
  const PossibleChange c{node, direction, false, false, false};
  std::vector<double> f0(size()), f1(size()), u1(size());
  rates(p.direction, p.u.data(), f0.data());
  long steps = 0;
  for (double h = longest_ / 4; direction * p.u[at] > deepest;) {
    if (++steps > most_steps(0)) return deepest;  // it does not turn
    h = std::min(h, longest_);
    const double error = step_from(p, f0.data(), h, 0, u1.data()), next = Extrapolation::next(h, error);
    if (!(error <= 1)) {
      if (!((h = next) > 1e-6 * longest_)) return deepest;
      continue;
    }
    rates(p.direction, u1.data(), f1.data());
    if (growth(c, u1.data(), f1.data()) <= 0) {
      if (growth(c, p.u.data(), f0.data()) <= 0) return direction * p.u[at];  // grazes
      step_from(p, f0.data(), locate(p, f0.data(), c, 0, h, true), 0, u1.data());
      return std::max(deepest, direction * u1[at]);
    }
    std::swap(p.u, u1);
    std::swap(f0, f1);
    h = next;
  }
  return deepest;
}

// What stands on the right-hand side of a motion with exact stick and of its deviations, thresholds included.

bool StickMotion::held(int node) const { return scene_.held(node); }

// Under a load of the plate alone N is 1.
double StickMotion::normal(const double* u) const {
  return scene_.normal.varies() ? scene_.normal(u[size() - 1]) : 1;
}
// The product in the order of rates(), so that a node at its threshold is there to the last bit.
double StickMotion::threshold(int node, const double* u) const {
  return normal(u) * amplitude_[node] * law_threshold(node, u);
}
double StickMotion::threshold_rate(int node, const double* u) const {
  if (!scene_.normal.varies()) return 0;
  return scene_.normal.slope(u[size() - 1]) * amplitude_[node] * law_threshold(node, u);
}
double StickMotion::law_threshold(int node, const double* u) const {
  return law_[node].threshold(dof_ == 3 ? u[node * dof_ + 2] : 0).value;
}
double StickMotion::threshold_slope(int node, const double* u) const {
  return dof_ == 2 ? 0 : normal(u) * amplitude_[node] * law_[node].threshold(u[node * dof_ + 2]).slope;
}
double StickMotion::neighbour_force(int node, const double* u) const {
  double sum = 0;
  if (d2_.empty() || scene_.nu == 0) return sum;
  for (const auto& [other, weight] : d2_[node])
    if (other != node) sum += weight * u[other * dof_];
  return scene_.N() * sum;
}

void StickMotion::rates(const std::vector<double>& direction, const double* u, double* f) const {
  std::array<double, 8> around{};
  for (std::size_t j = 0; j < halo_.size(); ++j)
    for (const auto& [node, weight] : halo_[j]) around[j] += weight * u[node * dof_];
  const double v = scene_.load.varies() ? scene_.load(u[size() - 1]) : scene_.v;
  if (forced()) f[size() - 1] = 1;
  const double* amplitude = scene_.unit_amplitude() ? nullptr : amplitude_.data();
  if (scene_.normal.varies()) {
    const double N = normal(u);
    std::transform(amplitude_.begin(), amplitude_.end(), factors_.begin(), [N](double a) { return N * a; });
    amplitude = factors_.data();
  }
  right_hand_side_.take(
      half_width_ > 0 ? Part::full : Part::pointwise, v,
      {u, amplitude, f, nodes_, around.data(), around.data() + half_width_, direction.data()});
  for (int i = 0; i < nodes_; ++i)
    if (held(i)) f[i * dof_] = f[i * dof_ + 1] = 0;  // its eta, which nothing feels, would drift
}

// J of each node alone.
void StickMotion::blocks(const std::vector<double>& direction, const double* u,
                         std::vector<NodeBlock>& at) const {
  at.resize(nodes_);
  const double N = normal(u);
  for (int i = 0; i < nodes_; ++i) {
    const double psi = u[i * dof_], s = dof_ == 3 ? u[i * dof_ + 2] : 0, going = direction[i];
    const double a = N * amplitude_[i];
    LinearPoint point = own_.empty() ? point_ : LinearPoint(scene_, own_[std::size_t(i)]);
    const Partials p = going == 0 ? Partials{0, 0, 0} : law_[i].sliding_partials(psi, s, going);
    point.set({a * p.F, a * p.F_psi, a * p.F_state}, law_[i].sliding_rate(psi, s, going));
    NodeBlock& block = at[i];
    block = going == 0 ? point.block_at_rest(Part::full) : point.block(Part::full);
    if (!held(i)) continue;
    block.psi_psi = block.psi_eta = block.psi_state = 0;
    block.eta_psi = block.eta_eta = block.eta_state = 0;
  }
}

// The right-hand side of the motion and of the first `count` deviations that stand behind it.
void StickMotion::derivative(const StickState& p, const double* y, std::size_t count, double* f) const {
  rates(p.direction, y, f);
  if (count == 0) return;
  std::vector<NodeBlock> at;
  blocks(p.direction, y, at);
  for (std::size_t c = 1; c <= count; ++c) {
    const double* x = y + c * size();
    double* g = f + c * size();
    if (forced()) g[size() - 1] = 0;
    for (int i = 0; i < nodes_; ++i) {
      const NodeBlock& b = at[i];
      const double *xi = x + i * dof_, s = dof_ == 3 ? xi[2] : 0;
      double* gi = g + i * dof_;
      gi[0] = b.psi_psi * xi[0] + b.psi_eta * xi[1] + b.psi_state * s;
      gi[1] = b.eta_psi * xi[0] + b.eta_eta * xi[1] + b.eta_state * s;
      if (dof_ == 3) gi[2] = b.state_psi * xi[0] + b.state_state * s;
      if (d2_.empty() || held(i)) continue;
      double coupling = 0;
      for (const auto& [node, weight] : d2_[i]) coupling += weight * x[node * dof_];
      gi[1] += point_.K1 * coupling;
      if (scene_.nu == 0 || p.direction[i] == 0) continue;
      gi[0] += point_.A * point_.N * coupling;
      gi[1] -= point_.s_delta * point_.N * coupling;
    }
  }
}

void StickMotion::jacobian(const std::vector<double>& direction, const double* u, double* J) const {
  std::fill(J, J + size() * size(), 0.);
  std::vector<NodeBlock> at;
  blocks(direction, u, at);
  const std::size_t dof = std::size_t(dof_);
  for (std::size_t i = 0; i < at.size(); ++i) {
    double rows[9];
    at[i].write(dof_, rows);
    for (std::size_t a = 0; a < dof; ++a)
      std::copy_n(rows + a * dof, dof, J + (i * dof + a) * size() + i * dof);
    if (d2_.empty() || held(int(i))) continue;
    const bool slides = direction[i] != 0;
    for (const auto& [node, weight] : d2_[i]) {
      J[(i * dof + 1) * size() + std::size_t(node) * dof] +=
          weight * (point_.K1 - (slides ? point_.s_delta * point_.N : 0));
      if (slides) J[i * dof * size() + std::size_t(node) * dof] += weight * point_.A * point_.N;
    }
  }
}

}  // namespace stickslip
