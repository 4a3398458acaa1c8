#include "model/right_hand_side.hpp"

#include <algorithm>

#include "stickslip/model/frictions.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

constexpr PetscInt tile_size = 256, margin = 8;  // margin: keeps psi[0] aligned

}  // namespace

struct RightHandSide::Tile {
  alignas(64) double psi_and_halo[tile_size + 2 * margin], eta[tile_size], state[tile_size];
  alignas(64) double coupling[tile_size], driving[tile_size] = {}, d2[tile_size];
  double* const psi = psi_and_halo + margin;
  PetscInt begin = 0, count = 0;
  double* f = nullptr;  // of its first node
};

RightHandSide::RightHandSide(const Scene& s, PetscInt first, PetscInt count)
    : dof_(s.friction.has_state() ? 3 : 2), half_width_(s.order / 2), massless_(s.massless()),
      K1_(s.mean_K1()), N_(s.N()), coefficients_(kernel::coefficients_with(s, N_ > 0 ? 1 : K1_)),
      to_columns_(kernel::copy_loop<true>(dof_)), stencil_(stencil_loop(s, links_along(s, first, count))),
      frictionless_(frictionless_loop(dof_, coefficients_along(s, first, count))) {
  const FrictionPlaces places = friction_places(s, first, count);
  sliding_ = loop_for<PointwiseLoop>(s.friction, false, places);
  if (s.friction.sticks()) sticking_ = loop_for<PointwiseLoop>(s.friction, true, places);
  if (massless_) coefficients_.A = 0;
}

// Calls body(tile) for one tile after the other, with its K1 D2 psi (or D2 psi), or 0.
template <class Body>
void RightHandSide::over_tiles(const InterleavedRange& r, bool coupled, const Body& body) const {
  Tile t;
  double* const columns[] = {t.psi, t.eta, t.state};
  if (!coupled) std::fill_n(t.coupling, tile_size, 0.);
  for (t.begin = 0; t.begin < r.count; t.begin += tile_size) {
    t.count = std::min(tile_size, r.count - t.begin);
    t.f = r.f + t.begin * dof_;
    to_columns_({const_cast<double*>(r.u + t.begin * dof_), columns, t.count});
    for (PetscInt j = 0; j < half_width_ && coupled; ++j) {
      const PetscInt left = t.begin - half_width_ + j, right = t.begin + t.count + j;
      t.psi[j - half_width_] = left < 0 ? r.before[left + half_width_] : r.u[left * dof_];
      t.psi[t.count + j] = right < r.count ? r.u[right * dof_] : r.behind[right - r.count];
    }
    if (coupled) stencil_(coefficients_, {t.psi, t.coupling, t.count, r.node + t.begin});
    body(t);
  }
}

void RightHandSide::take(Part part, double v, const InterleavedRange& r) const {
  const bool coupled = has_stencil(part), linear = has_linear(part), viscous = coupled && N_ > 0;
  const bool friction = has_friction(part) && !(massless_ && dof_ == 2);  // whose psi says it all
  const double* const direction = part == Part::wave || part == Part::reaction ? nullptr : r.direction;
  const PointwiseLoop& pointwise = !friction ? frictionless_ : direction ? sticking_ : sliding_;
  kernel::Coefficients c = coefficients_;
  c.v = v;
  if (!linear) c.B = c.K0 = c.linear = 0;
  over_tiles(r, coupled, [&](Tile& t) {
    const auto at = [&](const double* of_nodes) { return of_nodes ? of_nodes + t.begin : nullptr; };
    const double* const going = at(direction);
    for (PetscInt i = 0; i < t.count && viscous; ++i) {
      t.d2[i] = t.coupling[i];
      const double force = !linear && going && going[i] == 0 ? 0 : N_ * t.d2[i];
      t.driving[i] = linear ? t.eta[i] + force : force;
      t.coupling[i] = 0;
    }
    pointwise(c,
              {t.psi, linear && !viscous ? t.eta : t.driving, dof_ == 3 ? t.state : nullptr, at(r.amplitude),
               t.coupling, t.f, t.f + 1, t.f + 2, t.count, going, r.node + t.begin, true});
    for (PetscInt i = 0; i < t.count && viscous; ++i) t.f[i * dof_ + 1] += K1_ * t.d2[i];
  });
}

void RightHandSide::viscous_force(const InterleavedRange& r) const {
  over_tiles(r, true, [&](Tile& t) {
    std::fill_n(t.f, t.count * dof_, 0.);
    for (PetscInt i = 0; i < t.count; ++i) t.f[i * dof_ + 1] = N_ * t.coupling[i];
  });
}

PsiHalo::PsiHalo(const Scene& scene, const NodeFetch::Layout& layout, PetscInt first)
    : dof_(layout.dof), half_width_(scene.order / 2), local_(layout.local) {
  std::vector<PetscInt> fetched;  // each once; they feed 2 half_width values
  const auto index_of = [&](PetscInt node) {
    const auto found = std::find(fetched.begin(), fetched.end(), node);
    if (found != fetched.end()) return static_cast<std::size_t>(found - fetched.begin());
    fetched.push_back(node);
    return fetched.size() - 1;
  };
  const auto add = [&](PetscInt node) {
    Value value;
    if (node >= 0 && node < scene.n) {
      value.emplace_back(index_of(node), 1.);
    } else {
      for (const auto& [inside, weight] : halo_node(scene, node))
        value.emplace_back(index_of(inside), weight);
    }
    halo_.push_back(value);
  };
  for (int j = -half_width_; j < 0; ++j) add(first + j);
  for (int j = 0; j < half_width_; ++j) add(first + local_ + j);
  fetch_.emplace(layout, 1, fetched);
}

}  // namespace stickslip
