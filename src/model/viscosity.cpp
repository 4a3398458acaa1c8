#include "model/viscosity.hpp"

#include <algorithm>
#include <utility>

namespace stickslip {

using kernel::Coefficients;
using kernel::Range;
using kernel::tile_size;

Viscosity::Viscosity(const Scene& s, int dof)
    : A_(s.A()), K1_(s.K1()), N_(s.N()), s_delta_(s.s_delta()), dof_(dof),
      d2_(kernel::coefficients_with(s, 1)), stencil_(wave_loop(dof, s.order / 2, true)) {}

RangeLoop Viscosity::around(RangeLoop pointwise) const {
  return [self = *this, pointwise = std::move(pointwise)](const Coefficients& c, const Range& r) {
    const int dof = self.dof_;
    Coefficients alone = c;
    std::fill(std::begin(alone.w), std::end(alone.w), 0.);
    self.stencil_(self.d2_, r);  // D2 psi is in f now, as the rate of eta
    alignas(64) double u[3 * tile_size], d2[tile_size];
    for (PetscInt begin = 0; begin < r.count; begin += tile_size) {
      Range tile = r;
      tile.count = std::min(tile_size, r.count - begin);
      tile.f = r.f + begin * dof;
      std::copy(r.u + begin * dof, r.u + (begin + tile.count) * dof, u);
      for (PetscInt i = 0; i < tile.count; ++i) {
        d2[i] = tile.f[i * dof + 1];
        u[i * dof + 1] += self.N_ * d2[i];
      }
      tile.u = u;
      tile.node = r.node + begin;
      if (r.amplitude) tile.amplitude = r.amplitude + begin;
      if (r.direction) tile.direction = r.direction + begin;
      pointwise(alone, tile);
      for (PetscInt i = 0; i < tile.count; ++i) tile.f[i * dof + 1] += self.K1_ * d2[i];
    }
  };
}

RangeLoop Viscosity::alone() const {
  return [self = *this](const Coefficients&, const Range& r) {
    self.stencil_(self.d2_, r);
    for (PetscInt i = 0; i < r.count; ++i) {
      double* const f = r.f + i * self.dof_;
      const double d2 = f[1], viscous = r.direction && r.direction[i] == 0 ? 0 : self.N_ * d2;
      f[0] = self.A_ * viscous;
      f[1] = self.K1_ * d2 - self.s_delta_ * viscous;
    }
  };
}

RangeLoop Viscosity::force() const {
  return [self = *this](const Coefficients&, const Range& r) {
    self.stencil_(self.d2_, r);
    for (PetscInt i = 0; i < r.count; ++i) r.f[i * self.dof_ + 1] *= self.N_;
  };
}

}  // namespace stickslip
