#include "model/stick_rule.hpp"

#include <algorithm>
#include <cmath>

#include "numerics/first_rise.hpp"
#include "numerics/hermite.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

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
  if (!loads.vary() && !node.law.has_state) {
    const double lacks = node.amplitude * node.law.threshold(0).value - node.side * node.force;
    return gain > 0 ? Release{std::max(0., lacks / gain)} : Release();
  }
  const Excess excess(node, loads);
  // The threshold of a state that is forgotten, or that grows like a logarithm, changes ever more slowly.
  const double scale = node.law.has_state ? node.law.time_at_rest(node.state) / 4 : infinity;
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

}  // namespace stickslip
