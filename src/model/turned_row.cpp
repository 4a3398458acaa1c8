#include "model/turned_row.hpp"

#include <array>
#include <cmath>

#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

// The link behind node i over the mean K1.
double over_mean(const Scene& s, PetscInt i) {
  return s.medium.links_differ() && s.mean_K1() > 0 ? s.link(i) / s.mean_K1() : 0;
}

}  // namespace

Combination row_over_mean(const Scene& scene, PetscInt i) {
  if (!scene.medium.links_differ()) return second_difference_row(scene, i);
  Combination row = coupling_row(scene, i);
  for (auto& term : row) term.second *= scene.mean_K1() > 0 ? 1 / scene.mean_K1() : 0;
  return row;
}

std::vector<TurnedTerm> turned_row(const Scene& ring, PetscInt i) {
  const std::array<double, 5> w = second_difference(ring.order);
  const double scale = ring.form == Form::chain ? 1 : 1 / (ring.h() * ring.h());
  std::vector<TurnedTerm> row;
  const double before = over_mean(ring, i - 1), behind = over_mean(ring, i);
  const auto weight = [&](PetscInt j) {
    if (!ring.medium.links_differ()) return scale * w[std::abs(j)];
    return j < 0 ? before : j > 0 ? behind : -(before + behind);
  };
  for (PetscInt j = -ring.order / 2; j <= ring.order / 2; ++j) {
    const PetscInt there = i + j, turns = there >= 0 ? there / ring.n : -((ring.n - 1 - there) / ring.n);
    row.push_back({there - turns * ring.n, weight(j), int(turns)});
  }
  return row;
}

}  // namespace stickslip
