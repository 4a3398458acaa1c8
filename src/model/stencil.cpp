#include "stickslip/model/stencil.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace stickslip {

std::array<double, 5> second_difference(int order) {
  switch (order) {
    case 2: return {-2., 1., 0, 0, 0};
    case 4: return {-5. / 2, 4. / 3, -1. / 12, 0, 0};
    case 6: return {-49. / 18, 3. / 2, -3. / 20, 1. / 90, 0};
    default: return {-205. / 72, 8. / 5, -1. / 5, 8. / 315, -1. / 560};
  }
}

double symbol(int order, double h, double k) {
  const double s = std::pow(std::sin(k * h / 2), 2);
  static constexpr double coefficient[] = {1, 1. / 3, 8. / 45, 4. / 35};
  double sum = 0, power = s;
  for (int j = 0; j < order / 2; ++j, power *= s) sum += coefficient[j] * power;
  return 4 / (h * h) * sum;
}

double largest_symbol(int order, double h) { return symbol(order, h, M_PI / h); }

namespace {
// Weight of node k in the value at `at` of the polynomial through the nodes 0..count-1.
double lagrange(int count, int k, double at) {
  double product = 1;
  for (int l = 0; l < count; ++l)
    if (l != k) product *= (at - l) / double(k - l);
  return product;
}
}  // namespace

Combination halo_node(const Scene& scene, PetscInt j) {
  const PetscInt n = scene.n;
  if (scene.ring()) return {{((j % n) + n) % n, 1.}};
  const bool at_left = j < 0;
  const PetscInt distance = at_left ? -j : j - (n - 1);  // from the end node, >= 1
  const auto inside = [&](PetscInt d) { return at_left ? d : n - 1 - d; };
  if (scene.form == Form::chain) return {{inside(distance - 1), 1.}};
  if ((at_left ? scene.left : scene.right) == End::free) return {{inside(distance), 1.}};
  Combination row;
  for (int k = 0; k < scene.order; ++k)
    row.emplace_back(inside(k), lagrange(scene.order, k, -static_cast<double>(distance)));
  return row;
}

Combination second_difference_row(const Scene& scene, PetscInt i) {
  const std::array<double, 5> w = second_difference(scene.order);
  const double scale = scene.form == Form::chain ? 1 : 1 / (scene.h() * scene.h());
  const PetscInt half_width = scene.order / 2;
  if (i >= half_width && i < scene.n - half_width) {
    Combination inner;
    inner.reserve(scene.order + 1);
    for (PetscInt j = -half_width; j <= half_width; ++j) inner.emplace_back(i + j, scale * w[std::abs(j)]);
    return inner;
  }
  std::map<PetscInt, double> row;  // near an end several terms may meet in one node
  for (int j = -scene.order / 2; j <= scene.order / 2; ++j) {
    const double weight = scale * w[std::abs(j)];
    const PetscInt node = i + j;
    if (node >= 0 && node < scene.n) {
      row[node] += weight;
    } else {
      for (const auto& [inside, share] : halo_node(scene, node)) row[inside] += weight * share;
    }
  }
  return {row.begin(), row.end()};
}

Combination coupling_row(const Scene& scene, PetscInt i) {
  if (!scene.medium.links_differ()) {
    Combination row = second_difference_row(scene, i);
    for (auto& term : row) term.second *= scene.K1();
    return row;
  }
  std::map<PetscInt, double> row;
  for (const PetscInt side : {-1, 1}) {
    const double link = scene.link(side < 0 ? i - 1 : i);
    row[i] -= link;
    if (const PetscInt node = i + side; node >= 0 && node < scene.n)
      row[node] += link;
    else
      for (const auto& [inside, share] : halo_node(scene, node)) row[inside] += link * share;
  }
  return {row.begin(), row.end()};
}

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
