#include "time/clusters.hpp"

#include <algorithm>
#include <cmath>

#include "model/stick_rule.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/time/stick.hpp"

namespace stickslip {

using namespace stick_rule;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr PetscInt at_a_time = 1024;                          // nodes
constexpr double not_there = 1e-9;                            // of a threshold: the time to look again
constexpr double shortest = 0.1, longest = 10, safety = 0.9;  // of a step, by the last one

}  // namespace

ClusterSteps::ClusterSteps(const Model& model, const Tolerances& tolerances)
    : model_(model), scene_(model.scene()), events_(model), dof_(model.dof()), reach_(scene_.order / 2),
      loaded_(scene_.load.varies() && !halts(scene_)),
      tolerances_(tolerances), unseen_(unseen_slip(model.wave_frequency())), N_(scene_.N()),
      K1_(scene_.mean_K1()), method_(TSRK, TSRK5DP), tableau_(method_.program()),
      coefficients_(kernel::coefficients_with(scene_, model.viscous() ? 1 : K1_)),
      links_(links_along(scene_, 0, scene_.n)), stencil_(stencil_loop(scene_, links_)),
      pointwise_(loop_for<PointwiseLoop>(scene_.friction, true, friction_places(scene_, 0, scene_.n))) {
  if (halts(scene_)) coefficients_.v = 0;  // as long as there is a cluster
  const std::vector<double> of_error = tableau_.error_of_f();
  for (int i = 0; i < tableau_.stages; ++i) {
    stage_sums_.emplace_back();
    for (int j = 0; j < i; ++j) stage_sums_.back().add(j, tableau_.A[i * tableau_.stages + j]);
    error_.add(i, of_error[i]);
    const double time = tableau_.time(i);
    stage_times_.push_back(is_no_weight(time - 1) ? 1 : time);
  }
  for (PetscInt j = 1; j <= reach_ && !scene_.ring(); ++j) {
    ends_[0].push_back(halo_node(scene_, -j));
    ends_[1].push_back(halo_node(scene_, scene_.n - 1 + j));
  }
}

std::unique_ptr<Cluster> ClusterSteps::make(PetscInt first, PetscInt count) const {
  auto made = std::make_unique<Cluster>(first, count, dof_, reach_, tableau_.stages);
  for (PetscInt k = 0; k < count; ++k) {
    const PetscInt i = node(*made, k);
    if (!scene_.unit_amplitude()) made->amplitude.push_back(model_.amplitude()[i]);
  }
  return made;
}

double ClusterSteps::beyond(const Cluster& c, const double* psi, const Combination& nodes) {
  double value = 0;
  for (const auto& [i, weight] : nodes)  // others rest
    if (i >= c.first && i < c.first + c.count) value += weight * psi[i - c.first];
  return value;
}

// psi beyond both ends of the cluster: of resting nodes, or of the end of the line or ring.
void ClusterSteps::close_ends(const Cluster& c, double* psi) const {
  const PetscInt n = c.count;
  const bool round = scene_.ring() && n == scene_.n, at_left = !scene_.ring() && c.first == 0,
             at_right = !scene_.ring() && c.first + n == scene_.n;
  for (PetscInt j = 1; j <= reach_; ++j) {
    psi[-j] = round ? psi[n - j] : at_left ? beyond(c, psi, ends_[0][j - 1]) : 0;
    psi[n - 1 + j] = round ? psi[j - 1] : at_right ? beyond(c, psi, ends_[1][j - 1]) : 0;
  }
}

void ClusterSteps::take_slope(Cluster& c, double t, double* u, double* f) {
  close_ends(c, u + c.place(0));
  slope_of(c, t, u, f, {0, c.count});
  ++evaluations;
}

// Of some nodes; what lies beyond the ends is known.
void ClusterSteps::slope_of(const Cluster& c, double t, double* u, double* f, Part nodes) {
  const auto from = std::size_t(nodes.begin), count = std::size_t(nodes.end - nodes.begin);
  const std::size_t psi = c.place(0) + from, eta = c.place(1) + from, state = c.place(dof_ - 1) + from;
  kernel::Coefficients coefficients = coefficients_;
  if (loaded_) coefficients.v = scene_.load.in_piece(scene_.load.piece_from(c.t0), t);
  if (links_.empty()) stencil_(coefficients, {u + psi, f + eta, PetscInt(count)});
  if (N_ > 0) d2_.resize(2 * count);
  for (PetscInt k = nodes.begin, end; k < nodes.end; k = end) {  // of a ring they go on at its beginning
    const PetscInt i = node(c, k), at = k - nodes.begin;
    end = std::min(nodes.end, k + scene_.n - i);
    if (!links_.empty()) stencil_(coefficients, {u + psi + at, f + eta + at, end - k, i});
    const kernel::Columns columns{u + psi + at, u + eta + at, dof_ == 3 ? u + state + at : nullptr,
                                  c.amplitude.empty() ? nullptr : &c.amplitude[k], f + eta + at,
                                  f + psi + at, f + eta + at, dof_ == 3 ? f + state + at : nullptr, end - k,
                                  &c.direction[k], i};
    if (N_ > 0)
      ViscousTerms{N_, K1_}(pointwise_, coefficients, columns, f + eta + at, d2_.data(), &d2_[count]);
    else
      pointwise_(coefficients, columns);
  }
  for (const PetscInt i : {PetscInt(0), scene_.n - 1}) {
    const PetscInt at = i - c.first - nodes.begin;
    if (!scene_.held(i) || at < 0 || at >= PetscInt(count)) continue;
    hold(scene_, f[psi + std::size_t(at)], f[eta + std::size_t(at)]);
  }
}

// base + factor times the sum, of all unknowns of some nodes.
void ClusterSteps::sum(const Cluster& c, const double* base, const SlopeSum& slopes, double factor,
                       double* into, Part nodes) const {
  const auto on = [&](std::size_t from, PetscInt count) {
    add_(base + from, slopes, factor, count, into + from,
         [&](int j) { return c.block(Cluster::slopes + j) + from; });
  };
  if (nodes.end - nodes.begin == c.count) return on(0, PetscInt(c.size));
  for (int d = 0; d < dof_; ++d) on(c.place(d) + std::size_t(nodes.begin), nodes.end - nodes.begin);
}

// Calls body for nodes from begin to end, which may lie beyond the ends of the cluster: one that goes round
// the ring goes on at its other end.
template <class Body>
void ClusterSteps::for_parts(const Cluster& c, PetscInt begin, PetscInt end, const Body& body) const {
  const PetscInt n = c.count;
  if (end - begin >= n) return body(Part{0, n});
  const bool round = scene_.ring() && n == scene_.n;
  if (round && begin < 0) body(Part{begin + n, n});
  body(Part{std::max(begin, PetscInt(0)), std::min(end, n)});
  if (round && end > n) body(Part{0, end - n});
}

// Tries a step; its error over what is allowed. Of many nodes some at a time go through all stages, in the
// cache, and those beside them that later stages look at go along (as in tiles.hpp).
double ClusterSteps::attempt(Cluster& c, double dt) {
  if (!c.begun) take_slope(c, c.t0, c.block(Cluster::now), c.block(Cluster::slopes));
  c.begun = true;
  double largest = 0;
  const PetscInt parts = (c.count + at_a_time - 1) / at_a_time, nodes = (c.count + parts - 1) / parts;
  for (PetscInt begin = 0; begin < c.count && largest < infinity; begin += nodes)
    largest = std::max(largest, attempt(c, dt, {begin, std::min(begin + nodes, c.count)}));
  evaluations += tableau_.stages - 1;
  return largest;
}

double ClusterSteps::attempt(Cluster& c, double dt, Part nodes) {
  const int stages = tableau_.stages;
  const double* const u = c.block(Cluster::now);
  for (int i = 1; i < stages; ++i) {  // the last stage is the new u
    double* const y = c.block(i + 1 < stages ? Cluster::stage : Cluster::next);
    const PetscInt beside = (stages - 1 - i) * reach_;
    for_parts(c, nodes.begin - beside - reach_, nodes.end + beside + reach_,
              [&](Part part) { sum(c, u, stage_sums_[i], dt, y, part); });
    close_ends(c, y + c.place(0));
    for_parts(c, nodes.begin - beside, nodes.end + beside, [&](Part part) {
      slope_of(c, c.t0 + stage_times_[i] * dt, y, c.block(Cluster::slopes + i), part);
    });
  }
  double *const error = c.block(Cluster::stage), largest = 0, not_finite = 0;
  const double* const next = c.block(Cluster::next);
  for (int d = 0; d < dof_; ++d) std::fill_n(error + c.place(d) + nodes.begin, nodes.end - nodes.begin, 0.);
  sum(c, error, error_, dt, error, nodes);
  for (int d = 0; d < dof_; ++d) {
    const double atol = tolerances_.absolute[d], rtol = tolerances_.relative[d];
    for (std::size_t k = c.place(d) + std::size_t(nodes.begin); k < c.place(d) + std::size_t(nodes.end);
         ++k) {
      largest = std::max(largest,
                         std::abs(error[k]) / (atol + rtol * std::max(std::abs(u[k]), std::abs(next[k]))));
      not_finite += next[k] - next[k];
    }
  }
  return not_finite == 0 ? largest : infinity;
}

void ClusterSteps::take(Cluster& c) {
  const double corner = loaded_ ? scene_.load.next_corner(c.t0) : infinity;
  c.dt = std::min(c.dt, longest_step);
  const bool shortened = c.t0 + c.dt >= corner;  // v(t) bends or jumps there
  c.tried = c.dt;
  if (shortened) c.dt = corner - c.t0;
  for (bool ends_at_corner = shortened;; ends_at_corner = false) {
    if (!(c.t0 + c.dt > c.t0))
      throw Failure("the step has shrunk to nothing at t = " + number_text(c.t0) + " (node " +
                    std::to_string(c.first) + "); loosen ts_rtol and ts_atol");
    const double error = attempt(c, c.dt);
    const double factor = std::clamp(safety * std::pow(error, -0.2), shortest, longest);
    if (!(error <= 1)) {
      c.dt *= std::isfinite(error) ? std::min(factor, safety) : shortest;
      ++rejections;
      continue;
    }
    double part = 1;
    const Found found = find_change(c, c.dt, part);
    if (found == Found::too_coarse) {
      c.dt /= 8;
      ++rejections;
      continue;
    }
    c.cut = found == Found::at;
    c.t1 = part != 1 ? c.t0 + part * c.dt : ends_at_corner ? corner : c.t0 + c.dt;
    c.next_dt = factor * c.dt;
    if (ends_at_corner) c.next_dt = std::max(c.next_dt, c.tried);
    if (c.cut) c.next_dt = std::min(c.next_dt, c.dt);
    return;
  }
}

void ClusterSteps::accept(Cluster& c) const {
  const int last = Cluster::slopes + tableau_.stages - 1;
  c.swap(Cluster::now, Cluster::next);
  c.swap(Cluster::slopes, last);
  // behind a corner the slope is another one
  c.begun = !loaded_ || scene_.load.piece_from(c.t1) == scene_.load.piece_from(c.t0);
  c.t0 = c.t1;
  c.dt = c.next_dt;
}

void ClusterSteps::interpolate(const Cluster& c, double part, double* into) const {
  SlopeSum slopes{{}, method_.weights_at(part, c.dt)};
  for (std::size_t j = 0; j < slopes.weights.size(); ++j) slopes.columns.push_back(int(j));
  sum(c, c.block(Cluster::now), slopes, 1, into, {0, c.count});
}

void ClusterSteps::at(const Cluster& c, double t, double* into) const {
  if (t > c.t0 && t < c.t1) return interpolate(c, (t - c.t0) / c.dt, into);
  const double* const u = c.block(t > c.t0 ? Cluster::next : Cluster::now);
  std::copy(u, u + c.size, into);
}

void ClusterSteps::node_at(const Cluster& c, PetscInt k, double t, double* u) const {
  const bool is_inside = t > c.t0 && t < c.t1;
  std::vector<double> weights;
  if (is_inside) weights = method_.weights_at((t - c.t0) / c.dt, c.dt);
  for (int d = 0; d < dof_; ++d) {
    u[d] = c.column(t > c.t0 && !is_inside ? Cluster::next : Cluster::now, d)[k];
    for (std::size_t j = 0; j < weights.size(); ++j)
      u[d] += weights[j] * c.column(Cluster::slopes + int(j), d)[k];
  }
}

// ---- where a node starts or stops ----

// Of each node the force that is held against its threshold, where `block` holds u, or its rate.
const double* ClusterSteps::forces(Cluster& c, int block, std::size_t number) {
  const double* const eta = c.column(block, 1);
  if (N_ == 0) return eta;
  viscous_force(c, c.block(block), forces_[number]);
  for (std::size_t k = 0; k < forces_[number].size(); ++k) forces_[number][k] += eta[k];
  return forces_[number].data();
}

void ClusterSteps::viscous_force(const Cluster& c, double* u, std::vector<double>& into) const {
  into.resize(std::size_t(c.count));
  close_ends(c, u + c.place(0));
  stencil_(coefficients_, {u + c.place(0), into.data(), c.count});
  for (double& force : into) force *= N_;
}

StridedNodes ClusterSteps::nodes(Cluster& c, int block, std::size_t number) {
  return {c.column(block, 0), forces(c, block, number), dof_ == 3 ? c.column(block, 2) : nullptr};
}

Furthest ClusterSteps::furthest(Cluster& c, const StepOfNodes& step, double part) {
  const bool at_end = part > 1 - close;  // which the polynomial misses by its error
  const int block = at_end ? Cluster::next : Cluster::stage;
  if (dof_ == 2 && N_ == 0) {  // of the candidates alone
    Furthest most;
    std::vector<double> weights;
    if (!at_end) weights = method_.weights_at(part, step.dt);
    for (const Candidate& one : candidates_.list) {
      const std::size_t k = std::size_t(one.node) + c.place(one.rests ? 1 : 0);
      double value = c.block(at_end ? Cluster::next : Cluster::now)[k];
      for (std::size_t j = 0; j < weights.size() && !at_end; ++j)
        value += weights[j] * c.block(Cluster::slopes + int(j))[k];
      most.take(one, one.beyond(value, events_.threshold(node(c, one.node), 0), part));
    }
    return most;
  }
  if (!at_end) interpolate(c, part, c.block(block));
  return events_.furthest(step, candidates_, nodes(c, block, 1), part);
}

// The first start or stop within the step, where `next` is then, with the slope there behind the others.
Found ClusterSteps::find_change(Cluster& c, double dt, double& part) {
  const int slope0 = Cluster::slopes, slope1 = Cluster::slopes + tableau_.stages - 1;
  StepOfNodes step{c.t0, dt, c.first, c.count, c.direction.data()};
  step.begin = nodes(c, Cluster::now, 0);
  step.end = nodes(c, Cluster::next, 1);
  step.begin_slope = nodes(c, slope0, 2);
  step.end_slope = nodes(c, slope1, 3);
  events_.find(step, candidates_);
  if (candidates_.reached == infinity) return Found::none;
  const Place place = locate(candidates_.estimate, candidates_.reached, unseen_ / dt,
                             [&](double at) { return furthest(c, step, at); });
  if (place.found != Found::at) return place.found;
  part = place.part;
  if (!(part > 1 - close)) interpolate(c, part, c.block(Cluster::next));
  const std::vector<NodeLimit> limits = events_.snap(step, candidates_, nodes(c, Cluster::next, 1),
                                                     c.column(Cluster::next, 0),
                                                     dof_ == 3 ? c.column(Cluster::next, 2) : nullptr, part);
  if (!limits.empty() && N_ > 0) viscous_force(c, c.block(Cluster::next), forces_[0]);
  for (const auto& [k, side] : limits) {
    const double limit = events_.threshold(node(c, k), dof_ == 3 ? c.column(Cluster::next, 2)[k] : 0);
    c.column(Cluster::next, 1)[k] =
        StickEvents::put_at(limit, side, N_ > 0 ? forces_[0][std::size_t(k)] : 0);
  }
  take_slope(c, c.t0 + part * dt, c.block(Cluster::next), cut_slope(c));
  return Found::at;
}

// ---- nodes that rest ----

RestingNodes::RestingNodes(const Model& model, const StickEvents& events)
    : model_(model), scene_(model.scene()), events_(events), dof_(model.dof()),
      loaded_(scene_.load.varies() && !halts(scene_)), v_(scene_.v), longest_(Stick::longest_rest(scene_)),
      eta_(scene_.n),
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

double RestingNodes::way(double t) const { return loaded_ ? scene_.load.integral(t) : v_ * t; }

double RestingNodes::eta(PetscInt i, double t) const {
  return eta_[i] + K0(i) * (loaded_ ? way(t) - way(since_[i]) : v_ * (t - since_[i]));
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
  const double since = since_[i],
               ahead = loaded_ ? std::min(longest_, scene_.load.next_corner(since) - since) : infinity;
  if (dof_ == 3 && ahead < infinity) {
    const LoadsFrom loads = events_.loads_from(since);
    const RestingNode node = events_.resting(i, direction, eta_[i], rate(i, since), state_[i], loads);
    return since + std::min(release(node, loads, ahead).wait, ahead);
  }
  if (dof_ == 3) {
    const RestingNode node{model_.friction_law(i), model_.amplitude()[i], direction, eta_[i], state_[i],
                           loaded_ ? rate(i, since) : K0(i) * v_};
    return since + release(node, {}, infinity).wait;
  }
  const double lacks = events_.threshold(i, 0) - force;
  if (!(K0(i) > 0)) return infinity;
  if (!loaded_) return since_[i] + std::max(0., lacks / std::abs(K0(i) * scene_.v));
  return direction * way(since_[i]) + lacks / K0(i);
}

void RestingNodes::set_plate(double t, bool goes) {
  if (dof_ == 2 || (v_ != 0) == (goes && scene_.v != 0)) return;
  const std::vector<bool> rested(rests_);
  for (PetscInt i = 0; i < scene_.n; ++i) {
    leaves(i);
    set(i, t, eta(i, t), state(i, t));
  }
  find_plate(goes);
  for (PetscInt i = 0; i < scene_.n; ++i)
    if (rested[std::size_t(i)]) rests(i);
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
      const double ahead = by_way() ? K0(i) * (key - side.direction * way(t))
                           : loaded_ || v_ == 0 ? limit - side.direction * eta(i, t)
                                                : std::abs(K0(i) * v_) * (key - t);
      // at once, to round-off, with the first of them
      if (key > (by_way() ? side.of : t) && ahead > stick_rule::close * limit) break;
      side.heap.pop();
      leaves(i);
      if (!by_way() && loaded_ && ahead > not_there * limit) {
        set(i, t, eta(i, t), s);
        rests(i);
        continue;
      }
      set(i, t, side.direction * limit, s);
      due.push_back(i);
    }
  }
  return due;
}

}  // namespace stickslip
