#include "output/cluster_events.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>

#include "model/moved_nodes.hpp"
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

}  // namespace stickslip
