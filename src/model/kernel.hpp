// Friction as the loops over nodes take it: a law says what it is for a tile of nodes, in columns, and the
// loops (here, implicit_kernel.hpp, loops.hpp) know no law. Who has friction to give is a
// class, the `Source` of a loop: ByColumns of any law, Within of one so cheap that a column on the way costs
// more than the law itself, NoFriction.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip::kernel {

constexpr PetscInt tile_size = 128;  // nodes whose values stay in the first-level cache

// Nodes side by side.
struct LawTile {
  const double *psi, *state;  // state: not read without one
  const double* direction;    // of motion, of laws that stick: 1, -1, 0 at rest
  PetscInt count;
  PetscInt node = 0;  // number of the first, for friction that varies
};
// What is asked of them: F, the state's rate g, and their slopes. All but F and F_psi: with a state alone.
struct LawValues {
  double *F, *F_psi, *F_state, *g, *g_psi, *g_state;
};
// Friction::newton_psi() of nodes.
struct LawSteps {
  const double *psi, *state, *psi_new, *state_new, *mass;
  double* psi_next;
  PetscInt count, node;
};
// Of nodes whose friction is given, F = a y, y in the place of a tile's psi: the velocity that goes with it,
// its slopes in y and the state, a, and the state's rate there.
struct LawVelocities {
  double *psi, *psi_y, *psi_state, *a, *g;
};

struct LawColumns {
  bool has_state = false, steep = false, smoothed = false;  // smoothed: a threshold that is regularised
  using Take = std::function<void(const LawTile&, const LawValues&)>;
  using Step = std::function<void(const LawSteps&)>;
  using Velocities = std::function<void(const LawTile&, const LawVelocities&)>;
  using Ratios = std::function<void(const LawTile&, double* y)>;
  Take rates, partials;  // rates: F and g alone
  Step newton_psi;       // where it is steep
  Velocities velocities;  // of laws that give a velocity; and y = F/a of psi
  Ratios force_over_a;
};
// Of the law with its parameters. `sticking`: with the direction of motion given, for laws that stick.
// `places`: friction_places() of the nodes by their numbers.
LawColumns law_columns(const FrictionParameters& friction, bool sticking, const FrictionPlaces& places);

// ---- the sources
//
// Each has Values, room for a tile, and rates() and partials(), which return what says of the i-th node of a
// tile force(i) and rate(i), or partials(i) and rate_partials(i).

template <bool state, bool is_steep, bool is_sticking>
struct ByColumns {
  static constexpr bool has_state = state, steep = is_steep, sticking = is_sticking, in_tiles = true;
  LawColumns law;

  struct Values {
    alignas(64) double F[tile_size], F_psi[tile_size];
    alignas(64) double F_state[state ? tile_size : 1], g[state ? tile_size : 1];
    alignas(64) double g_psi[state ? tile_size : 1], g_state[state ? tile_size : 1];
  };
  struct Reader : LawValues {
    double force(PetscInt i) const { return F[i]; }
    double rate(PetscInt i) const { return g[i]; }
    Partials partials(PetscInt i) const { return {F[i], F_psi[i], state ? F_state[i] : 0}; }
    RatePartials rate_partials(PetscInt i) const { return {g[i], g_psi[i], g_state[i]}; }
  };
  Reader rates(const LawTile& tile, Values& v) const {
    const Reader reader = reader_of(v);
    law.rates(tile, reader);
    return reader;
  }
  Reader partials(const LawTile& tile, Values& v) const {
    const Reader reader = reader_of(v);
    law.partials(tile, reader);
    return reader;
  }
  void newton_psi(const LawSteps& steps) const { law.newton_psi(steps); }
  bool smoothed() const { return law.smoothed; }

 private:
  static Reader reader_of(Values& v) { return {{v.F, v.F_psi, v.F_state, v.g, v.g_psi, v.g_state}}; }
};

// Of a class F of law.hpp without a state.
template <class F, bool is_sticking, bool is_smoothed>
struct Within {
  static constexpr bool has_state = false, steep = false, sticking = is_sticking, in_tiles = false;
  F law;

  struct Values {};
  struct Reader {
    F law;
    const double *psi, *direction;
    double force(PetscInt i) const { return partials(i).F; }
    Partials partials(PetscInt i) const {
      if constexpr (is_sticking)
        return law.sliding_partials(psi[i], 0, direction[i]);
      else
        return law.partials(psi[i], 0.);
    }
  };
  Reader rates(const LawTile& tile, Values&) const { return {law, tile.psi, tile.direction}; }
  Reader partials(const LawTile& tile, Values& v) const { return rates(tile, v); }
  bool smoothed() const { return is_smoothed; }
};

// For what is linear alone.
template <bool state>
struct NoFriction {
  static constexpr bool has_state = state, steep = false, sticking = false, in_tiles = false;
  struct Values {};
  struct Reader {
    double force(PetscInt) const { return 0; }
    double rate(PetscInt) const { return 0; }
  };
  Reader rates(const LawTile&, Values&) const { return {}; }
};

// ---- the coefficients of nodes
//
// The other thing that a loop is given: all nodes have those of the scene, or each its own.
struct SameMedium {
  static constexpr bool differs = false;
  template <class Coefficients>
  const Coefficients& at(const Coefficients& c, PetscInt) const {
    return c;
  }
};
struct OwnMedium {
  static constexpr bool differs = true;
  std::shared_ptr<const std::vector<NodeCoefficients>> nodes;
  template <class Coefficients>
  Coefficients at(const Coefficients& c, PetscInt node) const {
    const NodeCoefficients& own = (*nodes)[std::size_t(node)];
    return {own.A, c.linear * own.B, c.linear * own.K0, c.v, own.s_delta, {}};
  }
};

// The loops over nodes, on arrays side by side: the coupling of neighbours, which knows the order, and what
// is pointwise, to which a Source says what friction is.
//
// The compiler makes vector code of every step that has no branch and calls no function. Only + - * / occur,
// in the order written, and no fused multiply-add (-ffp-contract=off), so that a node's result does not
// depend on the vector length, on its place in a range, or on how many ranks share the grid.

// The coefficients of the equations that a loop over nodes (kernel.hpp) is given.

// The coefficients of a scene, ready for the loop: w[j] = K1 w_j/h^2.
struct Coefficients {
  double A, B, K0, v, s_delta;
  double w[5];
  double linear = 1;  // 0: of nodes with coefficients of their own B and K0 do not act
};

// With `factor` in place of K1. Of a medium that differs along x: not a number in the place of what has no
// one value.
Coefficients varied_coefficients(const Scene& scene, double factor);
inline Coefficients coefficients_with(const Scene& scene, double factor) {
  if (scene.medium.varies()) return varied_coefficients(scene, factor);
  const double scale = scene.form == Form::chain ? factor : factor / (scene.h() * scene.h());
  const std::array<double, 5> w = second_difference(scene.order);
  Coefficients c{scene.A(), scene.B(), scene.K0(), scene.v, scene.s_delta(), {}};
  // Weights that add up to exactly 0: what they err by acts on psi itself, and 1/h^2 makes it large, the same
  // way in every step. They are rounded to multiples of one power of 2, so small that no digit of theirs is
  // lost and so large that their sum has no rounding.
  const double unit = scale > 0 ? std::ldexp(1., std::ilogb(scale) - 50) : 1;
  double sum = 0;
  for (std::size_t j = 1; j < 5; ++j) {
    c.w[j] = scene.order > 2 ? unit * std::nearbyint(scale * w[j] / unit) : scale * w[j];
    sum += c.w[j];
  }
  c.w[0] = -2 * sum;
  return c;
}
inline Coefficients coefficients_of(const Scene& scene) { return coefficients_with(scene, scene.mean_K1()); }

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

struct Columns {
  const double *psi, *eta, *state;  // state, f_state: nullptr without a state
  const double* amplitude;          // nullptr: all are 1
  const double* coupling;           // K1 D2 psi; may be f_eta
  double *f_psi, *f_eta, *f_state;
  PetscInt count;
  const double* direction = nullptr;  // of motion, with `sticking`: 1, -1, 0 at rest
  PetscInt node = 0;                  // number of the first node, for friction that varies
  bool interleaved = false;           // the rates lie node by node
};

// All that is pointwise, added to the coupling.
template <class Source, class Medium = SameMedium>
struct PointwiseOfColumns {
  static constexpr int dof = Source::has_state ? 3 : 2;
  Source source;
  Medium medium = {};

  void operator()(const Coefficients& c, const Columns& k) const {
    if (k.interleaved)
      take<dof>(c, k);
    else
      take<1>(c, k);
  }

 private:
  template <int stride>
  void take(const Coefficients& c, const Columns& k) const {
    const PetscInt length = Source::in_tiles ? tile_size : k.count;
    for (PetscInt begin = 0; begin < k.count; begin += length) {
      const auto at = [&](const double* column) { return column ? column + begin : nullptr; };
      Columns part = k;
      part.psi += begin;
      part.eta += begin;
      part.state = at(k.state);
      part.amplitude = at(k.amplitude);
      part.coupling += begin;
      part.direction = at(k.direction);
      part.f_psi += begin * stride;
      part.f_eta += begin * stride;
      if (Source::has_state) part.f_state += begin * stride;
      part.node += begin;
      part.count = std::min(length, k.count - begin);
      typename Source::Values values;
      const auto law = source.rates({part.psi, part.state, part.direction, part.count, part.node}, values);
      if (k.amplitude)
        motion<stride>(c, medium, part,
                       [law, part](PetscInt i) { return law.force(i) * part.amplitude[i]; });
      else
        motion<stride>(c, medium, part, [law](PetscInt i) { return law.force(i); });
      if constexpr (Source::has_state)
#pragma GCC ivdep
        for (PetscInt i = 0; i < part.count; ++i) part.f_state[i * stride] = law.rate(i);
    }
  }
  // All of a node in one loop: what lay in a buffer between two would cost more than the arithmetic.
  template <int stride, class Force>
  static void motion(Coefficients c, Medium medium, Columns k, Force force) {
    double *const f_psi = k.f_psi, *const f_eta = stride == 1 ? k.f_eta : f_psi + 1;
#pragma GCC ivdep
    for (PetscInt i = 0; i < k.count; ++i) {
      const NodeRates rates = node_rates(medium.at(c, k.node + i), k.psi[i], k.eta[i], force(i),
                                         k.coupling[i], moving<Source::sticking>(k.direction, i));
      f_psi[i * stride] = rates.psi;
      f_eta[i * stride] = rates.eta;
    }
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

// Between unknowns that lie node by node and columns: to the columns, or back.
struct Interleaved {
  double* u;               // of the first node
  double* const* columns;  // dof of them
  PetscInt count;
};

template <int dof, bool to_columns>
struct CopyColumns {
  void operator()(const Interleaved& x) const {
    double *const u = x.u, *const psi = x.columns[0], *const eta = x.columns[1];
    double* const state = dof == 3 ? x.columns[2] : nullptr;
    const auto copy = [](double& of_node, double& in_column) {
      (to_columns ? in_column : of_node) = to_columns ? of_node : in_column;
    };
#pragma GCC ivdep
    for (PetscInt i = 0; i < x.count; ++i) {
      copy(u[i * dof], psi[i]);
      copy(u[i * dof + 1], eta[i]);
      if constexpr (dof == 3) copy(u[i * dof + 2], state[i]);
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
    constexpr int parts = 8;  // a fixed order of summation that suits every vector length
    double sums[parts] = {};
    const auto term = [&](PetscInt i) {
      const double u = w.u[i], e = w.error[i], other = u - e;
      const double a = u < 0 ? -u : u, b = other < 0 ? -other : other;
      const double q = e / (w.absolute + w.relative * (a > b ? a : b));
      return q * q;
    };
    PetscInt i = 0;
    for (; i + parts <= w.count; i += parts)
      for (int j = 0; j < parts; ++j) sums[j] += term(i + j);
    for (int j = 0; i < w.count; ++i, ++j) sums[j] += term(i);
    double sum = 0;
    for (const double s : sums) sum += s;
    return sum;
  }
};

// ---- compiled three times on x86-64, for any such processor, AVX2 and AVX-512, chosen when the program runs
//
// The attributes belong to one function into which everything is inlined, so that no other code of the
// program gets instructions that an older processor lacks.

#define STICKSLIP_VERSION(Name, ...)                                                    \
  template <class Loop>                                                                 \
  struct Name {                                                                         \
    Loop loop;                                                                          \
    template <class... Arguments>                                                       \
    __attribute__((__VA_ARGS__)) auto operator()(const Arguments&... arguments) const { \
      return loop(arguments...);                                                        \
    }                                                                                   \
  }
STICKSLIP_VERSION(Baseline, flatten);
#if defined(__x86_64__)
STICKSLIP_VERSION(Avx2, target("avx2"), flatten);
#if defined(__clang__)  // prefers the whole width without being told, and does not know the word
STICKSLIP_VERSION(Avx512, target("avx512f,avx512dq,avx512vl"), flatten);
#else
STICKSLIP_VERSION(Avx512, target("avx512f,avx512dq,avx512vl,prefer-vector-width=512"), flatten);
#endif
inline bool has_avx2() { return __builtin_cpu_supports("avx2"); }
inline bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl");
}
#else
STICKSLIP_VERSION(Avx2, flatten);
STICKSLIP_VERSION(Avx512, flatten);
inline bool has_avx2() { return false; }
inline bool has_avx512() { return false; }
#endif

#undef STICKSLIP_VERSION

// The loop in the version that suits this processor.
template <class Function, class Loop>
Function compiled(const Loop& loop) {
  if (has_avx512()) return Avx512<Loop>{loop};
  if (has_avx2()) return Avx2<Loop>{loop};
  return Baseline<Loop>{loop};
}

using Copy = std::function<void(const Interleaved&)>;
template <bool to_columns>
Copy copy_loop(int dof) {
  return dof == 3 ? compiled<Copy>(CopyColumns<3, to_columns>{})
                  : compiled<Copy>(CopyColumns<2, to_columns>{});
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

}  // namespace stickslip::kernel
