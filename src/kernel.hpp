// The loops over nodes. Each works on any contiguous range of nodes: `u` points at its first node, and half_width
// nodes before and behind the range are readable (their psi alone is used). Written once, inlined over the friction,
// the stencil and whether the amplitude varies.
#pragma once

#include "stickslip/friction.hpp"
#include "stickslip/model.hpp"

namespace stickslip::kernel {

// The coefficients of a scene, ready for the loop: w[j] = K1 w_j/h^2.
struct Coefficients {
  double A, B, K0, v, s_delta;
  double w[5];
};

struct Range {
  const double* u;          // unknowns of the first node
  const double* amplitude;  // a_i of the first node
  double* f;                // right-hand side of the first node
  PetscInt count;
};

template <int half_width, int dof>
inline double stencil_sum(const Coefficients& k, const double* u) {
  double sum = k.w[0] * u[0];
  for (int j = 1; j <= half_width; ++j) sum += k.w[j] * (u[-j * dof] + u[j * dof]);
  return sum;
}

// Part::full (half_width >= 1) and Part::pointwise (half_width = 0, w[0] = 0).
template <int half_width, bool spread, class F>
void friction_and_wave(const Coefficients& k, const F& friction, const Range& r) {
  constexpr int dof = F::has_state ? 3 : 2;
  const double* __restrict u = r.u;
  double* __restrict f = r.f;
  const Coefficients c = k;
  const double load = c.K0 * c.v;
  for (PetscInt i = 0; i < r.count; ++i, u += dof, f += dof) {
    const double psi = u[0], eta = u[1];
    double state = 0;
    if constexpr (F::has_state) state = u[2];
    double force = friction.force(psi, state);
    if constexpr (spread) force *= r.amplitude[i];
    const double excess = eta - force;
    f[0] = c.A * (excess - c.B * psi);
    f[1] = load - c.K0 * psi + stencil_sum<half_width, dof>(c, u) - c.s_delta * excess;
    if constexpr (F::has_state) f[2] = friction.rate(psi, state);
  }
}

// Part::wave and, with `stencil_only`, Part::stencil.
template <int half_width, int dof, bool stencil_only>
void wave(const Coefficients& c, const Range& r) {
  const double* __restrict u = r.u;
  double* __restrict f = r.f;
  for (PetscInt i = 0; i < r.count; ++i, u += dof, f += dof) {
    const double coupling = stencil_sum<half_width, dof>(c, u);
    f[0] = stencil_only ? 0 : c.A * (u[1] - c.B * u[0]);
    f[1] = stencil_only ? coupling : c.K0 * (c.v - u[0]) + coupling - c.s_delta * u[1];
    if constexpr (dof == 3) f[2] = 0;
  }
}

// Part::reaction.
template <bool spread, class F>
void reaction(const Coefficients& c, const F& friction, const Range& r) {
  constexpr int dof = F::has_state ? 3 : 2;
  const double* __restrict u = r.u;
  double* __restrict f = r.f;
  for (PetscInt i = 0; i < r.count; ++i, u += dof, f += dof) {
    double state = 0;
    if constexpr (F::has_state) state = u[2];
    double force = friction.force(u[0], state);
    if constexpr (spread) force *= r.amplitude[i];
    f[0] = -c.A * force;
    f[1] = c.s_delta * force;
    if constexpr (F::has_state) f[2] = friction.rate(u[0], state);
  }
}

}  // namespace stickslip::kernel
