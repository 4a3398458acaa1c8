#include "time/clusters.hpp"

#include <algorithm>
#include <cmath>

#include "model/stick_rule.hpp"
#include "numerics/first_rise.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/time/stick.hpp"

namespace stickslip {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

RestingNodes::RestingNodes(const Model& model, const StickEvents& events)
    : model_(model), scene_(model.scene()), events_(events), dof_(model.dof()),
      loaded_(scene_.load.varies() && !halts(scene_)), longest_(Stick::longest_rest(scene_)), eta_(scene_.n),
      since_(scene_.n), state_(dof_ == 3 ? scene_.n : 0), rests_(scene_.n, false) {
  for (PetscInt i = 0; i < (scene_.medium.nodes_differ() ? scene_.n : 1); ++i)
    K0_.push_back(scene_.coefficients(i).K0);
  // without a load nothing but a state that falls lets go against the plate's direction
  const bool one_way = dof_ == 2 && !loaded_;
  for (const double direction : {1., -1.}) {
    if (direction < 0 && !scene_.friction.back_slip) continue;
    if (one_way && !(direction * scene_.v * *std::max_element(K0_.begin(), K0_.end()) > 0)) continue;
    sides_.push_back({direction, std::vector<double>(std::size_t(scene_.n), infinity)});
    sides_.back().heap.set_most(std::size_t(scene_.n) * 9 / 8 + 64);
  }
}

double RestingNodes::way(double t) const { return loaded_ ? scene_.load.integral(t) : scene_.v * t; }

double RestingNodes::eta(PetscInt i, double t) const {
  return eta_[i] + K0(i) * (loaded_ ? way(t) - way(since_[i]) : scene_.v * (t - since_[i]));
}
double RestingNodes::state(PetscInt i, double t) const {
  return dof_ == 2 ? 0 : model_.friction_law(i).state_at_rest(state_[i], t - since_[i]);
}
double RestingNodes::rate(PetscInt i, double t) const {
  return K0(i) * (loaded_ ? scene_.load(t) : scene_.v);
}

void RestingNodes::set(PetscInt i, double t, double eta, double state) {
  eta_[i] = eta;
  since_[i] = t;
  if (dof_ == 3) state_[i] = state;
}

double RestingNodes::key(PetscInt i, double direction) const {
  const double force = direction * eta_[i];
  if (dof_ == 3) {
    const RestingNode node{model_.friction_law(i), model_.amplitude()[i], direction, eta_[i], state_[i],
                           K0(i) * scene_.v};
    return since_[i] + release(node, {}, infinity).wait;
  }
  const double lacks = events_.threshold(i, 0) - force;
  if (!(K0(i) > 0)) return infinity;
  if (!loaded_) return since_[i] + std::max(0., lacks / std::abs(K0(i) * scene_.v));
  return direction * way(since_[i]) + lacks / K0(i);
}

// Neumaier's sum.
void RestingNodes::Sum::add(double term) {
  const double sum = rounded + term;
  lost += std::abs(rounded) >= std::abs(term) ? (rounded - sum) + term : (term - sum) + rounded;
  rounded = sum;
}

void RestingNodes::add(PetscInt i, int times) {
  offsets_.add(times * (eta_[i] - K0(i) * way(since_[i])));
  growths_.add(times * K0(i));
  ++added_;
}

void RestingNodes::form_sums() {
  offsets_ = growths_ = {};
  for (PetscInt i = 0; i < scene_.n; ++i)
    if (rests_[i]) add(i, 1);
  added_ = 0;
}

double RestingNodes::eta_sum(double t) const { return offsets_.value() + growths_.value() * way(t); }

void RestingNodes::leaves(PetscInt i) {
  if (!rests_[i]) return;
  rests_[i] = false;
  --count_;
  add(i, -1);
  if (added_ > 4 * std::int64_t(scene_.n) + 1000) form_sums();
}

void RestingNodes::rests(PetscInt i) {
  add(i, 1);
  for (Side& side : sides_) side.key[i] = key(i, side.direction);
  goes_on_resting(i);
}

void RestingNodes::goes_on_resting(PetscInt i) {
  rests_[i] = true;
  ++count_;
  for (Side& side : sides_) {
    if (side.key[i] == infinity) continue;
    if (side.heap.size() >= side.heap.most) side.heap.drop([&](const Release& r) { return holds(side, r); });
    side.heap.push({side.key[i], i});
  }
}

// The first time from `from` on, if there is one up to `until`, at which the plate's displacement, times the
// direction, is at least `level` and grows. Looked for in pieces in which the loads are smooth.
double RestingNodes::passage(double direction, double level, double from, double until) const {
  const Load& load = scene_.load;
  for (double begin = from; begin < until;) {
    const int piece = load.piece_from(begin);
    const auto gained = [&](double t) {
      return ValueAndSlope{t, direction * load.integral(t) - level, direction * load.in_piece(piece, t)};
    };
    double end = std::min(begin + load.smooth_time() / 4, load.next_corner(begin));
    if (!std::isfinite(end)) {  // v is constant from here on
      const ValueAndSlope now = gained(begin);
      if (!(now.slope > 0)) return infinity;
      end = std::nextafter(begin + 1.01 * std::abs(now.value) / now.slope, infinity);
    }
    const double first = first_rise(gained, gained(begin), gained(end), 1e-16 * std::abs(level));
    if (first < infinity) return first;
    begin = end;
  }
  return infinity;
}

void RestingNodes::drop_old(Side& side) const {
  while (!side.heap.empty() && !holds(side, side.heap.top())) side.heap.pop();
}

double RestingNodes::next(double t) {
  double first = infinity;
  for (Side& side : sides_) {
    drop_old(side);
    if (side.heap.empty()) continue;
    const double key = side.heap.top().key;
    if (!by_way()) {
      first = std::min(first, key);
      continue;
    }
    if (side.of != key || (side.time == infinity && t >= side.asked_until)) {
      side.of = key;
      side.asked_until = t + longest_;
      side.time = passage(side.direction, key, t, side.asked_until);
    }
    first = std::min(first, std::min(side.time, side.asked_until));
  }
  return std::max(first, t);
}

std::vector<PetscInt> RestingNodes::take_due(double t) {
  std::vector<PetscInt> due;
  for (Side& side : sides_) {
    if (by_way() && !(side.time <= t)) continue;
    for (drop_old(side); !side.heap.empty(); drop_old(side)) {
      const auto [key, i] = side.heap.top();
      const double s = state(i, t), limit = events_.threshold(i, s);
      const double ahead =
          by_way() ? K0(i) * (key - side.direction * way(t)) : std::abs(rate(i, t)) * (key - t);
      // at once, to round-off, with the first of them
      if (key > (by_way() ? side.of : t) && ahead > stick_rule::close * limit) break;
      side.heap.pop();
      leaves(i);
      set(i, t, side.direction * limit, s);
      due.push_back(i);
    }
  }
  return due;
}

}  // namespace stickslip
