// The loops over nodes. Each works on any contiguous range of nodes whose halo is given beside it; written
// once, inlined over the friction and the stencil.
//
// The unknowns lie interleaved in memory, which vector instructions dislike. So a loop takes a tile of nodes
// at a time, spreads psi, eta and the state into small arrays that stay in the first-level cache, and
// computes on those: the compiler makes vector code of every step that has no branch and calls no function,
// whatever the law and the order. Only + - * / occur, in the order written, and no fused multiply-add
// (-ffp-contract=off), so that a node's result does not depend on the vector length, on its place in a range,
// or on how many ranks share the grid.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

#include "model/node_parameters.hpp"

namespace stickslip::kernel {

struct Range {
  const double* u;          // unknowns of the first node
  const double* amplitude;  // a_i of the first node; nullptr: all are 1
  double* f;                // right-hand side of the first node; does not overlap u
  PetscInt count;
  // psi of the half_width nodes before the range, in order (not read where half_width = 0)
  const double* before;
  const double* behind;               // psi of the half_width nodes behind it
  const double* direction = nullptr;  // of motion, with friction that sticks (`sticking`): 1, -1, 0 at rest
  PetscInt node = 0;                  // number of the first node, for friction that varies
};

// A range of nodes: 0..count-1, and psi[-half_width .. count+half_width-1].
struct NodeRange {
  const double *psi, *eta, *state;
  const double* amplitude;
  double* f;
  PetscInt count;
  const double* direction;
  PetscInt node;
};

constexpr PetscInt tile_size = 128;

// Calls body(tile) for one tile of the range after the other.
template <int half_width, int dof, class Body>
void over_tiles(const Range& r, const Body& body) {
  constexpr PetscInt margin = 8;  // keeps psi[0] aligned
  static_assert(half_width <= margin);
  alignas(64) double psi_and_halo[tile_size + 2 * margin], eta[tile_size], state[dof == 3 ? tile_size : 1];
  double* const psi = psi_and_halo + margin;
  for (PetscInt begin = 0; begin < r.count; begin += tile_size) {
    const PetscInt count = std::min(tile_size, r.count - begin), end = begin + count;
    const double* u = r.u + begin * dof;
    // Memory is slow to answer and the unpacking asks in bursts, so it is asked two tiles ahead.
    if (r.count - begin >= 3 * tile_size)
      for (PetscInt i = 0; i < tile_size * dof; i += 8) __builtin_prefetch(u + 2 * tile_size * dof + i);
    for (PetscInt i = 0; i < count; ++i) {
      psi[i] = u[i * dof];
      eta[i] = u[i * dof + 1];
      if constexpr (dof == 3) state[i] = u[i * dof + 2];
    }
    for (PetscInt j = 0; j < half_width; ++j) {
      const PetscInt left = begin - half_width + j, right = end + j;
      psi[j - half_width] = left < 0 ? r.before[left + half_width] : r.u[left * dof];
      psi[count + j] = right < r.count ? r.u[right * dof] : r.behind[right - r.count];
    }
    body(NodeRange{psi, eta, state, r.amplitude ? r.amplitude + begin : nullptr, r.f + begin * dof, count,
                   r.direction ? r.direction + begin : nullptr, r.node + begin});
  }
}

template <int half_width>
double stencil_sum(const Coefficients& k, const double* psi) {
  double sum = k.w[0] * psi[0];
  for (int j = 1; j <= half_width; ++j) sum += k.w[j] * (psi[-j] + psi[j]);
  return sum;
}

// K1 D2 psi where links differ: link[0] stands before the node, link[1] behind it.
inline double link_sum(const double* link, const double* psi) {
  return link[1] * (psi[1] - psi[0]) - link[0] * (psi[0] - psi[-1]);
}

// The direction of node i, 0 at rest; without `sticking` nobody asks for it.
template <bool sticking>
double direction_at(const double* direction, PetscInt i) {
  if constexpr (sticking)
    return direction[i];
  else
    return 0;
}
// F, the state's rate and their slopes. `sticking`: of the direction given.
template <bool sticking, class F>
Partials partials_at(const F& friction, double psi, double s, double direction) {
  if constexpr (sticking)
    return friction.sliding_partials(psi, s, direction);
  else
    return friction.partials(psi, s);
}
template <bool sticking, class F>
RatePartials rate_at(const F& friction, double psi, double s, double direction) {
  if constexpr (sticking)
    return friction.sliding_rate(psi, s, direction);
  else
    return friction.rate_partials(psi, s);
}
// force[i] = a_i F of a law that is looked up, as partials_at() has it: between two loops of vector code one
// that is none, since a node's entry, one line of memory, is sooner read than gathered number by number.
template <bool sticking, class F>
void looked_up_force(const F& friction, const double* psi, const double* state, const double* direction,
                     const double* amplitude, PetscInt count, double* force) {
  alignas(64) double sign[tile_size], speed[tile_size];
  alignas(64) std::int64_t bucket[tile_size];
  for (PetscInt i = 0; i < count; ++i) {
    const auto place = friction.template with_sign<sticking>(
        direction_at<sticking>(direction, i), [&](auto s) { return friction.law.place(psi[i], s); });
    sign[i] = place.sign;
    speed[i] = place.speed;
    bucket[i] = place.bucket;
  }
  for (PetscInt i = 0; i < count; ++i) {
    std::int64_t number = bucket[i];
    asm("" : "+r"(number));  // no gather
    force[i] = friction.law.looked_up(speed[i], number);
  }
  for (PetscInt i = 0; i < count; ++i) {
    force[i] *= sign[i];
    if constexpr (F::has_state) force[i] *= friction.template factor<double>(state[i]).value;
  }
  if (amplitude)
    for (PetscInt i = 0; i < count; ++i) force[i] *= amplitude[i];
}
// force[i] = a_i F.
template <bool sticking, class F>
void friction_force(const F& friction, const NodeRange& t, double* force) {
  if constexpr (F::looks_up) {
    looked_up_force<sticking>(friction, t.psi, t.state, t.direction, t.amplitude, t.count, force);
  } else {
    for (PetscInt i = 0; i < t.count; ++i)
      force[i] = partials_at<sticking>(friction_of(friction, t.node + i), t.psi[i],
                                       F::has_state ? t.state[i] : 0, direction_at<sticking>(t.direction, i))
                     .F;
    if (t.amplitude)
      for (PetscInt i = 0; i < t.count; ++i) force[i] *= t.amplitude[i];
  }
}

// The rates of a node, but for its state's: `force` is a_i F, `coupling` K1 D2 psi. moves: 1, or 0 where
// friction holds the node at rest; its friction then is eta.
struct NodeRates {
  double psi, eta;
};
inline NodeRates node_rates(const Coefficients& c, double psi, double eta, double force, double coupling,
                            double moves) {
  const double excess = (eta - force) * moves, load = c.K0 * c.v;
  return {c.A * (excess - c.B * psi * moves), load - c.K0 * psi + coupling - c.s_delta * excess};
}
// 1, or with `sticking` the square of the direction, which is 0 at rest: so there is no branch.
template <bool sticking>
double moving(const double* direction, PetscInt i) {
  if constexpr (sticking)
    return direction[i] * direction[i];
  else
    return 1;
}

// Part::full (half_width >= 1) of a law without a state.
template <int half_width, class F>
struct Whole {
  static_assert(!F::has_state);
  static constexpr int dof = 2;
  F friction;

  void operator()(const Coefficients& coefficients, const Range& r) const {
    const Coefficients c = coefficients;
    over_tiles<half_width, dof>(r, [&](const NodeRange& t) {
      alignas(64) double force[tile_size];
      friction_force<false>(friction, t, force);
      for (PetscInt i = 0; i < t.count; ++i) {
        const double coupling = stencil_sum<half_width>(c, t.psi + i);
        const NodeRates rates = node_rates(c, t.psi[i], t.eta[i], force[i], coupling, 1);
        t.f[i * dof] = rates.psi;
        t.f[i * dof + 1] = rates.eta;
      }
    });
  }
};

// The same of any friction, in two passes: K1 D2 psi stands in the eta of f already (`coupled`), from a loop
// that knows no law; or there is none, Part::pointwise. What exp and log cost, or parameters from memory,
// hides the second pass.
template <class F, bool sticking = false>
struct Onto {
  static constexpr int dof = F::has_state ? 3 : 2;
  static constexpr bool all_versions = dof == 2;
  F friction;
  bool coupled;

  void operator()(const Coefficients& coefficients, const Range& r) const {
    const Coefficients c = coefficients;
    over_tiles<0, dof>(r, [&](const NodeRange& t) {
      alignas(64) double force[tile_size];
      friction_force<sticking>(friction, t, force);
      for (PetscInt i = 0; i < t.count; ++i) {
        const double psi = t.psi[i], coupling = coupled ? t.f[i * dof + 1] : 0;
        const NodeRates rates = node_rates(coefficients_at(friction_of(friction, t.node + i), c), psi,
                                           t.eta[i], force[i], coupling, moving<sticking>(t.direction, i));
        t.f[i * dof] = rates.psi;
        t.f[i * dof + 1] = rates.eta;
        if constexpr (dof == 3)
          t.f[i * dof + 2] = rate_at<sticking>(friction_of(friction, t.node + i), psi, t.state[i],
                                               direction_at<sticking>(t.direction, i))
                                 .g;
      }
    });
  }
};

// y = base + sum_j weights[j] terms[j], up to eight terms in one pass.
struct Terms {
  const double* base;
  const double* const* terms;
  const double* weights;
  int term_count;
  double* y;
  PetscInt count;
};

struct AddTerms {
  template <int terms>
  static void pass(const double* base, const double* const* k, const double* weights, double* y,
                   PetscInt count) {
    const double* column[terms];
    double w[terms];
    for (int j = 0; j < terms; ++j) {
      column[j] = k[j];
      w[j] = weights[j];
    }
#pragma GCC ivdep
    for (PetscInt i = 0; i < count; ++i) {
      double sum = base[i];
      for (int j = 0; j < terms; ++j) sum += w[j] * column[j][i];
      y[i] = sum;
    }
  }
  template <int terms>
  static void pass_of(int wanted, const double* base, const double* const* k, const double* weights,
                      double* y, PetscInt count) {
    if constexpr (terms > 1) {
      if (wanted < terms) return pass_of<terms - 1>(wanted, base, k, weights, y, count);
    }
    pass<terms>(base, k, weights, y, count);
  }
  void operator()(const Terms& c) const {
    constexpr int most = 8;
    const double* base = c.base;
    if (c.term_count == 0) std::copy(base, base + c.count, c.y);
    for (int j = 0; j < c.term_count; j += most, base = c.y)
      pass_of<most>(std::min(most, c.term_count - j), base, c.terms + j, c.weights + j, c.y, c.count);
  }
};

// Between unknowns that lie node by node and columns.
struct Interleaved {
  double* u;               // of the first node
  double* const* columns;  // dof of them
  PetscInt count;
};

template <int dof>
struct ToColumns {
  void operator()(const Interleaved& x) const {
    const double* const u = x.u;
    double* const psi = x.columns[0];
    double* const eta = x.columns[1];
    double* const state = dof == 3 ? x.columns[2] : nullptr;
#pragma GCC ivdep
    for (PetscInt i = 0; i < x.count; ++i) {
      psi[i] = u[i * dof];
      eta[i] = u[i * dof + 1];
      if constexpr (dof == 3) state[i] = u[i * dof + 2];
    }
  }
};

template <int dof>
struct FromColumns {
  void operator()(const Interleaved& x) const {
    double* const u = x.u;
    const double* const psi = x.columns[0];
    const double* const eta = x.columns[1];
    const double* const state = dof == 3 ? x.columns[2] : nullptr;
#pragma GCC ivdep
    for (PetscInt i = 0; i < x.count; ++i) {
      u[i * dof] = psi[i];
      u[i * dof + 1] = eta[i];
      if constexpr (dof == 3) u[i * dof + 2] = state[i];
    }
  }
};

// sum_i [error_i/(absolute + relative max(|u_i|, |u_i - error_i|))]^2, not finite where an entry is not.
struct Weighted {
  const double *u, *error;
  double absolute, relative;
  PetscInt count;
};

struct SumOfSquares {
  double operator()(const Weighted& w) const {
    constexpr int lanes = 8;  // a fixed order of summation that suits every vector length
    double sums[lanes] = {};
    const auto term = [&](PetscInt i) {
      const double u = w.u[i], e = w.error[i], other = u - e;
      const double a = u < 0 ? -u : u, b = other < 0 ? -other : other;
      const double q = e / (w.absolute + w.relative * (a > b ? a : b));
      return q * q;
    };
    PetscInt i = 0;
    for (; i + lanes <= w.count; i += lanes)
      for (int j = 0; j < lanes; ++j) sums[j] += term(i + j);
    for (int j = 0; i < w.count; ++i, ++j) sums[j] += term(i);
    double sum = 0;
    for (const double s : sums) sum += s;
    return sum;
  }
};

// Part::wave and, with `stencil_only`, Part::stencil.
template <int half_width, int unknowns, bool stencil_only>
struct Wave {
  static constexpr int dof = unknowns;
  static constexpr bool all_versions = dof == 2;

  void operator()(const Coefficients& coefficients, const Range& r) const {
    const Coefficients c = coefficients;
    over_tiles<half_width, dof>(r, [&](const NodeRange& t) {
      for (PetscInt i = 0; i < t.count; ++i) {
        const double psi = t.psi[i], eta = t.eta[i], coupling = stencil_sum<half_width>(c, t.psi + i);
        t.f[i * dof] = stencil_only ? 0 : c.A * (eta - c.B * psi);
        t.f[i * dof + 1] = stencil_only ? coupling : c.K0 * (c.v - psi) + coupling - c.s_delta * eta;
        if constexpr (dof == 3) t.f[i * dof + 2] = 0;
      }
    });
  }
};

// Part::reaction.
template <class F>
struct Reaction {
  static constexpr int dof = F::has_state ? 3 : 2;
  static constexpr bool all_versions = dof == 2;
  F friction;

  void operator()(const Coefficients& coefficients, const Range& r) const {
    const Coefficients c = coefficients;
    over_tiles<0, dof>(r, [&](const NodeRange& t) {
      alignas(64) double force[tile_size];
      friction_force<false>(friction, t, force);
      for (PetscInt i = 0; i < t.count; ++i) {
        const auto& own = coefficients_at(friction_of(friction, t.node + i), c);
        t.f[i * dof] = -own.A * force[i];
        t.f[i * dof + 1] = own.s_delta * force[i];
        if constexpr (dof == 3)
          t.f[i * dof + 2] = friction_of(friction, t.node + i).rate(t.psi[i], t.state[i]);
      }
    });
  }
};

// ---- compiled three times on x86-64, for any such processor, AVX2 and AVX-512, chosen when the program runs
// --------- The attributes belong to one function into which everything is inlined, so that no other code of
// the program gets instructions that an older processor lacks.

template <class Loop>
struct Baseline {
  Loop loop;
  template <class... Arguments>
  __attribute__((flatten)) auto operator()(const Arguments&... arguments) const {
    return loop(arguments...);
  }
};

#if defined(__x86_64__)
template <class Loop>
struct Avx2 {
  Loop loop;
  template <class... Arguments>
  __attribute__((target("avx2"), flatten)) auto operator()(const Arguments&... arguments) const {
    return loop(arguments...);
  }
};
template <class Loop>
struct Avx512 {
  Loop loop;
  template <class... Arguments>
#if defined(__clang__)  // prefers the whole width without being told, and does not know the word
  __attribute__((target("avx512f,avx512dq,avx512vl"), flatten))
#else
  __attribute__((target("avx512f,avx512dq,avx512vl,prefer-vector-width=512"), flatten))
#endif
  auto
  operator()(const Arguments&... arguments) const {
    return loop(arguments...);
  }
};
inline bool has_avx2() { return __builtin_cpu_supports("avx2"); }
inline bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl");
}
#else
template <class Loop>
using Avx2 = Baseline<Loop>;
template <class Loop>
using Avx512 = Baseline<Loop>;
inline bool has_avx2() { return false; }
inline bool has_avx512() { return false; }
#endif

// The loop in the version that suits this processor.
template <class Function, class Loop>
Function compiled(const Loop& loop) {
  if (has_avx512()) return Avx512<Loop>{loop};
  if (has_avx2()) return Avx2<Loop>{loop};
  return Baseline<Loop>{loop};
}

// Calls pick with the half width as a constant.
template <class Pick>
auto for_half_width(int half_width, const Pick& pick) {
  switch (half_width) {
    case 1: return pick(std::integral_constant<int, 1>());
    case 2: return pick(std::integral_constant<int, 2>());
    case 3: return pick(std::integral_constant<int, 3>());
    default: return pick(std::integral_constant<int, 4>());
  }
}

// Which loops come in all versions: those without a state; with one, of a law that lives by exp and log, what
// every stage of a step does. The others do without, since each version of a loop takes about a second to
// compile. (So does Varying friction, whose parameters do not lie side by side.)
template <class Function, class Kernel>
Function compiled_where_worth(const Kernel& kernel) {
  if constexpr (Kernel::all_versions)
    return compiled<Function>(kernel);
  else
    return Baseline<Kernel>{kernel};
}

}  // namespace stickslip::kernel
