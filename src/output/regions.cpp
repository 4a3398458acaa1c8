#include "output/regions.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "numerics/straight_line.hpp"

namespace stickslip {

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
