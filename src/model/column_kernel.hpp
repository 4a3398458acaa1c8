// The right-hand side on separate arrays, in two loops: the stencil, which knows the order and no law, and what is
// pointwise, which knows the law and no order. So there are as many of them as laws and orders together.
#pragma once

#include <algorithm>

#include "model/kernel.hpp"

namespace stickslip::kernel {

// f_eta = K1 D2 psi; psi has its halo on both sides.
struct Stretch {
  const double* psi;
  double* f_eta;
  PetscInt count;
};

template <int half_width>
struct StencilOfColumns {
  void operator()(const Coefficients& coefficients, const Stretch& s) const {
    const Coefficients c = coefficients;
#pragma GCC ivdep
    for (PetscInt i = 0; i < s.count; ++i) s.f_eta[i] = stencil_sum<half_width>(c, s.psi + i);
  }
};

// Everything else; f_eta comes with K1 D2 psi, to which it is added where the sum over all terms has it. state, f_state:
// nullptr without a state; amplitude: nullptr where all are 1; direction: with `sticking`.
template <class F, bool sticking>
struct PointwiseOfColumns {
  static constexpr int dof = F::has_state ? 3 : 2;
  F friction;

  void operator()(const Coefficients& coefficients, const Columns& k) const {
    const Coefficients c = coefficients;
    const double load = c.K0 * c.v;
    alignas(64) double force[tile_size];
    for (PetscInt begin = 0; begin < k.count; begin += tile_size) {
      const Tile t{k.psi + begin,
                   k.eta + begin,
                   F::has_state ? k.state + begin : nullptr,
                   k.amplitude ? k.amplitude + begin : nullptr,
                   nullptr,
                   std::min(tile_size, k.count - begin),
                   sticking ? k.direction + begin : nullptr};
      friction_force<sticking>(friction, t, force);
      double* const f_psi = k.f_psi + begin;
      double* const f_eta = k.f_eta + begin;
#pragma GCC ivdep
      for (PetscInt i = 0; i < t.count; ++i) {
        const double psi = t.psi[i];
        double excess = t.eta[i] - force[i], resistance = c.B * psi;
        if constexpr (sticking) {
          const double moves = t.direction[i] * t.direction[i];
          excess *= moves;
          resistance *= moves;
        }
        f_psi[i] = c.A * (excess - resistance);
        f_eta[i] = load - c.K0 * psi + f_eta[i] - c.s_delta * excess;
      }
      if constexpr (F::has_state)
        for (PetscInt i = 0; i < t.count; ++i) {
          if constexpr (sticking)
            k.f_state[begin + i] = friction.sliding_rate(t.psi[i], t.state[i], t.direction[i]).g;
          else k.f_state[begin + i] = friction.rate(t.psi[i], t.state[i]);
        }
    }
  }
};

}  // namespace stickslip::kernel
