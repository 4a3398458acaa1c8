// The right-hand side on separate arrays, in two loops: the stencil, which knows the order and no law, and
// what is pointwise, which knows the law and no order. So there are as many of them as laws and orders
// together.
#pragma once

#include "model/kernel.hpp"

namespace stickslip::kernel {

// f_eta = K1 D2 psi; psi has its halo on both sides.
struct ColumnRange {
  const double* psi;
  double* f_eta;
  PetscInt count;
};

template <int half_width>
struct StencilOfColumns {
  void operator()(const Coefficients& coefficients, const ColumnRange& s) const {
    const Coefficients c = coefficients;
#pragma GCC ivdep
    for (PetscInt i = 0; i < s.count; ++i) s.f_eta[i] = stencil_sum<half_width>(c, s.psi + i);
  }
};

struct Columns {
  const double *psi, *eta, *state;  // state, f_state: nullptr without a state
  const double* amplitude;          // nullptr: all are 1
  double *f_psi, *f_eta, *f_state;
  PetscInt count;
  const double* direction = nullptr;  // with `sticking`
  PetscInt node = 0;                  // number of the first node, for friction that varies
};

// Everything else; f_eta comes with K1 D2 psi.
template <class F, bool sticking>
struct PointwiseOfColumns {
  static constexpr int dof = F::has_state ? 3 : 2;
  static constexpr bool all_versions = dof == 2 || F::steep;
  F friction;

  void operator()(const Coefficients& coefficients, const Columns& k) const {
    if (k.amplitude)
      pass<true>(coefficients, k);
    else
      pass<false>(coefficients, k);
  }

 private:
  // All of a node in one loop: what lay in a buffer between two would cost more than the arithmetic.
  template <bool spread>
  void pass(Coefficients c, Columns k) const {
    const F law = friction;  // a copy, which no store can change
#pragma GCC ivdep
    for (PetscInt i = 0; i < k.count; ++i) {
      const double psi = k.psi[i];
      double force = partials_at<sticking>(friction_of(law, k.node + i), psi, F::has_state ? k.state[i] : 0,
                                           direction_at<sticking>(k.direction, i))
                         .F;
      if constexpr (spread) force *= k.amplitude[i];
      const NodeRates rates =
          node_rates(c, psi, k.eta[i], force, k.f_eta[i], moving<sticking>(k.direction, i));
      k.f_psi[i] = rates.psi;
      k.f_eta[i] = rates.eta;
    }
    if constexpr (F::has_state) {
#pragma GCC ivdep
      for (PetscInt i = 0; i < k.count; ++i)
        k.f_state[i] = rate_at<sticking>(friction_of(law, k.node + i), k.psi[i], k.state[i],
                                         direction_at<sticking>(k.direction, i))
                           .g;
    }
  }
};

}  // namespace stickslip::kernel
