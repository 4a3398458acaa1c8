#include "model/stick_rule.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

using namespace stick_rule;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// How far the force is beyond the threshold, after a time x, and the rate at which it gains on it.
class Excess {
 public:
  Excess(const RestingNode& node, const LoadsFrom& loads) : node_(node), loads_(loads) {}

  ValueAndSlope operator()(double x) const {
    const bool has_state = node_.law.has_state;
    const double state = has_state ? node_.law.state_at_rest(node_.state, x) : 0;
    const WithSlope holds = node_.law.threshold(state);
    const double holds_rate = has_state ? holds.slope * node_.law.sliding_rate(0, state, 0).g : 0;
    const NormalLoad normal = loads_.normal(x);
    const double force =
        node_.force + x * (node_.rate + x * (node_.bend + x * node_.twist)) + node_.K0 * loads_.way(x);
    const double rate =
        node_.rate + x * (2 * node_.bend + x * 3 * node_.twist) + node_.K0 * loads_.velocity(x);
    return {x, node_.side * force - normal.N * node_.amplitude * holds.value,
            node_.side * rate - node_.amplitude * (normal.N * holds_rate + normal.rate * holds.value)};
  }

  // Round-off of the two.
  double tiny() const { return 4e-16 * loads_.normal(0).N * node_.amplitude * threshold(0); }
  // Without a load: no release from there on, since the force does not grow, and the threshold cannot fall so
  // far.
  bool never(const ValueAndSlope& from) const {
    const double falls = std::max(0., threshold(from.x) - node_.law.threshold_at_long_rest());
    return node_.side * node_.rate <= 0 && from.value + node_.amplitude * falls < 0;
  }

 private:
  double threshold(double x) const {
    return node_.law.threshold(node_.law.has_state ? node_.law.state_at_rest(node_.state, x) : 0).value;
  }

  const RestingNode& node_;
  const LoadsFrom& loads_;
};

}  // namespace

LoadsFrom::LoadsFrom(const Scene& scene, double t0) : scene_(&scene), t0_(t0) {
  if (scene.normal.varies()) normal_piece_ = scene.normal.piece_from(t0);
  if (!scene.load.varies()) return;
  plate_piece_ = scene.load.piece_from(t0);
  travelled_ = scene.load.integral(t0);
}
double LoadsFrom::velocity(double wait) const {
  return plate_piece_ < 0 ? 0 : scene_->load.in_piece(plate_piece_, t0_ + wait);
}
double LoadsFrom::way(double wait) const {
  return plate_piece_ < 0 ? 0 : scene_->load.integral(t0_ + wait) - travelled_;
}
NormalLoad LoadsFrom::normal(double wait) const {
  if (normal_piece_ < 0) return {};
  const Load& normal = scene_->normal;
  return {normal.in_piece(normal_piece_, t0_ + wait), normal.slope_in_piece(normal_piece_, t0_ + wait)};
}

void RestingNode::moves(const LoadsFrom& loads, double step, double force_then, double rate_then) {
  const HermiteCubic beside(0, force_then - force - K0 * loads.way(step), step * rate,
                            step * (rate_then - K0 * loads.velocity(step)));
  bend = beside.c2 / (step * step);
  twist = beside.c3 / (step * step * step);
}

LoadBounds::LoadBounds(const Scene& scene, const LoadsFrom& loads, double step)
    : loaded_(loads.vary()), smooth_(step <= loads.smooth_time()), step_(step) {
  if (!loaded_) return;
  // What is smooth lies beside a straight line by an eighth of the step times what its slopes at both ends
  // differ by, or a little more; anything by no more than its bounds say.
  const double way = loads.way(step);
  if (scene.load.varies()) {
    const double turns = smooth_ ? std::abs(loads.velocity(step) - loads.velocity(0)) : scene.load.largest();
    forth_ = std::max(way, 0.) + step / 2 * turns;
    back_ = std::max(-way, 0.) + step / 2 * turns;
  }
  if (!scene.normal.varies()) return;
  const NormalLoad now = loads.normal(0), then = loads.normal(step);
  const double least = std::min(now.N, then.N) - step / 2 * std::abs(then.rate - now.rate);
  falls_ = (smooth_ ? least : scene.normal.smallest()) / std::max(now.N, then.N);
}

// A cubic lies within the values of its Bezier form.
bool LoadBounds::out_of_reach(const RestingNode& n, double limit) const {
  const double along = n.side * step_, one = along * n.rate / 3, two = 2 * one + along * step_ * n.bend / 3,
               three = along * (n.rate + step_ * (n.bend + step_ * n.twist));
  const double beside = std::max({0., one, two, three}), plate = n.K0 * (n.side > 0 ? forth_ : back_);
  return n.side * n.force + beside + plate < falls_ * limit;
}

Release release(const RestingNode& node, const LoadsFrom& loads, double latest) {
  const double gain = node.side * node.rate;
  const bool stands = !node.law.has_state || node.law.time_at_rest(node.state) == infinity;
  if (!loads.vary() && stands) {
    const double lacks = node.amplitude * node.law.threshold(node.state).value - node.side * node.force;
    return gain > 0 ? Release{std::max(0., lacks / gain)} : Release();
  }
  const Excess excess(node, loads);
  // The threshold of a state that is forgotten, or that grows like a logarithm, changes ever more slowly.
  const double scale = stands ? infinity : node.law.time_at_rest(node.state) / 4;
  const double hopeless = loads.vary() || gain > 0 ? infinity : 4e6 * scale;
  for (ValueAndSlope begin = excess(0); begin.x < std::min(latest, hopeless);) {
    if (!loads.vary() && excess.never(begin)) break;
    const double width = std::min({loads.smooth_time(), std::max(scale, begin.x / 4), latest - begin.x});
    if (!std::isfinite(begin.x + width)) break;
    const ValueAndSlope end = excess(begin.x + width);
    const double wait = first_rise(excess, begin, end, excess.tiny());
    if (wait == infinity) {
      begin = end;
      continue;
    }
    Release found{wait, wait, excess(wait).slope};
    for (double next = wait; loads.vary() && next < latest;) {
      next = std::min(next + width / 8, latest);
      const bool gains = excess(next).slope > 0;
      if (!gains) next = last_place([&](double x) { return excess(x).slope > 0; }, found.gains_until, next);
      found.gains_until = next;
      if (!gains) break;
    }
    return found;
  }
  return {};
}

StickEvents::StickEvents(const Model& model)
    : model_(model), has_state_(model.dof() == 3), both_sides_(model.scene().friction.back_slip),
      loaded_(model.scene().forced() && !halts(model.scene())), free_end_(model.local()) {
  while (free_begin_ < free_end_ && model.held(model.first() + free_begin_)) ++free_begin_;
  while (free_end_ > free_begin_ && model.held(model.first() + free_end_ - 1)) --free_end_;
  for (PetscInt i = 0; i < model.local() && !has_state_; ++i)
    fixed_.push_back(model.friction_law(i).threshold(0).value);
}

WithSlope StickEvents::moving_threshold(PetscInt i, double state, const NormalLoad& normal) const {
  WithSlope law{has_state_ ? 0 : fixed_[std::size_t(i)], 0};
  if (has_state_) {
    const Friction& friction = model_.friction_law(i);
    law = friction.threshold(state);
    law.slope *= friction.sliding_rate(0, state, 0).g;
  }
  const double amplitude = model_.amplitude()[std::size_t(i)], by_load = normal.rate * amplitude * law.value;
  return {normal.N * amplitude * law.value, normal.N * amplitude * law.slope + by_load};
}

double StickEvents::start(double force, double force_rate, const WithSlope& limit, double none) const {
  double going = 0;
  for_each_side([&](double side) {
    const double excess = side * force - limit.value;
    if (begins(std::abs(excess) <= none ? 0 : excess, limit.value, side * force_rate - limit.slope))
      going = side;
  });
  return going;
}

RestingNode StickEvents::resting(PetscInt i, double side, double force, double rate, double state,
                                 const LoadsFrom& loads) const {
  RestingNode node{model_.friction_law(i), model_.amplitude()[std::size_t(i)], side, force, state, rate};
  if (!model_.scene().load.varies() || !loads.vary()) return node;
  node.K0 = model_.coefficients(i).K0;
  node.rate -= node.K0 * loads.velocity(0);
  return node;
}

void StickEvents::find(const StepOfNodes& step, Candidates& found) const {
  found.begin(step.dt);
  const NormalLoad normal0 = model_.normal_load(step.t), normal1 = model_.normal_load(step.t + step.dt);
  const LoadsFrom loads = loads_from(step.t);
  const LoadBounds bounds(model_.scene(), loads, step.dt);
  for (PetscInt k = 0; k < step.count; ++k) {
    const PetscInt i = model_node(step, k);
    if (!takes_part(i)) continue;
    if (step.direction[k] != 0) {
      found.slides(k, step.direction[k], step.begin.psi_of(k), step.end.psi_of(k), step.begin_slope.psi_of(k),
                   step.end_slope.psi_of(k));
      continue;
    }
    const double state0 = step.begin.state_of(k);
    const WithSlope limit0 = step.begin_limit ? step.begin_limit[k] : moving_threshold(i, state0, normal0),
                    limit1 = moving_threshold(i, step.end.state_of(k), normal1);
    if (step.end_limit) step.end_limit[k] = limit1;
    const double force0 = step.begin.force_of(k), force1 = step.end.force_of(k),
                 rate0 = step.begin_slope.force_of(k), rate1 = step.end_slope.force_of(k);
    for_each_side([&](double side) {
      const ValueAndSlope begin{0, side * force0 - limit0.value, side * rate0 - limit0.slope},
          end{step.dt, side * force1 - limit1.value, side * rate1 - limit1.slope};
      if (bounds.plain(begin, end)) return found.rests(k, side, begin, end, limit1.value);
      RestingNode node = resting(i, side, force0, rate0, state0, loads);
      node.moves(loads, step.dt, force1, rate1);
      if (!bounds.out_of_reach(node, std::min(limit0.value, limit1.value)))
        found.rests(k, side, begin, end, limit1.value, release(node, loads, step.dt));
    });
  }
}

Furthest StickEvents::furthest(const StepOfNodes& step, const Candidates& candidates,
                               const StridedNodes& there, double part) const {
  const NormalLoad normal = model_.normal_load(step.t + part * step.dt);
  Furthest most;
  for (const Candidate& c : candidates.list) {
    const PetscInt k = c.node;
    most.take(c, c.rests ? c.beyond(there.force_of(k),
                                    threshold(model_node(step, k), there.state_of(k), normal), part)
                         : c.beyond(there.psi_of(k), 0, part));
  }
  return most;
}

std::vector<NodeLimit> StickEvents::snap(const StepOfNodes& step, const Candidates& candidates,
                                         const StridedNodes& there, double* psi, double* state,
                                         double part) const {
  const NormalLoad normal0 = model_.normal_load(step.t),
                   normal = model_.normal_load(step.t + part * step.dt);
  const auto limit_of = [&](PetscInt k) {
    return threshold(model_node(step, k), there.state_of(k), normal);
  };
  const auto stop = [&](PetscInt k) {
    psi[k * there.stride] = 0;
    if (has_state_ && model_.friction_law(model_node(step, k)).renewed_at_stops) state[k * there.stride] = 0;
  };
  std::vector<NodeLimit> limits;
  for (const Candidate& c : candidates.list) {
    const PetscInt k = c.node;
    const double value = c.rests ? there.force_of(k) : there.psi_of(k);
    if (c.beyond(value, c.rests ? limit_of(k) : 0, 1) < -close) continue;
    if (c.rests)
      limits.push_back({k, c.side});
    else
      stop(k);
  }
  for (PetscInt k = 0; k < step.count; ++k) {
    const PetscInt i = model_node(step, k);
    if (!takes_part(i)) continue;
    double& here = psi[k * there.stride];
    if (step.direction[k] != 0) {
      if (stops(step.direction[k], step.begin.psi_of(k), here)) stop(k);
      continue;
    }
    here = 0;
    const double limit = limit_of(k), limit0 = threshold(i, step.begin.state_of(k), normal0);
    for_each_side([&](double side) {
      const double excess = side * there.force_of(k) - limit;
      if (arrives(excess, side * step.begin.force_of(k) - limit0, limit)) limits.push_back({k, side});
    });
  }
  return limits;
}

double StickEvents::put_at(double limit, double side, double besides) {
  double eta = side * limit - besides;
  for (double step = 1e-16 * limit; side * (eta + besides) < limit; step *= 2) eta += side * step;
  return eta;
}

}  // namespace stickslip
