#include "time/clusters.hpp"

#include <algorithm>
#include <cmath>

#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/stick.hpp"

namespace stickslip {

using namespace stick_rule;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double shortest = 0.1, longest = 10, safety = 0.9;  // of a step, by the last one
constexpr PetscInt apart = 3;                                 // sliding nodes with two between them that rest

}  // namespace

// Unknowns and slopes stand in blocks, psi of all nodes and then eta, each with a place beyond both ends.
struct Clusters::Cluster {
  enum Block { now, next, stage, slopes };  // slopes: one each, and behind them that where a step was cut
  PetscInt first, count;
  std::size_t stride;  // of a column
  std::vector<double> blocks, direction, amplitude, limit;
  double t0 = 0, dt = 0;              // of the step under way, as it was tried
  double t1 = infinity, next_dt = 0;  // where it ends, and the next one's length
  bool begun = false, cut = false;    // the first slope is known; something starts or stops at t1
  std::int64_t number = 0;

  Cluster(PetscInt f, PetscInt c, int stages)
      : first(f), count(c), stride(std::size_t(c) + 2), blocks(2 * stride * (slopes + stages + 1)),
        direction(c), limit(c) {}
  double* block(int b) { return &blocks[2 * stride * b]; }
  const double* block(int b) const { return &blocks[2 * stride * b]; }
  double* psi(int b) { return block(b) + 1; }
  const double* psi(int b) const { return block(b) + 1; }
  double* eta(int b) { return block(b) + stride + 1; }
  const double* eta(int b) const { return block(b) + stride + 1; }
};

std::string Clusters::refusal(const Scene& s) {
  if (!Stick::applies_to(s)) return "friction does not stick exactly";
  if (s.friction.has_state()) return "friction has a state, which goes on at rest";
  if (s.nu != 0) return "neighbours have viscosity (model_nu)";
  if (s.load.varies() && !halts(s)) return "the plate's velocity varies (load_v, load_sine_amplitude)";
  if (s.any_held()) return "an end is held and moves all the time";
  if (s.order != 2) return "grid_order is not 2";
  if (s.n < 4) return "there are fewer than four nodes";
  return "";
}

Clusters::~Clusters() = default;

Clusters::Clusters(const Model& model, Vec u, double t, double atol, double rtol, Watcher* watcher,
                   Plate& plate)
    : model_(model), scene_(model.scene()), n_(scene_.n), ring_(scene_.ring()), halts_(halts(scene_)),
      both_sides_(scene_.friction.back_slip), atol_(atol), rtol_(rtol), plate_rate_(scene_.K0() * scene_.v),
      driving_(halts_ ? 0 : plate_rate_), method_(FusedMethod::of(TSRK)),
      coefficients_(kernel::coefficients_of(scene_)), stencil_(tile::stencil(scene_)),
      pointwise_(tile::pointwise(scene_, true, friction_places(scene_, 0, n_))),
      add_(kernel::compiled<std::function<void(const kernel::Terms&)>>(kernel::AddTerms{})),
      watcher_(watcher), plate_(plate), eta_(n_), since_(n_, t), release_(n_, infinity), psi_(n_),
      direction_(n_, 0), owner_(n_, -1), t_(t), first_dt_(0.1 / wave_frequency(scene_)) {
  method_->set_subtype(TSRK5DP);
  tableau_ = tableau_of(method_->library());
  for (int j = 0; j < tableau_.stages; ++j) error_weights_.push_back(tableau_.b[j] - tableau_.embedded[j]);
  const Reading a(u);
  for (PetscInt i = 0; i < n_; ++i) {
    limit_.push_back(model.amplitude()[i] * model.friction_law(i).threshold(0).value);
    psi_[i] = a[2 * i];
    eta_[i] = a[2 * i + 1];
    freed_.push_back(i);
  }
  if (halts_) {
    coefficients_.v = 0;  // while a cluster exists
    plate_.set(model, t, t, false);
  }
  regroup(t);
}

// ---- a step of one cluster ----

// psi beyond both ends of the cluster: of resting nodes, or of the end of the line or ring.
void Clusters::close_ends(const Cluster& c, double* psi) const {
  const PetscInt n = c.count;
  const bool round = ring_ && n == n_, chain = scene_.form == Form::chain;
  psi[-1] = round ? psi[n - 1] : !ring_ && c.first == 0 ? psi[chain ? 0 : 1] : 0;
  psi[n] = round ? psi[0] : !ring_ && c.first + n == n_ ? psi[chain ? n - 1 : n - 2] : 0;
}

// The right-hand side f of u, blocks of the cluster both.
void Clusters::take_slope(Cluster& c, double* u, double* f) {
  double *const psi = u + 1, *const eta = psi + c.stride, *const f_psi = f + 1,
                *const f_eta = f_psi + c.stride;
  close_ends(c, psi);
  stencil_(coefficients_, {psi, f_eta, c.count});
  for (PetscInt k = 0, end; k < c.count; k = end) {  // the nodes of a ring go on at its beginning
    const PetscInt i = node(c.first + k);
    end = std::min(c.count, k + n_ - i);
    pointwise_(coefficients_, {psi + k, eta + k, nullptr, c.amplitude.empty() ? nullptr : &c.amplitude[k],
                               f_psi + k, f_eta + k, nullptr, end - k, &c.direction[k], i});
  }
  ++evaluations_;
}

// base + factor sum_j weights[j] slope_j, over both columns.
void Clusters::sum(const Cluster& c, const double* base, const double* weights, int count, double factor,
                   double* into) const {
  constexpr int most_terms = 8;  // of rk:5dp there are seven
  const double* slopes[most_terms];
  double of_slopes[most_terms];
  int terms = 0;
  for (int j = 0; j < count; ++j) {
    if (weights[j] == 0) continue;
    slopes[terms] = c.block(Cluster::slopes + j);
    of_slopes[terms++] = factor * weights[j];
  }
  add_({base, slopes, of_slopes, terms, into, PetscInt(2 * c.stride)});
}

// Tries a step; its error over what is allowed.
double Clusters::attempt(Cluster& c, double dt) {
  const int stages = tableau_.stages;
  const std::size_t size = 2 * c.stride;
  const double* const u = c.block(Cluster::now);
  if (!c.begun) take_slope(c, c.block(Cluster::now), c.block(Cluster::slopes));
  c.begun = true;
  for (int i = 1; i < stages; ++i) {  // the last stage is the new u
    double* const y = c.block(i + 1 < stages ? Cluster::stage : Cluster::next);
    sum(c, u, &tableau_.A[i * stages], i, dt, y);
    take_slope(c, y, c.block(Cluster::slopes + i));
  }
  double *const error = c.block(Cluster::stage), largest = 0, not_finite = 0;
  const double* const next = c.block(Cluster::next);
  std::fill(error, error + size, 0.);
  sum(c, error, error_weights_.data(), stages, dt, error);
  for (const std::size_t column : {std::size_t(1), c.stride + 1})
    for (std::size_t k = column; k < column + std::size_t(c.count); ++k) {
      largest = std::max(largest,
                         std::abs(error[k]) / (atol_ + rtol_ * std::max(std::abs(u[k]), std::abs(next[k]))));
      not_finite += next[k] - next[k];
    }
  return not_finite == 0 ? largest : infinity;
}

// From t0 on, to where the cluster's nodes go on as they do or one starts or stops.
void Clusters::take(Cluster& c) {
  for (;;) {
    if (!(c.t0 + c.dt > c.t0))
      throw Failure("the step has shrunk to nothing at t = " + number_text(c.t0) + " (node " +
                    std::to_string(c.first) + "); loosen ts_rtol and ts_atol");
    const double error = attempt(c, c.dt);
    const double factor = std::clamp(safety * std::pow(error, -0.2), shortest, longest);
    if (!(error <= 1)) {
      c.dt *= std::isfinite(error) ? std::min(factor, safety) : shortest;
      ++rejections_;
      continue;
    }
    double part = 1;
    const Found found = find_change(c, c.dt, part);
    if (found == Found::too_coarse) {
      c.dt /= 8;
      ++rejections_;
      continue;
    }
    c.cut = found == Found::at;
    c.t1 = part == 1 ? c.t0 + c.dt : c.t0 + part * c.dt;
    c.next_dt = factor * c.dt;
    if (c.cut) c.next_dt = std::min(c.next_dt, c.dt);
    return;
  }
}

void Clusters::interpolate(const Cluster& c, double part, double* into) const {
  const std::vector<double> weights = method_->weights_at(part, c.dt);
  sum(c, c.block(Cluster::now), weights.data(), int(weights.size()), 1, into);
}

// The first start or stop within the step, where `next` is then, with the slope there behind the others.
Found Clusters::find_change(Cluster& c, double dt, double& part) {
  const int last = Cluster::slopes + tableau_.stages - 1;
  const double *const psi0 = c.psi(Cluster::now), *const psi1 = c.psi(Cluster::next);
  const double *const eta0 = c.eta(Cluster::now), *const eta1 = c.eta(Cluster::next);
  const double *const a0 = c.psi(Cluster::slopes), *const a1 = c.psi(last);
  const double *const r0 = c.eta(Cluster::slopes), *const r1 = c.eta(last);
  Candidates candidates{dt};
  for (PetscInt k = 0; k < c.count; ++k) {
    if (c.direction[k] != 0) {
      candidates.slides(k, c.direction[k], psi0[k], psi1[k], a0[k], a1[k]);
      continue;
    }
    for (const double side : {1., -1.})
      if (side > 0 || both_sides_)
        candidates.rests(k, side, side * eta0[k] - c.limit[k], side * eta1[k] - c.limit[k], side * r0[k],
                         side * r1[k], c.limit[k]);
  }
  if (candidates.reached == infinity) return Found::none;
  std::vector<double> weights;
  const auto furthest = [&](double at) {
    const bool at_end = at > 1 - close;  // which the polynomial misses by its error
    if (!at_end) weights = method_->weights_at(at, dt);
    double most = -infinity;
    for (const Candidate& one : candidates.list) {
      const std::size_t k = std::size_t(one.node) + 1 + (one.rests ? c.stride : 0);
      double value = c.block(at_end ? Cluster::next : Cluster::now)[k];
      for (std::size_t j = 0; j < weights.size() && !at_end; ++j)
        value += weights[j] * c.block(Cluster::slopes + int(j))[k];
      most = std::max(most, one.beyond(value, c.limit[one.node], at));
    }
    return most;
  };
  const auto any_fresh = [&](bool asked) {
    return asked && std::any_of(candidates.list.begin(), candidates.list.end(),
                                [](const Candidate& one) { return one.fresh; });
  };
  const Place place = locate(candidates.estimate, candidates.reached, furthest, any_fresh);
  if (place.found != Found::at) return place.found;
  part = place.part;
  if (!(part > 1 - close)) interpolate(c, part, c.block(Cluster::next));
  snap(c, candidates);
  take_slope(c, c.block(Cluster::next), c.block(last + 1));
  return Found::at;
}

// Nodes whose change has come, to round-off, get psi = 0 or their threshold exactly.
void Clusters::snap(Cluster& c, const Candidates& candidates) {
  double *const psi = c.psi(Cluster::next), *const eta = c.eta(Cluster::next);
  for (const Candidate& one : candidates.list) {
    const PetscInt k = one.node;
    if (one.beyond(one.rests ? eta[k] : psi[k], c.limit[k], 1) < -close) continue;
    if (one.rests)
      eta[k] = one.side * c.limit[k];
    else
      psi[k] = 0;
  }
  const double *const psi0 = c.psi(Cluster::now), *const eta0 = c.eta(Cluster::now);
  for (PetscInt k = 0; k < c.count; ++k) {
    if (c.direction[k] != 0) {
      if (stops(c.direction[k], psi0[k], psi[k])) psi[k] = 0;
      continue;
    }
    for (const double side : {1., -1.})
      if ((side > 0 || both_sides_) &&
          arrives(side * eta[k] - c.limit[k], side * eta0[k] - c.limit[k], c.limit[k]))
        eta[k] = side * c.limit[k];
  }
}

void Clusters::queue(std::size_t id) {
  Cluster& c = *clusters_[id];
  take(c);
  due_.push({c.t1, id, c.number = ++step_number_});
}

// ---- what has happened ----

void Clusters::show(Cluster& c, const double* u_end, const double* slope_end, double t) {
  ++steps_;
  node_steps_ += c.count;
  if (!watcher_) return;
  const auto at = [&](const double* u, const double* f) {
    return MovedNodes::End{u + 1, u + c.stride + 1, f + 1, f + c.stride + 1};
  };
  watcher_->step({c.t0, t, c.first, c.count, at(c.block(Cluster::now), c.block(Cluster::slopes)),
                  at(u_end, slope_end), c.direction.data()});
}

// The step of a cluster that lies behind all others counts.
void Clusters::commit(std::size_t id) {
  Cluster& c = *clusters_[id];
  const int last = Cluster::slopes + tableau_.stages - 1;
  show(c, c.block(Cluster::next), c.block(last + (c.cut ? 1 : 0)), c.t1);
  if (c.cut) {
    next_dt_ = c.next_dt;
    const double t = c.t1;
    dissolve(id, c.block(Cluster::next), t);
    regroup(t);
    return;
  }
  std::swap_ranges(c.block(Cluster::now), c.block(Cluster::now) + 2 * c.stride, c.block(Cluster::next));
  std::swap_ranges(c.block(Cluster::slopes), c.block(Cluster::slopes) + 2 * c.stride, c.block(last));
  c.t0 = c.t1;
  c.dt = c.next_dt;
  queue(id);
}

// Its nodes are free, with their u at t.
void Clusters::dissolve(std::size_t id, const double* u, double t) {
  const Cluster& c = *clusters_[id];
  for (PetscInt k = 0; k < c.count; ++k) {
    const PetscInt i = node(c.first + k);
    psi_[i] = u[1 + k];
    eta_[i] = u[c.stride + 1 + k];
    since_[i] = plate_time(t);
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
  std::vector<double> u(c.block(Cluster::now), c.block(Cluster::now) + 2 * c.stride);
  if (t > c.t0) {
    interpolate(c, (t - c.t0) / c.dt, u.data());
    for (PetscInt k = 0; k < c.count; ++k)  // the polynomial may end behind a stop, by round-off
      if (c.direction[k] * u[1 + k] < 0) u[1 + k] = 0;
    double* const slope = c.block(Cluster::slopes + tableau_.stages);
    take_slope(c, u.data(), slope);
    show(c, u.data(), slope, t);
  }
  dissolve(id, u.data(), t);
}

// ---- what rests ----

double Clusters::eta_at_rest(PetscInt i, double t) const {
  return eta_[i] + plate_rate_ * (plate_time(t) - since_[i]);
}

// When node i will begin to slide by itself, by the plate's clock.
double Clusters::release_time(PetscInt i) const {
  if (plate_rate_ == 0 || (plate_rate_ < 0 && !both_sides_)) return infinity;
  const double side = plate_rate_ > 0 ? 1 : -1;
  return since_[i] + std::max(0., (limit_[i] - side * eta_[i]) / std::abs(plate_rate_));
}

void Clusters::await_release(PetscInt i) {
  release_[i] = release_time(i);
  if (release_[i] < infinity) releases_.push({release_[i], i});
}

// By the clock of the run. A plate that halts goes on where no cluster is left.
double Clusters::next_release() const {
  if (releases_.empty() || (halts_ && alive_ > 0)) return infinity;
  return halts_ ? plate_.t + (releases_.top().t - plate_.time) : releases_.top().t;
}

// The nodes at rest that come to their thresholds now.
void Clusters::release_due() {
  const double t = releases_.top().t, now = next_release();
  if (halts_) plate_.set(model_, now, t, false);
  while (!releases_.empty()) {
    const auto [when, i] = releases_.top();
    if ((when - t) * std::abs(plate_rate_) > close * limit_[i]) break;
    releases_.pop();
    if (owner_[i] >= 0 || release_[i] != when) continue;
    eta_[i] = plate_rate_ > 0 ? limit_[i] : -limit_[i];
    since_[i] = t;
    freed_.push_back(i);
  }
  next_dt_ = first_dt_;
  driving_ = plate_rate_;  // which lets them go, and halts
  regroup(now);
  if (halts_) driving_ = 0;
}

// ---- which nodes are clusters ----

// psi beside node i; beyond the end of a line as the end says.
double Clusters::beside(PetscInt i, int side) const {
  const PetscInt j = i + side;
  if (j >= 0 && j < n_) return psi_[j];
  if (ring_) return psi_[j < 0 ? n_ - 1 : 0];
  return scene_.form == Form::chain ? psi_[i] : psi_[i - side];
}

// The rate of eta of a node at rest.
double Clusters::elastic_rate(PetscInt i) const {
  return driving_ + coefficients_.w[1] * (beside(i, -1) + beside(i, 1));
}

void Clusters::decide(PetscInt i) {
  const signed char was = direction_[i];
  direction_[i] = static_cast<signed char>(sign_of(psi_[i]));
  if (direction_[i] == 0)
    for (const int side : {1, -1})
      if ((side > 0 || both_sides_) && begins(side * eta_[i] - limit_[i], limit_[i], side * elastic_rate(i)))
        direction_[i] = static_cast<signed char>(side);
  if (direction_[i] != 0 && was == 0) starts_.push_back(i);
  if (direction_[i] == 0 && was != 0) stops_.push_back(i);
}

// Of the nodes that are free, and of clusters that they touch, clusters are formed anew.
void Clusters::regroup(double t) {
  if (t > last_change_) without_time_ = 0;
  if (++without_time_ > 1000 + 10 * std::int64_t(n_))
    throw Failure("nodes begin to slip and rest again without end at t = " + number_text(t));
  t_ = last_change_ = t;
  sliding_.clear();
  starts_.clear();
  stops_.clear();
  for (std::size_t k = 0; k < freed_.size(); ++k) {  // their number grows
    const PetscInt i = freed_[k];
    decide(i);
    if (direction_[i] == 0) continue;
    sliding_.push_back(i);
    for (const PetscInt j : {i - 1, i + 1}) {
      if (!ring_ && (j < 0 || j >= n_)) continue;
      const int other = owner_[node(j + (j < 0 ? n_ : 0))];
      if (other >= 0) cut_back(std::size_t(other), t);
    }
  }
  std::sort(sliding_.begin(), sliding_.end());
  form(t);
  for (const PetscInt i : freed_)
    if (owner_[i] < 0) await_release(i);
  freed_.clear();
  most_at_once_ = std::max(most_at_once_, alive_);
  if (halts_) plate_.set(model_, t, plate_.time, alive_ == 0);
  if (watcher_ && !(starts_.empty() && stops_.empty())) watcher_->change(t, starts_, stops_);
}

// From the sliding nodes, in order.
void Clusters::form(double t) {
  if (sliding_.empty()) return;
  struct Stretch {
    PetscInt first, last;
  };
  std::vector<Stretch> found;
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
    const PetscInt from = ring_ ? first - 1 : std::max(first - 1, PetscInt(0)),
                   to = ring_ ? last + 1 : std::min(last + 1, n_ - 1);
    gather(from < 0 ? from + n_ : from, to - from + 1, t);
  }
}

void Clusters::gather(PetscInt first, PetscInt count, double t) {
  auto made = std::make_unique<Cluster>(first, count, tableau_.stages);
  Cluster& c = *made;
  std::size_t id = clusters_.size();
  if (unused_.empty()) {
    clusters_.emplace_back();
  } else {
    id = unused_.back();
    unused_.pop_back();
  }
  for (PetscInt k = 0; k < count; ++k) {
    const PetscInt i = node(first + k);
    c.direction[k] = direction_[i];
    c.limit[k] = limit_[i];
    c.psi(Cluster::now)[k] = psi_[i];
    c.eta(Cluster::now)[k] = eta_at_rest(i, t);
    owner_[i] = int(id);
    if (!scene_.unit_amplitude()) c.amplitude.push_back(model_.amplitude()[i]);
  }
  c.t0 = t;
  c.dt = next_dt_ > 0 ? next_dt_ : first_dt_;
  clusters_[id] = std::move(made);
  ++alive_;
  queue(id);
}

// ---- a run ----

double Clusters::advance(double t, std::int64_t most_steps,
                         const std::function<bool(std::int64_t, double)>& go_on) {
  for (;;) {
    while (!due_.empty() &&
           (!clusters_[due_.top().cluster] || clusters_[due_.top().cluster]->number != due_.top().number))
      due_.pop();
    while (!releases_.empty() &&
           (owner_[releases_.top().node] >= 0 || release_[releases_.top().node] != releases_.top().t))
      releases_.pop();
    const double step = due_.empty() ? infinity : due_.top().t, release = next_release();
    if (end_with_plate(t)) return t_;
    if (std::min(step, release) > t) return t_ = t;
    if (steps_ >= most_steps || !go_on(steps_, t_)) return t_;
    t_ = std::max(t_, std::min(step, release));
    if (release <= step) {
      release_due();
    } else {
      const std::size_t id = due_.top().cluster;
      due_.pop();
      commit(id);
    }
  }
}

// Where the plate's clock comes to its last time before t and before anything else happens.
bool Clusters::end_with_plate(double t) {
  if (!halts_ || alive_ > 0 || (!releases_.empty() && releases_.top().t < plate_.end)) return false;
  const double end = plate_.t + (plate_.end - plate_.time);
  if (end > t) return false;
  plate_.set(model_, end, plate_.end, true);
  t_ = end;
  return plate_is_over_ = true;
}

void Clusters::solution(double t, Vec u) const {
  const Writing into(u);
  for (PetscInt i = 0; i < n_; ++i) {
    into[2 * i] = 0;
    into[2 * i + 1] = eta_at_rest(i, t);
  }
  std::vector<double> at;
  for (const auto& one : clusters_) {
    if (!one) continue;
    const Cluster& c = *one;
    at.resize(2 * c.stride);
    if (t > c.t0)
      interpolate(c, (t - c.t0) / c.dt, at.data());
    else
      std::copy(c.block(Cluster::now), c.block(Cluster::now) + 2 * c.stride, at.data());
    for (PetscInt k = 0; k < c.count; ++k) {
      const PetscInt i = node(c.first + k);
      into[2 * i] = at[1 + k];
      into[2 * i + 1] = at[c.stride + 1 + k];
    }
  }
}

}  // namespace stickslip
