#include "time/clusters.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/time/stick.hpp"

namespace stickslip {

using namespace stick_rule;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

std::string Clusters::refusal(const Scene& s) {
  if (!Stick::applies_to(s)) return "friction does not stick exactly";
  if (frictionless_somewhere(s))
    return "the friction amplitude is 0 at some nodes (friction_amplitude_profile), which never rest";
  if (s.normal.varies())
    return "the normal load varies (load_normal, load_normal_sine_amplitude), and with it when resting nodes "
           "begin to slip: steps of the whole medium take that";
  if (s.force.amplitude != 0)
    return "a harmonic force (load_force_sine_amplitude) acts on every node: steps of the whole medium take "
           "that";
  if (s.n < 2 * s.order) return "there are fewer than " + std::to_string(2 * s.order) + " nodes";
  return "";
}

Clusters::~Clusters() = default;

Clusters::Clusters(const Model& model, Plate& plate, const Tolerances& tolerances)
    : model_(model), scene_(model.scene()), plate_(plate), n_(scene_.n), reach_(scene_.order / 2),
      dof_(model.dof()), ring_(scene_.ring()), halts_(halts(scene_)),
      steps_(model, tolerances),
      resting_(model, steps_.events()), psi_(n_),
      direction_(n_, 0), owner_(n_, -1), coefficients_(kernel::coefficients_with(scene_, 1)),
      links_(links_along(scene_, 0, n_)), psi_rate_(model.viscous() ? n_ : 0),
      first_dt_(0.1 / wave_frequency(scene_)) {}

void Clusters::start(Vec u, double t) {
  if (halts_) plate_.set(model_, t, t, false);
  const Reading a(u);
  for (PetscInt i = 0; i < n_; ++i) {
    psi_[i] = a[dof_ * i];
    resting_.set(i, clock(t), a[dof_ * i + 1], dof_ == 3 ? a[dof_ * i + 2] : 0);
    freed_.push_back(i);
  }
  regroup(t);
}

// ---- what has happened ----

void Clusters::queue(std::size_t id) {
  Cluster& c = *clusters_[id];
  steps_.take(c);
  due_.push({c.t1, id, c.number = ++counts_.number});
}

void Clusters::count(const Cluster& c) {
  ++counts_.steps;
  counts_.node_steps += c.count;
}

void Clusters::show(Cluster& c, double* u_end, double* slope_end, double t) {
  if (!watcher_) return;
  double *const u = c.block(Cluster::now), *const slope = steps_.first_slope(c);
  const auto at = [&](const double* block, const double* f) {
    MovedNodes::End end = {block + c.place(0), block + c.place(1), f + c.place(0), f + c.place(1)};
    if (dof_ == 3) end.state = block + c.place(2);
    return end;
  };
  MovedNodes moved{c.t0, t, c.first, c.count, at(u, slope), at(u_end, slope_end), c.direction.data()};
  if (model_.viscous()) {
    double* const blocks[4] = {u, slope, u_end, slope_end};
    for (std::size_t k = 0; k < 4; ++k) steps_.viscous_force(c, blocks[k], viscous_[k]);
    moved.begin.viscous = viscous_[0].data();
    moved.begin.viscous_rate = viscous_[1].data();
    moved.end.viscous = viscous_[2].data();
    moved.end.viscous_rate = viscous_[3].data();
  }
  watcher_->step(moved);
}

// The step of a cluster that lies behind all others counts.
void Clusters::commit(std::size_t id) {
  Cluster& c = *clusters_[id];
  count(c);
  show(c, c.block(Cluster::next), steps_.last_slope(c), c.t1);
  if (c.cut) {
    next_dt_ = c.next_dt;
    const double t = c.t1;
    dissolve(id, c.block(Cluster::next), t);
    regroup(t);
    return;
  }
  steps_.accept(c);
  idling_.at(c.t0, {}, same_time());
  queue(id);
}

// Its nodes are free, with their u at t.
void Clusters::dissolve(std::size_t id, const double* u, double t) {
  const Cluster& c = *clusters_[id];
  for (PetscInt k = 0; k < c.count; ++k) {
    const PetscInt i = steps_.node(c, k);
    psi_[i] = u[c.place(0) + std::size_t(k)];
    resting_.set(i, clock(t), u[c.place(1) + std::size_t(k)], dof_ == 3 ? u[c.place(2) + std::size_t(k)] : 0);
    owner_[i] = -1;
    freed_.push_back(i);
  }
  clusters_[id].reset();
  unused_.push_back(id);
  --alive_;
}

// A cluster that lies ahead becomes part of another at t.
void Clusters::cut_back(std::size_t id, double t) {
  Cluster& c = *clusters_[id];
  next_dt_ = std::min(next_dt_, c.dt);
  std::vector<double> u(c.size);
  steps_.at(c, t, u.data());
  if (t > c.t0) {
    count(c);
    show_part(c, t, u);
  }
  dissolve(id, u.data(), t);
}

// Its step up to t, where its unknowns are u.
void Clusters::show_part(Cluster& c, double t, std::vector<double>& u) {
  for (PetscInt k = 0; k < c.count; ++k)  // the polynomial may end behind a stop, by round-off
    if (double& psi = u[c.place(0) + std::size_t(k)];
        c.direction[k] * psi < 0 && !scene_.held(steps_.node(c, k)))
      psi = 0;
  double* const slope = steps_.cut_slope(c);
  steps_.take_slope(c, t, u.data(), slope);
  show(c, u.data(), slope, t);
}

void Clusters::show_until(double t) {
  for (const auto& one : clusters_) {
    if (!one || !(t > one->t0)) continue;
    std::vector<double> u(one->size);
    steps_.at(*one, t, u.data());
    show_part(*one, t, u);
  }
}

// A plate that halts goes on where no cluster is left.
double Clusters::next_release() {
  if (!by_plate()) return resting_.next(t_);
  return alive_ > 0 ? infinity : plate_.t + (resting_.next(clock(t_)) - plate_.time);
}

// The nodes at rest that come to their thresholds now.
void Clusters::release_due(double t) {
  next_dt_ = first_dt_;
  releases_ = alive_ == 0;
  if (halts_) plate_.set(model_, t, by_plate() ? resting_.next(clock(t_)) : plate_.at(t), false);
  freed_ = resting_.take_due(clock(t));
  if (freed_.empty())
    idling_.at(t, {}, same_time());
  else
    regroup(t);
  releases_ = false;
}

// Where the plate's clock comes to its last time up to t and before anything else happens.
bool Clusters::end_with_plate(double t, double release) {
  plate_is_over_ = false;
  if (!halts_ || alive_ > 0) return false;
  const double end = plate_.t + (plate_.end - plate_.time);
  if (end > t || release < end) return false;
  plate_.set(model_, end, plate_.end, true);
  t_ = end;
  return plate_is_over_ = true;
}

// A held end lets never go.
void Clusters::await_release(PetscInt i) {
  if (!scene_.held(i)) resting_.rests(i);
}

// ---- which nodes are clusters ----

// Calls body(j) for the nodes that the stencil reaches from i, and i.
template <class Body>
void Clusters::for_reach(PetscInt i, const Body& body) const {
  for (PetscInt j = i - reach_; j <= i + reach_; ++j)
    if (ring_ || (j >= 0 && j < n_)) body(wrapped(j));
}

// So near a held end that stencils which look beyond it see this node.
bool Clusters::seen_beyond(End end, PetscInt from_end) const {
  return end == End::velocity && from_end < (scene_.form == Form::chain ? 1 : scene_.order);
}

// Whether the stencil of node i looks at a held end that moves, or at what stands for the nodes beyond it.
// Where the plate halts no end moves.
bool Clusters::anchored(PetscInt i) const {
  return !halts_ && (seen_beyond(scene_.left, i) || seen_beyond(scene_.right, n_ - 1 - i));
}

// D2 at node i; nothing beyond the stencil's reach moves.
double Clusters::second_difference(PetscInt i, const std::vector<double>& of) const {
  const kernel::Coefficients& c = coefficients_;
  double value = c.w[0] * of[i];
  for (PetscInt j = 1; j <= reach_; ++j)
    for (const PetscInt at : {i - j, i + j}) {
      if (ring_ || (at >= 0 && at < n_)) {
        value += c.w[j] * of[wrapped(at)];
      } else {
        for (const auto& [inside, weight] : halo_node(scene_, at)) value += c.w[j] * weight * of[inside];
      }
    }
  return value;
}

// The rate of eta of a node, psi = 0, by its neighbours.
double Clusters::elastic_rate(PetscInt i) const {
  if (links_.empty()) return scene_.K1() * second_difference(i, psi_);
  const auto beside = [&](PetscInt at) {
    if (ring_ || (at >= 0 && at < n_)) return psi_[wrapped(at)];
    double value = 0;
    for (const auto& [inside, weight] : halo_node(scene_, at)) value += weight * psi_[inside];
    return value;
  };
  const double around[3] = {beside(i - 1), psi_[i], beside(i + 1)};
  return kernel::link_sum(&links_[std::size_t(i)], around + 1);
}

// The force that is held against the threshold of a free node.
double Clusters::force(PetscInt i) const {
  const double eta = resting_.last_eta(i);
  return model_.viscous() ? eta + scene_.N() * second_difference(i, psi_) : eta;
}

// Its rate, of a node at rest.
double Clusters::force_rate(PetscInt i) const {
  const double driving = halts_ && !releases_ ? 0 : resting_.rate(i, t_);
  const double rate = driving + elastic_rate(i);
  if (!model_.viscous()) return rate;
  const PetscInt order = scene_.order;
  for (PetscInt k = i - order; k <= i + order; ++k) {
    if (!ring_ && (k < 0 || k >= n_)) continue;
    const PetscInt j = wrapped(k);
    const double going = sign_of(psi_[j]);
    psi_rate_[j] = 0;
    if (going == 0 || scene_.held(j)) continue;
    const Partials law = model_.friction_law(j).sliding_partials(psi_[j], resting_.last_state(j), going);
    psi_rate_[j] = scene_.A() * (force(j) - scene_.B() * psi_[j] - model_.amplitude()[j] * law.F);
  }
  return rate + scene_.N() * second_difference(i, psi_rate_);
}

void Clusters::decide(PetscInt i) {
  const signed char was = direction_[i];
  direction_[i] = static_cast<signed char>(sign_of(psi_[i]));
  if (direction_[i] == 0 && !scene_.held(i)) {
    const WithSlope limit = steps_.events().moving_threshold(i, resting_.last_state(i));
    // the sum over neighbours was taken in another order where the force was made the threshold
    const double none = model_.viscous() ? close * limit.value : 0;
    direction_[i] = static_cast<signed char>(steps_.events().start(force(i), force_rate(i), limit, none));
  }
  if (direction_[i] != 0 && was == 0) starts_.push_back(i);
  if (direction_[i] == 0 && was != 0) stops_.push_back(i);
}

// Of the nodes that are free, and of clusters that they touch, clusters are formed anew.
void Clusters::regroup(double t) {
  t_ = t;
  sliding_.clear();
  starts_.clear();
  stops_.clear();
  for (std::size_t k = 0; k < freed_.size(); ++k) {  // their number grows
    const PetscInt i = freed_[k];
    decide(i);
    if (direction_[i] == 0 && !anchored(i)) continue;
    sliding_.push_back(i);
    for_reach(i, [&](PetscInt j) {
      if (owner_[j] >= 0) cut_back(std::size_t(owner_[j]), t);
    });
  }
  std::sort(sliding_.begin(), sliding_.end());
  form(t);
  for (const PetscInt i : freed_)
    if (owner_[i] < 0) await_release(i);
  freed_.clear();
  if (halts_) {
    plate_.set(model_, t, plate_.time, alive_ == 0);
    resting_.set_plate(t, alive_ == 0);
  }
  std::vector<PetscInt> changed(starts_);
  changed.insert(changed.end(), stops_.begin(), stops_.end());
  idling_.at(t, changed, same_time());  // where a signal has come `go_on` hears it
  counts_.most_at_once = std::max(counts_.most_at_once, alive_);
  if (watcher_ && !(starts_.empty() && stops_.empty())) watcher_->change(t, starts_, stops_);
}

// From the sliding nodes, in order.
void Clusters::form(double t) {
  if (sliding_.empty()) return;
  struct Extent {
    PetscInt first, last;
  };
  const PetscInt apart = 2 * reach_ + 1;  // sliding nodes of clusters that do not feel each other
  std::vector<Extent> found;
  for (const PetscInt i : sliding_)
    if (!found.empty() && i - found.back().last < apart)
      found.back().last = i;
    else
      found.push_back({i, i});
  if (ring_ && found.front().first + n_ - found.back().last < apart) {
    if (found.size() == 1) return gather(found.front().first, n_, t);
    found.back().last = found.front().last + n_;
    found.erase(found.begin());
  }
  for (const auto& [first, last] : found) {
    PetscInt from = first - reach_, to = last + reach_;
    if (!ring_) {
      from = seen_beyond(scene_.left, first) ? 0 : std::max(from, PetscInt(0));
      to = seen_beyond(scene_.right, n_ - 1 - last) ? n_ - 1 : std::min(to, n_ - 1);
    }
    gather(from < 0 ? from + n_ : from, to - from + 1, t);
  }
}

void Clusters::gather(PetscInt first, PetscInt count, double t) {
  std::unique_ptr<Cluster> made = steps_.make(first, count);
  Cluster& c = *made;
  const std::size_t id = add(std::move(made));
  for (PetscInt k = 0; k < count; ++k) {
    const PetscInt i = steps_.node(c, k);
    c.direction[k] = direction_[i];
    c.column(Cluster::now, 0)[k] = psi_[i];
    c.column(Cluster::now, 1)[k] = resting_.eta(i, clock(t));
    if (dof_ == 3) c.column(Cluster::now, 2)[k] = resting_.state(i, t);
    psi_[i] = 0;
    owner_[i] = int(id);
    resting_.leaves(i);
  }
  c.t0 = t;
  c.dt = next_dt_ > 0 ? next_dt_ : first_dt_;
  queue(id);
}

std::size_t Clusters::add(std::unique_ptr<Cluster> cluster) {
  std::size_t id = clusters_.size();
  if (unused_.empty()) {
    clusters_.emplace_back();
  } else {
    id = unused_.back();
    unused_.pop_back();
  }
  clusters_[id] = std::move(cluster);
  ++alive_;
  return id;
}

// ---- a run ----

double Clusters::advance(double t, std::int64_t most_steps,
                         const std::function<bool(std::int64_t, double)>& go_on) {
  for (;;) {
    while (!due_.empty() &&
           (!clusters_[due_.top().cluster] || clusters_[due_.top().cluster]->number != due_.top().number))
      due_.pop();
    const double step = due_.empty() ? infinity : due_.top().t, release = next_release();
    if (end_with_plate(t, release)) return t_;
    if (std::min(step, release) > t) return t_ = t;
    if (counts_.steps >= most_steps || !go_on(counts_.steps, t_)) return t_;
    t_ = std::max(t_, std::min(step, release));
    if (release <= step) {
      release_due(t_);
    } else {
      const std::size_t id = due_.top().cluster;
      due_.pop();
      commit(id);
    }
  }
}

template <class Body>
void Clusters::each_at(double t, const Body& body) const {
  std::vector<double> at;
  for (const auto& one : clusters_) {
    if (!one) continue;
    at.resize(one->size);
    steps_.at(*one, t, at.data());
    body(*one, at.data());
  }
}

void Clusters::solution(double t, Vec u) const {
  const Writing into(u);
  for (PetscInt i = 0; i < n_; ++i) {
    if (owner_[i] >= 0) continue;
    into[dof_ * i] = 0;
    into[dof_ * i + 1] = resting_.eta(i, clock(t));
    if (dof_ == 3) into[dof_ * i + 2] = resting_.state(i, t);
  }
  each_at(t, [&](const Cluster& c, const double* at) {
    for (PetscInt k = 0; k < c.count; ++k)
      for (int d = 0; d < dof_; ++d) into[dof_ * steps_.node(c, k) + d] = at[c.place(d) + std::size_t(k)];
  });
}

MediumNow::Totals Clusters::totals(double t) const {
  Totals all;
  if (resting_.count() > 0) all.psi_min = all.psi_max = 0;
  each_at(t, [&](const Cluster& c, const double* at) {
    const double *const psi = at + c.place(0), *const eta = at + c.place(1);
    for (PetscInt k = 0; k < c.count; ++k) {
      all.psi_min = std::min(all.psi_min, psi[k]);
      all.psi_max = std::max(all.psi_max, psi[k]);
      all.psi_sum += psi[k];
      all.eta_sum += eta[k];
    }
  });
  for (const PetscInt i : freed_) {  // on the way from a cluster to another
    if (owner_[i] >= 0) continue;
    all.psi_min = std::min(all.psi_min, psi_[i]);
    all.psi_max = std::max(all.psi_max, psi_[i]);
    all.psi_sum += psi_[i];
    all.eta_sum += resting_.eta(i, clock(t));
  }
  for (const PetscInt i : {PetscInt(0), n_ - 1})  // under a plate that halts a held end may belong to none
    if (scene_.held(i) && owner_[i] < 0) all.eta_sum += resting_.eta(i, clock(t));
  all.eta_sum += resting_.eta_sum(clock(t));
  return all;
}

void Clusters::node(PetscInt i, double t, double* u) const {
  if (owner_[i] >= 0) {
    const Cluster& c = *clusters_[std::size_t(owner_[i])];
    return steps_.node_at(c, i >= c.first ? i - c.first : i + n_ - c.first, t, u);
  }
  u[0] = psi_[i];
  u[1] = resting_.eta(i, clock(t));
  if (dof_ == 3) u[2] = resting_.state(i, t);
}

// ---- from a checkpoint ----

std::vector<Clusters::Kept> Clusters::kept() const {
  std::vector<Kept> list;
  for (std::size_t place = 0; place < clusters_.size(); ++place) {
    if (!clusters_[place]) continue;
    const Cluster& c = *clusters_[place];
    list.push_back({place, c.first, c.count, c.t0, c.tried, c.number,
                    std::vector<double>(c.block(Cluster::now), c.block(Cluster::now) + c.size), c.direction});
  }
  return list;
}

void Clusters::resume(const std::vector<Kept>& clusters) {
  if (halts_ && !by_plate()) resting_.find_plate(plate_.goes);
  for (const Kept& kept : clusters) {
    if (kept.first < 0 || kept.first >= n_ || kept.count < 1 || kept.count > n_ ||
        kept.place >= clusters_.size())
      throw std::runtime_error("its clusters do not fit");
    std::unique_ptr<Cluster> made = steps_.make(kept.first, kept.count);
    Cluster& c = *made;
    if (kept.u.size() != c.size) throw std::runtime_error("its clusters do not fit");
    std::copy(kept.u.begin(), kept.u.end(), c.block(Cluster::now));
    c.direction = kept.direction;
    c.t0 = kept.t0;
    c.dt = kept.tried;
    const std::size_t id = kept.place;
    clusters_[id] = std::move(made);
    ++alive_;
    for (PetscInt k = 0; k < c.count; ++k) {
      const PetscInt i = steps_.node(c, k);
      owner_[i] = int(id);
      direction_[i] = static_cast<signed char>(c.direction[k]);
    }
    steps_.take(c);
    due_.push({c.t1, id, c.number = kept.number});
  }
  for (PetscInt i = 0; i < n_; ++i)
    if (owner_[i] < 0 && !scene_.held(i)) resting_.goes_on_resting(i);
  if (halts_) plate_.set(model_, plate_.t, plate_.time, plate_.goes);
}

}  // namespace stickslip
