#include "output/catalogue.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <utility>

#include "model/moved_nodes.hpp"
#include "numerics/straight_line.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

ClusterEvents::ClusterEvents(const Scene& scene, bool ruptures)
    : scene_(scene), coefficients_(coefficients_along(scene, 0, scene.n)), regions_(scene.n, scene.ring()),
      owner_(scene.n, -1), slip_(scene.n), squares_(scene.n), rupture_(ruptures ? scene.n : 0) {
  if (coefficients_.empty()) coefficients_.push_back(scene.coefficients(0));
}

// Simpson's rule on the cubics of psi and eta.
void ClusterEvents::step(const MovedNodes& m) {
  const double dt = m.t1 - m.t0;
  int whose = -1;
  LiveEvent* live = nullptr;
  const auto close = [&] {
    if (live) live->event.kinetic = std::max(live->event.kinetic, live->kinetic_now);
  };
  for (PetscInt k = 0; k < m.count; ++k) {
    if (m.direction[k] == 0) continue;
    const PetscInt i = m.first + k < scene_.n ? m.first + k : m.first + k - scene_.n;
    if (!live || owner_[i] != whose) {
      close();
      live = &regions_.live().at(whose = owner_[i]);
    }
    const auto& [A, B, K0, s_delta] = own(i);
    const double damping = B + s_delta / A, weight = node_weight(scene_, i);
    const double p0 = m.begin.psi[k], p1 = m.end.psi[k], e0 = m.begin.eta[k], e1 = m.end.eta[k];
    const double p = (p0 + p1) / 2 + dt / 8 * (m.begin.psi_rate[k] - m.end.psi_rate[k]);
    const double e = (e0 + e1) / 2 + dt / 8 * (m.begin.eta_rate[k] - m.end.eta_rate[k]);
    const double squares = dt / 6 * (p0 * p0 + 4 * p * p + p1 * p1);
    const double given = dt / 6 * (p0 * e0 + 4 * p * e + p1 * e1);
    slip_[i] += dt / 6 * (p0 + 4 * p + p1);
    double viscous = 0;  // what neighbours give it
    if (m.begin.viscous) {
      const double v0 = m.begin.viscous[k], v1 = m.end.viscous[k];
      const double v = (v0 + v1) / 2 + dt / 8 * (m.begin.viscous_rate[k] - m.end.viscous_rate[k]);
      viscous = dt / 6 * (p0 * v0 + 4 * p * v + p1 * v1);
    }
    live->event.friction_work += weight * (given + viscous - (p1 * p1 - p0 * p0) / (2 * A) - B * squares);
    live->event.radiated += weight * (damping * squares - viscous);
    live->kinetic_now += weight / (2 * A) * (p1 * p1 - squares_[i]);
    squares_[i] = p1 * p1;
  }
  close();
}

PetscInt ClusterEvents::beside(PetscInt node, int side) const {
  const PetscInt n = scene_.n, j = node + side;
  if (j >= 0 && j < n) return j;
  return scene_.ring() ? (j + n) % n : -1;
}

void ClusterEvents::claim(const SlipRegion& stretch, double t) {
  const int id = regions_.claim(stretch, t, [] { return nullptr; });
  for (PetscInt i = stretch.first; i <= stretch.last; ++i) {
    owner_[i] = id;
    slip_[i] = squares_[i] = 0;
    if (!rupture_.empty()) rupture_[i] = t;
  }
  for (const PetscInt j : {beside(stretch.first, -1), beside(stretch.last, 1)})
    if (j >= 0 && owner_[j] >= 0 && owner_[j] != id)
      regions_.for_nodes(id, 0, scene_.n, [&](PetscInt i) { owner_[i] = id; });
}

void ClusterEvents::change(double t, const std::vector<PetscInt>& starts, const std::vector<PetscInt>& stops,
                           const std::function<double(PetscInt)>& eta) {
  std::vector<PetscInt> begun;
  for (const PetscInt i : starts)
    if (owner_[i] < 0) begun.push_back(i);
  std::sort(begun.begin(), begun.end());
  for (std::size_t k = 0, end; k < begun.size(); k = end) {
    for (end = k + 1; end < begun.size() && begun[end] == begun[end - 1] + 1;) ++end;
    claim({begun[k], begun[end - 1]}, t);
  }
  for (const PetscInt i : starts) ++regions_.live().at(owner_[i]).sliding;
  std::set<int> over;
  for (const PetscInt i : stops)
    if (--regions_.live().at(owner_[i]).sliding == 0) over.insert(owner_[i]);
  for (const int id : over) finish(id, t, eta);
}

void ClusterEvents::finish(int id, double t, const std::function<double(PetscInt)>& eta) {
  SlipEvent e = regions_.live().at(id).event;
  const Load& load = scene_.load;
  const double way = halts(scene_)   ? 0
                     : load.varies() ? load.integral(t) - load.integral(e.begin)
                                     : scene_.v * (t - e.begin);
  EventSums sums;
  regions_.for_nodes(id, 0, scene_.n, [&](PetscInt i) {
    const double K0 = own(i).K0, travelled = K0 * way;
    double change = travelled - K0 * slip_[i];
    for (const auto& [j, factor] : coupling_row(scene_, i))
      if (owner_[j] == id) change += factor * slip_[j];
    const double behind = eta(i);
    sums.add(node_weight(scene_, i), slip_[i], behind - change, behind);
  });
  conclude(e, t, sums);
  for (PetscInt k = 0; k < e.count && !rupture_.empty(); ++k)
    e.rupture.push_back(rupture_[(e.left + k) % scene_.n]);
  ended_.push_back(e);
  regions_.for_nodes(id, 0, scene_.n, [&](PetscInt i) { owner_[i] = -1; });
  regions_.end(id);
}

void ClusterEvents::archive(Archive& a) {
  struct Kept {
    int id = 0;
    LiveEvent live = {};
  };
  std::vector<Kept> events;
  for (const auto& [id, live] : regions_.live()) events.push_back({id, live});
  int next_id = regions_.next_id();
  a.list("events.of_clusters", [&](NumberList& x) {
    x(next_id);
    x.rest(events, [&](Kept& kept) {
      LiveEvent& l = kept.live;
      SlipEvent& e = l.event;
      x(kept.id, e.begin, e.first, e.left, e.count, e.kinetic, e.friction_work, e.radiated, l.kinetic_now,
        l.sliding);
    });
  });
  std::vector<std::vector<double>*> lists = {&slip_, &squares_};
  if (!rupture_.empty()) lists.push_back(&rupture_);
  a.nodes("events.of_cluster_nodes", lists);
  if (!a.restores()) return;
  regions_.number_from(next_id);
  for (const Kept& kept : events) {
    const SlipEvent& e = kept.live.event;
    if (e.left < 0 || e.left >= scene_.n || e.count < 1 || e.count > scene_.n)
      throw std::runtime_error("its events under way are not whole");
    regions_.put(kept.id, kept.live);
    regions_.for_nodes(kept.id, 0, scene_.n, [&](PetscInt i) { owner_[i] = kept.id; });
  }
}

std::vector<SlipEvent> ClusterEvents::ended() {
  std::vector<SlipEvent> result;
  result.swap(ended_);
  return result;
}

void conclude(SlipEvent& e, double t, const EventSums& sums) {
  e.end = t;
  e.direction = int(sums.moment > 0) - int(sums.moment < 0);
  e.slip = e.direction == 0 ? std::max(sums.left, sums.right) : e.direction < 0 ? sums.left : sums.right;
  e.moment = e.direction * sums.moment;
  e.stress_drop = e.direction * sums.drop / double(e.count);
  e.strain_energy = sums.strain;
}

// The region that has its end at a node, which may lie beyond the ends of the line; -1 where there is none.
int Regions::beside(const std::map<PetscInt, int>& ends, PetscInt node) const {
  if (ring_) node = (node + n_) % n_;
  const auto found = ends.find(node);
  return found == ends.end() ? -1 : found->second;
}

int Regions::begin(PetscInt node, double t, const Remember& before) {
  const int id = next_id_++;
  LiveEvent& live = live_[id];
  live.event.begin = t;
  live.event.first = node;
  live.before = before();
  return id;
}

void Regions::join(int kept, int taken) {
  if (taken < 0 || kept == taken) return;
  LiveEvent &a = live_.at(kept), &b = live_.at(taken);
  if (b.event.begin < a.event.begin) {
    a.event.begin = b.event.begin;
    a.event.first = b.event.first;
    a.before = b.before;
  }
  a.event.friction_work += b.event.friction_work;
  a.event.radiated += b.event.radiated;
  a.event.kinetic = std::max(a.event.kinetic, b.event.kinetic);
  a.kinetic_now += b.kinetic_now;
  a.sliding += b.sliding;
  live_.erase(taken);
}

// As if the nodes were asked one after the other: the first joins what stands on its left, the last also what
// stands on its right.
int Regions::claim(const SlipRegion& s, double t, const Remember& before) {
  const int left = beside(by_right_, s.first - 1), right_one = beside(by_left_, s.last + 1);
  const int own = s.first == s.last ? std::max(left, right_one) : left;
  const int first_id = own >= 0 ? own : begin(s.first, t, before), kept = std::max(first_id, right_one);
  PetscInt begin_at = s.first, count = s.last - s.first + 1;
  if (left >= 0) {
    const SlipEvent& e = live_.at(left).event;
    begin_at = e.left;
    count += e.count;
    by_left_.erase(e.left);
    by_right_.erase(right(e));
  }
  if (right_one >= 0 && right_one != left) {
    const SlipEvent& e = live_.at(right_one).event;
    count += e.count;
    by_left_.erase(e.left);
    by_right_.erase(right(e));
  }
  join(kept, first_id);
  join(kept, left == first_id ? -1 : left);
  join(kept, right_one);
  SlipEvent& e = live_.at(kept).event;
  // all of a ring begins behind the node that began
  e.left = ring_ && count == n_ ? (e.first + 1) % n_ : begin_at;
  e.count = count;
  by_left_[e.left] = kept;
  by_right_[right(e)] = kept;
  return kept;
}

bool Regions::holds(int id, PetscInt node) const {
  const SlipEvent& e = live_.at(id).event;
  return (node - e.left + n_) % n_ < e.count;
}

void Regions::put(int id, const LiveEvent& event) {
  live_[id] = event;
  by_left_[event.event.left] = id;
  by_right_[right(event.event)] = id;
}

void Regions::renumber() {
  const std::map<int, LiveEvent> before = std::move(live_);
  live_.clear();
  by_left_.clear();
  by_right_.clear();
  next_id_ = 0;
  for (const auto& numbered : before) put(next_id_++, numbered.second);
}

void Regions::end(int id) {
  const auto node = live_.find(id);
  by_left_.erase(node->second.event.left);
  by_right_.erase(right(node->second.event));
  live_.erase(node);
}

namespace {

constexpr PetscInt passed_over = 3, fewest = 6;

}  // namespace

Front front_of(const SlipEvent& event, const Scene& scene, int side) {
  const Front none{NAN, NAN};
  const std::vector<double>& times = event.rupture;
  const PetscInt n = scene.n, count = PetscInt(times.size()), at = (event.first - event.left + n) % n;
  const bool whole_ring = scene.ring() && count == n;
  const auto time = [&](PetscInt away) { return times[std::size_t((at + side * away + n) % n)]; };
  PetscInt last = side > 0 ? count - 1 - at : at;  // nodes on that side
  if (whole_ring) {
    const PetscInt latest = PetscInt(std::max_element(times.begin(), times.end()) - times.begin());
    const PetscInt to_the_right = (latest - at + n) % n;
    last = side > 0 ? to_the_right : n - 1 - to_the_right;
  }
  const PetscInt nodes = last - passed_over;
  if (nodes < fewest) return none;
  const double spacing = scene.form == Form::chain ? 1 : scene.h(), first_time = time(passed_over + 1);
  StraightLine line;
  for (PetscInt k = passed_over + 1; k <= last; ++k)
    line.add(time(k) - first_time, side * spacing * double(k));
  if (!(line.width() > 0)) return none;
  return {line.slope(), std::sqrt(line.variance() / line.width())};
}

}  // namespace stickslip
