#include "stickslip/output/events.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "model/loops.hpp"
#include "output/lanes.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/model.hpp"

namespace stickslip {

namespace {

constexpr std::size_t side_by_side = 128;  // nodes that vector code takes at a time
constexpr std::size_t few = 4;             // for fewer it does not pay

// A step of nodes side by side: psi and friction at its beginning, in its middle and at its end.
struct StepOfNodes {
  const double *p0, *p, *p1, *F0, *F, *F1;
  double dt;
  double *slip, *slipped;
  std::size_t count;
};
struct StepSums {
  double work, squares, ends;  // of psi F and of psi^2 by Simpson's rule over dt/6; of psi^2 at the end
};
struct AddStep {
  StepSums operator()(const StepOfNodes& s) const {
    Lanes work(0), squares(0), ends(0);
    const double *const p0 = s.p0, *const p = s.p, *const p1 = s.p1, *const F0 = s.F0, *const F = s.F, *const F1 = s.F1;
    double *const slip = s.slip, *const slipped = s.slipped;
    const double part = s.dt / 6;
    in_lanes(PetscInt(s.count), [&](PetscInt i, int k) {
      const double step = part * (p0[i] + 4 * p[i] + p1[i]);
      slip[i] += step;
      slipped[i] += step;
      work.of[k] += p0[i] * F0[i] + 4 * p[i] * F[i] + p1[i] * F1[i];
      squares.of[k] += p0[i] * p0[i] + 4 * p[i] * p[i] + p1[i] * p1[i];
      ends.of[k] += p1[i] * p1[i];
    });
    return {work.sum(), squares.sum(), ends.sum()};
  }
};

// psi in the middle of a step, on the cubic through values and slopes at its ends.
struct MiddleOfNodes {
  const double *p0, *p1, *eta0, *eta1, *F0, *F1;
  double A, B, dt;
  double* p;
  std::size_t count;
};
struct FindMiddle {
  void operator()(const MiddleOfNodes& s) const {
    const MiddleOfNodes m = s;
#pragma GCC ivdep
    for (std::size_t k = 0; k < m.count; ++k) {
      const double m0 = m.A * (m.eta0[k] - m.B * m.p0[k] - m.F0[k]), m1 = m.A * (m.eta1[k] - m.B * m.p1[k] - m.F1[k]);
      m.p[k] = (m.p0[k] + m.p1[k]) / 2 + m.dt / 8 * (m0 - m1);
    }
  }
};

// 1 for nodes that move at either end of a step, else 0.
struct MovingNodes {
  const double *p0, *p1;
  double velocity;
  unsigned char* moves;
  std::size_t count;
};
struct MarkMoving {
  void operator()(const MovingNodes& s) const {
    const MovingNodes m = s;
#pragma GCC ivdep
    for (std::size_t i = 0; i < m.count; ++i)
      m.moves[i] = (std::abs(m.p0[i]) > m.velocity) | (std::abs(m.p1[i]) > m.velocity);
  }
};

const std::function<StepSums(const StepOfNodes&)>& add_step() {
  static const auto loop = kernel::compiled<std::function<StepSums(const StepOfNodes&)>>(AddStep{});
  return loop;
}
const std::function<void(const MiddleOfNodes&)>& find_middle() {
  static const auto loop = kernel::compiled<std::function<void(const MiddleOfNodes&)>>(FindMiddle{});
  return loop;
}
const std::function<void(const MovingNodes&)>& mark_moving() {
  static const auto loop = kernel::compiled<std::function<void(const MovingNodes&)>>(MarkMoving{});
  return loop;
}

}  // namespace

Events::Events(const Scene& scene, double velocity)
    : scene_(scene), velocity_(velocity), weight_(scene.form == Form::chain ? 1 : scene.h()),
      damping_(scene.B() + scene.s_delta() / scene.A()), amplitude_(friction_amplitude(scene, 0, scene.n)),
      friction_(scene, 0, scene.n), forces_(force_loop(scene.friction, positions(scene, 0, scene.friction.varies() ? scene.n : 0))),
      A_(scene.A()), B_(scene.B()), owner_(static_cast<std::size_t>(scene.n), -1), slip_(owner_.size()),
      slipped_(owner_.size()), last_force_(owner_.size()), moving_(owner_.size(), 0),
      moved_(owner_.size(), 0) {
  for (PetscInt i = 0; i < scene.n && scene.N() > 0; ++i) {
    d2_.push_back(second_difference_row(scene, i));
    for (auto& term : d2_.back()) term.second *= scene.N();
  }
}

bool Events::moves(std::size_t i, const std::vector<std::vector<double>>& fields) const {
  return std::abs(fields[0][i]) > velocity_;
}

// The owner of the neighbour on one side (step 1 or -1), -1 where there is none.
int Events::owner_beside(std::size_t i, int step) const {
  const auto n = static_cast<PetscInt>(owner_.size());
  PetscInt j = static_cast<PetscInt>(i) + step;
  if (scene_.ring()) j = (j + n) % n;
  return j < 0 || j >= n ? -1 : owner_[static_cast<std::size_t>(j)];
}

// A node that begins to move: it joins the event beside it, or begins one. `now`: all nodes at the beginning of this
// step, once somebody has asked for it.
void Events::claim(std::size_t i, std::shared_ptr<const Before>& now) {
  const int left = owner_beside(i, -1), right = owner_beside(i, 1);
  int id = std::max(left, right);
  if (id < 0) {
    id = next_id_++;
    if (!now) now = std::make_shared<const Before>(Before{last_[1], slipped_});
    Live& live = live_[id];
    live.event.begin = t_;
    live.event.first = static_cast<PetscInt>(i);
    live.before = now;
  }
  owner_[i] = id;
  live_.at(id).nodes.push_back(static_cast<PetscInt>(i));
  slip_[i] = 0;
  join(id, left);
  join(id, right);
}

void Events::join(int kept, int taken) {
  if (taken < 0 || kept == taken) return;
  Live &a = live_.at(kept), &b = live_.at(taken);
  for (const PetscInt node : b.nodes) owner_[static_cast<std::size_t>(node)] = kept;
  a.nodes.insert(a.nodes.end(), b.nodes.begin(), b.nodes.end());
  if (b.event.begin < a.event.begin) {
    a.event.begin = b.event.begin;
    a.event.first = b.event.first;
    a.before = b.before;
  }
  a.event.friction_work += b.event.friction_work;
  a.event.radiated += b.event.radiated;
  a.event.kinetic = std::max(a.event.kinetic, b.event.kinetic);
  live_.erase(taken);
}

// Friction of a node; at psi = 0 it is that of the motion in `direction` which begins or ends there.
double Events::force(std::size_t i, double psi, double state, double direction) const {
  return amplitude_[i] *
         friction_[PetscInt(i)].force(psi == 0 ? direction * std::numeric_limits<double>::min() : psi, state);
}

// psi in the middle of a step, on the cubic through values and slopes at its ends, where neighbours have viscosity.
double Events::middle(std::size_t i, double dt, const std::vector<std::vector<double>>& now) const {
  const double p0 = last_[0][i], p1 = now[0][i], direction = p0 + p1 < 0 ? -1 : 1;
  const bool has_state = last_.size() > 2;
  double m0 = A_ * (last_[1][i] - B_ * p0 - force(i, p0, has_state ? last_[2][i] : 0, direction));
  double m1 = A_ * (now[1][i] - B_ * p1 - force(i, p1, has_state ? now[2][i] : 0, direction));
  m0 += A_ * viscous_[0][i];
  m1 += A_ * viscous_[2][i];
  return (p0 + p1) / 2 + dt / 8 * (m0 - m1);
}

void Events::find_viscous_forces(double dt, const std::vector<std::vector<double>>& now) {
  const auto find = [&](const std::vector<double>& psi, std::vector<double>& into) {
    into.assign(psi.size(), 0.);
    for (std::size_t i = 0; i < psi.size(); ++i)
      for (const auto& [j, weight] : d2_[i]) into[i] += weight * psi[static_cast<std::size_t>(j)];
  };
  find(last_[0], viscous_[0]);
  find(now[0], viscous_[2]);
  std::vector<double> psi(last_[0].size());
  for (std::size_t i = 0; i < psi.size(); ++i)
    psi[i] = moves(i, last_) || moves(i, now) ? middle(i, dt, now) : (last_[0][i] + now[0][i]) / 2;
  find(psi, viscous_[1]);
}

// One node. What friction was at the end of the last step, if the node moved in it, is known, unless it went by the
// direction.
void Events::accumulate(std::size_t i, Live& live, double dt, const std::vector<std::vector<double>>& now) {
  const double p0 = last_[0][i], p1 = now[0][i];
  const bool has_state = last_.size() > 2;
  const double s0 = has_state ? last_[2][i] : 0, s1 = has_state ? now[2][i] : 0;
  const double direction = p0 + p1 < 0 ? -1 : 1;
  const double F0 = p0 != 0 && moved_[i] ? last_force_[i] : force(i, p0, s0, direction), F1 = force(i, p1, s1, direction);
  last_force_[i] = F1;
  const double m0 = A_ * (last_[1][i] - B_ * p0 - F0), m1 = A_ * (now[1][i] - B_ * p1 - F1);
  const double p = d2_.empty() ? (p0 + p1) / 2 + dt / 8 * (m0 - m1) : middle(i, dt, now);
  const double F = force(i, p, (s0 + s1) / 2, direction);
  const double slip = dt / 6 * (p0 + 4 * p + p1);
  live.moves = true;
  slip_[i] += slip;
  slipped_[i] += slip;
  live.event.friction_work += weight_ * dt / 6 * (p0 * F0 + 4 * p * F + p1 * F1);
  live.event.radiated += weight_ * damping_ * dt / 6 * (p0 * p0 + 4 * p * p + p1 * p1);
  if (!d2_.empty())
    live.event.radiated -= weight_ * dt / 6 * (p0 * viscous_[0][i] + 4 * p * viscous_[1][i] + p1 * viscous_[2][i]);
  live.kinetic_now += weight_ * p1 * p1 / (2 * A_);
}

// Friction at psi of nodes side by side, of the motion in `direction` where psi = 0.
void Events::forces_at(std::size_t first, std::size_t count, const double* psi, const double* state,
                       const double* direction, double* F) const {
  double at[side_by_side];
  for (std::size_t k = 0; k < count; ++k) at[k] = psi[k] == 0 ? direction[k] * std::numeric_limits<double>::min() : psi[k];
  forces_(PetscInt(first), PetscInt(count), at, state, F);
  const double* const a = &amplitude_[first];
  for (std::size_t k = 0; k < count; ++k) F[k] *= a[k];
}

// The same of nodes side by side, without viscosity between neighbours, in vector code.
void Events::accumulate_side_by_side(std::size_t first, std::size_t count, Live& live, double dt,
                                     const std::vector<std::vector<double>>& now) {
  const bool has_state = last_.size() > 2;
  double direction[side_by_side] = {}, p[side_by_side] = {}, F0[side_by_side], F1[side_by_side], F[side_by_side],
      state[side_by_side];
  const double *const p0 = &last_[0][first], *const p1 = &now[0][first], *const eta0 = &last_[1][first],
                     *const eta1 = &now[1][first];
  const double *const s0 = has_state ? &last_[2][first] : nullptr, *const s1 = has_state ? &now[2][first] : nullptr;
  double* const known = &last_force_[first];
  const unsigned char* const moved = &moved_[first];
  for (std::size_t k = 0; k < count; ++k) direction[k] = p0[k] + p1[k] < 0 ? -1 : 1;
  forces_at(first, count, p1, s1, direction, F1);
  for (std::size_t k = 0; k < count; ++k)
    F0[k] = p0[k] != 0 && moved[k] ? known[k] : force(first + k, p0[k], has_state ? s0[k] : 0, direction[k]);
  std::copy(F1, F1 + count, known);
  find_middle()({p0, p1, eta0, eta1, F0, F1, A_, B_, dt, p, count});
  for (std::size_t k = 0; k < count && has_state; ++k) state[k] = (s0[k] + s1[k]) / 2;
  forces_at(first, count, p, state, direction, F);
  const auto [work, squares, ends] = add_step()({p0, p, p1, F0, F, F1, dt, &slip_[first], &slipped_[first], count});
  live.moves = true;
  live.event.friction_work += weight_ * dt / 6 * work;
  live.event.radiated += weight_ * damping_ * dt / 6 * squares;
  live.kinetic_now += weight_ / (2 * A_) * ends;
}

// eta of a node as the event found it, with what the slip of others has done to it since (0 up to round-off for most).
double Events::eta_before(PetscInt node, int id, const Before& before) const {
  const auto others = [&](PetscInt j) {
    const auto at = static_cast<std::size_t>(j);
    return slipped_[at] - before.slipped[at] - (owner_[at] == id ? slip_[at] : 0);
  };
  double eta = before.eta[static_cast<std::size_t>(node)];
  if (scene_.held(node) && scene_.form == Form::continuum) return eta;  // it follows from psi there
  eta -= scene_.K0() * others(node);
  for (const auto& [j, weight] : second_difference_row(scene_, node)) eta += scene_.K1() * weight * others(j);
  return eta;
}

void Events::finish(int id) {
  const auto node = live_.find(id);
  Live& live = node->second;
  SlipEvent& e = live.event;
  e.end = t_;
  e.count = static_cast<PetscInt>(live.nodes.size());
  double drop = 0;
  e.slip = -std::numeric_limits<double>::infinity();
  for (const PetscInt k : live.nodes) {
    const auto i = static_cast<std::size_t>(k);
    e.slip = std::max(e.slip, slip_[i]);
    e.moment += weight_ * slip_[i];
    const double eta0 = eta_before(k, id, *live.before), eta1 = last_[1][i];
    drop += eta0 - eta1;
    e.strain_energy += weight_ * slip_[i] * (eta0 + eta1) / 2;
  }
  e.stress_drop = drop / double(e.count);
  e.left = e.first;
  for (PetscInt k = 1; k < e.count && owner_beside(static_cast<std::size_t>(e.left), -1) == id; ++k)
    e.left = (e.left - 1 + scene_.n) % scene_.n;
  for (const PetscInt k : live.nodes) owner_[static_cast<std::size_t>(k)] = -1;
  ended_.push_back(e);
  ++count_;
  live_.erase(node);
}

// Nodes that move at either end of the step; those that begin to are claimed.
void Events::find_moving(const std::vector<std::vector<double>>& now) {
  std::shared_ptr<const Before> before;
  mark_moving()({last_[0].data(), now[0].data(), velocity_, moving_.data(), moving_.size()});
  for (std::size_t i = 0, n = owner_.size(); i < n; ++i)
    if (moving_[i] && owner_[i] < 0) claim(i, before);
}

// Neighbours mostly belong to one event.
void Events::accumulate_moving(double dt, const std::vector<std::vector<double>>& now) {
  const std::size_t n = owner_.size();
  int owner = -1;
  Live* event = nullptr;
  for (std::size_t i = 0, end; i < n; i = end) {
    const void* const found = std::memchr(&moving_[i], 1, n - i);
    if (!found) break;
    i = std::size_t(static_cast<const unsigned char*>(found) - moving_.data());
    if (owner_[i] != owner) event = &live_.at(owner = owner_[i]);
    end = i + 1;
    while (end < std::min(n, i + side_by_side) && moving_[end] && owner_[end] == owner) ++end;
    if (end - i >= few && d2_.empty()) accumulate_side_by_side(i, end - i, *event, dt, now);
    else for (std::size_t k = i; k < end; ++k) accumulate(k, *event, dt, now);
  }
}

void Events::step(double t, const std::vector<std::vector<double>>& fields) {
  if (started_) {
    const double dt = t - t_;
    for (auto& [id, live] : live_) {
      live.moves = false;
      live.kinetic_now = 0;
    }
    if (!d2_.empty()) find_viscous_forces(dt, fields);
    find_moving(fields);
    accumulate_moving(dt, fields);
    moved_.swap(moving_);
    std::vector<int> over;
    for (auto& [id, live] : live_) {
      live.event.kinetic = std::max(live.event.kinetic, live.kinetic_now);
      if (!live.moves) over.push_back(id);
    }
    for (const int id : over) finish(id);  // at the beginning of this step
  }
  last_.assign(fields.begin(), fields.end());
  t_ = t;
  started_ = true;
}

std::vector<SlipEvent> Events::ended() {
  std::vector<SlipEvent> result;
  result.swap(ended_);
  return result;
}

std::vector<Field> Events::columns() {
  return {{"begin", "time", "time at which the first node moves"},
          {"first", "length", "position of the first node that moves"},
          {"left", "length", "left end of the region that slips"},
          {"extent", "length", "blocks that slip (chain) or their length (continuum)"},
          {"slip", "length", "largest slip"},
          {"moment", "length^2", "sum of the slip over blocks or over length"},
          {"magnitude", "1", "natural logarithm of the moment"},
          {"stress_drop", "1", "mean of eta before less eta behind"},
          {"strain_energy", "amplitude*length", "energy given away by the springs"},
          {"friction_work", "amplitude*length", "energy lost in friction"},
          {"radiated", "amplitude*length", "energy lost in damping"},
          {"kinetic", "amplitude*length", "largest kinetic energy"}};
}

std::vector<double> Events::row(const SlipEvent& e) const {
  const double magnitude = e.moment > 0 ? std::log(e.moment) : std::numeric_limits<double>::quiet_NaN();
  return {e.begin,  scene_.x(e.first), scene_.x(e.left), weight_ * double(e.count), e.slip,     e.moment,
          magnitude, e.stress_drop,     e.strain_energy,  e.friction_work,           e.radiated, e.kinetic};
}

std::map<std::string, std::vector<double>> Events::save() const {
  std::map<std::string, std::vector<double>> saved;
  saved["events.last"] = {double(t_), double(next_id_), double(count_), double(last_.size())};
  for (std::size_t k = 0; k < last_.size(); ++k) saved["events.field" + std::to_string(k)] = last_[k];
  saved["events.owner"].assign(owner_.begin(), owner_.end());
  saved["events.slip"] = slip_;
  saved["events.slipped"] = slipped_;
  std::vector<double>& live = saved["events.live"];
  std::vector<double>& nodes = saved["events.nodes"];  // in the order in which they joined
  std::vector<double> &eta = saved["events.before_eta"], &slipped = saved["events.before_slipped"];
  std::map<const Before*, double> beginnings;  // those written so far, by their place
  for (const auto& [id, l] : live_) {
    const auto [at, is_new] = beginnings.emplace(l.before.get(), double(beginnings.size()));
    if (is_new) {
      eta.insert(eta.end(), l.before->eta.begin(), l.before->eta.end());
      slipped.insert(slipped.end(), l.before->slipped.begin(), l.before->slipped.end());
    }
    for (const double x : {double(id), l.event.begin, double(l.event.first), l.event.friction_work, l.event.radiated,
                           l.event.kinetic, at->second, double(l.nodes.size())})
      live.push_back(x);
    nodes.insert(nodes.end(), l.nodes.begin(), l.nodes.end());
  }
  return saved;
}

void Events::restore(const std::map<std::string, std::vector<double>>& saved) {
  const std::vector<double>& last = saved.at("events.last");
  t_ = last.at(0);
  next_id_ = static_cast<int>(last.at(1));
  count_ = static_cast<long>(last.at(2));
  last_.resize(static_cast<std::size_t>(last.at(3)));
  for (std::size_t k = 0; k < last_.size(); ++k) last_[k] = saved.at("events.field" + std::to_string(k));
  const std::vector<double>& owner = saved.at("events.owner");
  const std::size_t n = owner_.size();
  for (std::size_t i = 0; i < n; ++i) owner_[i] = static_cast<int>(owner.at(i));
  slip_ = saved.at("events.slip");
  slipped_ = saved.at("events.slipped");
  const std::vector<double> &live = saved.at("events.live"), &nodes = saved.at("events.nodes"),
                            &eta = saved.at("events.before_eta"), &slipped = saved.at("events.before_slipped");
  std::vector<std::shared_ptr<const Before>> beginnings;
  for (std::size_t at = 0; at + n <= eta.size(); at += n) {
    const auto from = static_cast<std::ptrdiff_t>(at), to = static_cast<std::ptrdiff_t>(at + n);
    beginnings.push_back(std::make_shared<const Before>(
        Before{{eta.begin() + from, eta.begin() + to}, {slipped.begin() + from, slipped.begin() + to}}));
  }
  std::size_t next = 0;
  for (std::size_t k = 0; k + 8 <= live.size(); k += 8) {
    const double* x = &live[k];
    Live& l = live_[static_cast<int>(x[0])];
    l.event.begin = x[1];
    l.event.first = static_cast<PetscInt>(x[2]);
    l.event.friction_work = x[3];
    l.event.radiated = x[4];
    l.event.kinetic = x[5];
    l.before = beginnings.at(static_cast<std::size_t>(x[6]));
    for (double j = 0; j < x[7]; ++j) l.nodes.push_back(static_cast<PetscInt>(nodes.at(next++)));
  }
  started_ = true;
}

}  // namespace stickslip
