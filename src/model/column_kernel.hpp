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
  PetscInt node = 0;  // number of the first node, for links that differ
};

// The same where links differ (medium.hpp): links[k] stands before the node of number k.
struct StencilOfLinks {
  std::shared_ptr<const std::vector<double>> links;

  void operator()(const Coefficients&, const ColumnRange& s) const {
    const double* const link = links->data() + s.node;
#pragma GCC ivdep
    for (PetscInt i = 0; i < s.count; ++i) s.f_eta[i] = link_sum(link + i, s.psi + i);
  }
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
    if constexpr (F::looks_up)
      in_tiles(coefficients, k);
    else
      at_once(coefficients, k);
    if constexpr (F::has_state) {
      const F law = friction;
#pragma GCC ivdep
      for (PetscInt i = 0; i < k.count; ++i)
        k.f_state[i] = rate_at<sticking>(friction_of(law, k.node + i), k.psi[i], k.state[i],
                                         direction_at<sticking>(k.direction, i))
                           .g;
    }
  }

 private:
  void at_once(const Coefficients& c, const Columns& k) const {
    const F law = friction;  // a copy, which no store can change
    const auto force = [law, k](PetscInt i) {
      return partials_at<sticking>(friction_of(law, k.node + i), k.psi[i], F::has_state ? k.state[i] : 0,
                                   direction_at<sticking>(k.direction, i))
          .F;
    };
    const auto own = [law, k](const Coefficients& same, PetscInt i) -> decltype(auto) {
      return coefficients_at(friction_of(law, k.node + i), same);
    };
    if (k.amplitude)
      motion(
          c, k, [force, k](PetscInt i) { return force(i) * k.amplitude[i]; }, own);
    else
      motion(c, k, force, own);
  }
  // All of a node in one loop: what lay in a buffer between two would cost more than the arithmetic.
  template <class Force, class Own>
  static void motion(Coefficients c, Columns k, Force force, Own own) {
#pragma GCC ivdep
    for (PetscInt i = 0; i < k.count; ++i) {
      const NodeRates rates =
          node_rates(own(c, i), k.psi[i], k.eta[i], force(i), k.f_eta[i], moving<sticking>(k.direction, i));
      k.f_psi[i] = rates.psi;
      k.f_eta[i] = rates.eta;
    }
  }
  // But of a law that is looked up, which takes loops of its own.
  void in_tiles(const Coefficients& c, const Columns& k) const {
    for (PetscInt begin = 0; begin < k.count; begin += tile_size) {
      const auto at = [&](auto* column) { return column ? column + begin : nullptr; };
      const Columns part{k.psi + begin,   k.eta + begin,   at(k.state), at(k.amplitude),
                         k.f_psi + begin, k.f_eta + begin, nullptr,     std::min(tile_size, k.count - begin),
                         at(k.direction)};
      alignas(64) double force[tile_size];
      looked_up_force<sticking>(friction, part.psi, part.state, part.direction, part.amplitude, part.count,
                                force);
      motion(
          c, part, [&](PetscInt i) { return force[i]; },
          [](const Coefficients& same, PetscInt) -> const Coefficients& { return same; });
    }
  }
};

}  // namespace stickslip::kernel
