// The derivatives of what is pointwise, node by node, at given psi and state: what a Rosenbrock step needs
// once.
#pragma once

#include "model/kernel.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip::kernel {

struct Tangents {
  const double *psi, *state;            // state: nullptr without one
  const double *amplitude, *direction;  // as in Columns
  // of a_i F and of the state's rate; all but the first: with a state alone
  double *F_psi, *F_state, *g_psi, *g_state;
  PetscInt count;
  PetscInt node;  // number of the first node, for friction that varies
};

template <class F, bool sticking>
struct TangentsOfColumns {
  static constexpr int dof = F::has_state ? 3 : 2;
  static constexpr bool all_versions = dof == 2;
  F friction;

  void operator()(const Tangents& tangents) const {
    const Tangents t = tangents;
    const F law = friction;  // copies, which no store can change
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const auto& own = friction_of(law, t.node + i);
      const double psi = t.psi[i], s = F::has_state ? t.state[i] : 0,
                   amplitude = t.amplitude ? t.amplitude[i] : 1;
      const double direction = direction_at<sticking>(t.direction, i);
      const Partials p = partials_at<sticking>(own, psi, s, direction);
      t.F_psi[i] = amplitude * p.F_psi;
      if constexpr (F::has_state) {
        const RatePartials g = rate_at<sticking>(own, psi, s, direction);
        t.F_state[i] = amplitude * p.F_state;
        t.g_psi[i] = g.g_psi;
        t.g_state[i] = g.g_state;
      }
    }
  }
};

}  // namespace stickslip::kernel
