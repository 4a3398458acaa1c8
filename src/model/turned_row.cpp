#include "model/turned_row.hpp"

#include <algorithm>
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

TurnedRow turned_row(const Scene& ring, PetscInt i) {
  const std::array<double, 5> w = second_difference(ring.order);
  const double scale = ring.form == Form::chain ? 1 : 1 / (ring.h() * ring.h());
  TurnedRow row;
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

std::vector<std::size_t> nodes_at_ends(const std::vector<TurnedRow>& rows) {
  std::vector<std::size_t> at_ends;
  const auto turns = [](const TurnedTerm& t) { return t.turns != 0; };
  for (std::size_t i = 0; i < rows.size(); ++i)
    if (rows.size() == 1 || std::any_of(rows[i].begin(), rows[i].end(), turns)) at_ends.push_back(i);
  return at_ends;
}

std::vector<std::complex<double>> phase_weights(const std::vector<TurnedRow>& rows,
                                                const std::vector<std::size_t>& at_ends, double theta) {
  const std::size_t r = at_ends.size();
  std::vector<std::complex<double>> w(r * r);
  for (std::size_t a = 0; a < r; ++a)
    for (const TurnedTerm& t : rows[at_ends[a]]) {
      if (t.turns == 0) continue;
      const auto b = std::lower_bound(at_ends.begin(), at_ends.end(), std::size_t(t.node)) - at_ends.begin();
      w[a * r + std::size_t(b)] += t.weight * (std::polar(1., theta * t.turns) - 1.);
    }
  return w;
}

}  // namespace stickslip
