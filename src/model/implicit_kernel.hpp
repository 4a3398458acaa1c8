// The implicit equations of a stage with friction taken implicitly, node by node.
//
// With y = (psi, eta, state), h the step times the diagonal entry of the tableau and z what the earlier
// stages give:
//     psi = z_psi + h A m (eta - B psi - F)
//     eta = z_eta + h [K0 (v - psi) - s delta m (eta - F)]
//     s = z_s + h g
// where m is 1, or 0 at rest and at a held node. eta put into the first:
//     r(psi) = a psi + q F(psi, s) - R = 0,   q = h A m/(1 + h s delta m),  a = 1 + m h A B + q h K0,
//     R = z_psi + q (z_eta + h K0 v)
// Where friction rises, r does, and has one zero. Where it falls with velocity and the step is long, r has
// several: the one wanted is that which the step leads to as h grows from 0, along which dr/dpsi > 0. Where
// dr/dpsi is not positive on the way from the start of the step to the zero found, `strict` counts the node
// among the unsolved ones, and the step is repeated with a shorter h; otherwise the first zero that lies in
// the direction of -r is taken.
//
// Newton's method goes on at each node until that node's own residual is small, whatever its neighbours do,
// so that its value does not depend on the tile it lies in. A step of it, r over the slope, errs by no more
// than the slope has changed since the round before, in parts: where that leaves less than what is allowed,
// the step is the last one.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "model/kernel.hpp"
#include "numerics/elementary.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip::kernel {

struct Stage {
  const double *z_psi, *z_eta, *z_state;  // what is known; z_state: nullptr without a state
  const double *start, *start_state;      // psi and the state at the start of the step
  const double* amplitude;                // nullptr: all are 1
  const double* direction;                // with `sticking`
  double *psi, *eta, *state;              // the solution; psi, state come with those of the stage before
  const double* slope;                    // g_psi of the stage before; nullptr at the first
  double *g_psi, *g_eta, *g_state;        // its slopes
  double h;
  double target;  // of the residual, against the scale of psi and |psi|
  Scales scales;
  bool strict, held;
  PetscInt count;
  PetscInt node = 0;  // number of the first node, for friction that varies
};

// What the equation of a state may be off by: in parts of its scale and of the state, not of a logarithm,
// whose size says nothing; and what that is rounded by.
inline double allowed_of_state(double target, const Scales& scales, double s) {
  const double size = s < 0 ? -s : s;
  return target * (scales.state + (scales.state_is_logarithm ? 0 : size)) + 4e-16 * size;
}

// One node's equations.
template <class Source>
struct NodeEquation {
  static constexpr bool has_state = Source::has_state, steep = Source::steep;
  const Source& source;
  PetscInt node;
  double amplitude, direction;
  double h, a, q, R, z_state;
  const Scales& scales;

  struct Law {
    Partials force;
    RatePartials rate;
  };
  Law law_at(double psi, double s) const {
    typename Source::Values values;
    const auto law = source.partials({&psi, &s, &direction, 1, node}, values);
    const Partials p = law.partials(0);
    RatePartials g{0, 0, 0};
    if constexpr (has_state) g = law.rate_partials(0);
    return {{amplitude * p.F, amplitude * p.F_psi, amplitude * p.F_state}, g};
  }
  // The state at this psi: its equation rises in s, since g falls.
  double state_at(double psi, double s) const {
    for (int round = 0; round < 60; ++round) {
      const RatePartials g = law_at(psi, s).rate;
      const double change = (s - z_state - h * g.g) / (1 - h * g.g_state);
      s -= change;
      if (!(std::abs(change) > 1e-15 * (scales.state + std::abs(s)))) break;
    }
    return s;
  }
  struct Value {
    double r, slope, size;  // size: of the terms of r
  };
  // r and dr/dpsi; s follows psi.
  Value at(double psi, double& s) const {
    if constexpr (has_state) s = state_at(psi, s);
    const auto [p, g] = law_at(psi, s);
    double slope = a + q * p.F_psi;
    if constexpr (has_state) slope += q * p.F_state * h * g.g_psi / (1 - h * g.g_state);
    return {a * psi + q * p.F - R, slope, std::abs(a * psi) + std::abs(q * p.F) + std::abs(R)};
  }
  // Whether psi is off by little, by r over its slope; and the force, which a law that goes by ln psi asks
  // for however small psi is.
  bool is_solved(const Value& v, double psi, double s, double target) const {
    const double r = std::abs(v.r);
    const double slope = std::max(a, std::abs(v.slope));
    if (!(r <= target * slope * (scales.psi + std::abs(psi)) + 1e-14 * v.size)) return false;
    if constexpr (steep) {
      const Partials p = law_at(psi, s).force;
      const double stiff = q * p.F_psi;
      return r * stiff <= (target * q * (scales.eta + std::abs(p.F)) + 1e-14 * v.size) * (a + stiff);
    }
    return true;
  }

  // Where friction goes by ln psi the way from one psi to another is gone in that, which asinh(psi/least) is
  // on either side of rest.
  static constexpr double least_psi = 1e-300, far = 40;  // from far on asinh(x) = ln(2 x) to the last digit
  static double place_of(double psi) {
    if constexpr (!steep) return psi;
    const double size = std::abs(psi), ln = std::log(size) - std::log(least_psi / 2);
    return ln > far ? std::copysign(ln, psi) : std::asinh(psi / least_psi);
  }
  static double psi_at(double place) {
    if constexpr (!steep) return place;
    const double size = std::abs(place);
    return size > far ? std::copysign(std::exp(size + std::log(least_psi / 2)), place)
                      : least_psi * std::sinh(place);
  }

  // From the start of the step in growing steps to where r changes its sign, and the zero in between. False
  // where there is none in reach, or (`strict`) where dr/dpsi is not positive on the way.
  __attribute__((noinline)) bool search(double start, double start_state, double target, bool strict,
                                        double& psi, double& s) const {
    constexpr int most = steep ? 1500 : 400;
    constexpr double longest = steep ? 1 : HUGE_VAL;  // a factor of e
    double x = place_of(start), sx = start_state;
    Value here = at(start, sx);
    if (strict && !(here.slope > 0)) return false;
    const double away = here.r > 0 ? -1 : 1;
    double length = std::max(1e-3 * std::abs(here.r) / std::max(std::abs(here.slope), a), 1e-300);
    if (steep) length = 1e-3;
    for (int k = 0; k < most && here.r != 0; ++k, length = std::min(1.5 * length, longest)) {
      const double y = x + away * length;
      double sy = sx;
      const Value there = at(psi_at(y), sy);
      if (!std::isfinite(there.r)) return false;
      if (strict && !(there.slope > 0)) return false;
      if ((there.r < 0) != (here.r < 0) || there.r == 0) {
        double state = sx;
        const double narrow = 1e-16 * std::max(std::abs(x), std::abs(y));
        x = find_root([&](double p) { return at(psi_at(p), state).r; }, {x, here.r, y, there.r}, narrow);
        sx = state;
        here = at(psi_at(x), sx);
        break;
      }
      x = y;
      sx = sy;
      here = there;
    }
    psi = psi_at(x);
    s = sx;
    return std::isfinite(here.r) && (!strict || here.slope > 0) && is_solved(here, psi, s, target);
  }

  // Is dr/dpsi positive between the start of the step and the zero?
  __attribute__((noinline)) bool rises_between(double start, double start_state, double psi) const {
    const auto falls_at = [&](double where) {
      double s = start_state;
      return !(at(where, s).slope > 0);
    };
    for (const double part : {0., 0.25, 0.5, 0.75})
      if (falls_at(start + part * (psi - start))) return false;
    if constexpr (steep) {
      const double from = place_of(start), to = place_of(psi);
      const int parts = int(std::min(std::abs(to - from) + 1, 16.));
      for (int k = 1; k < parts; ++k)
        if (falls_at(psi_at(from + k * (to - from) / parts))) return false;
    }
    return true;
  }
};

// A change so large that between start and zero there may be more than the ends show.
inline bool is_far(double psi, double start) {
  const double change = psi - start, a = psi < 0 ? -psi : psi, b = start < 0 ? -start : start;
  return (change < 0 ? -change : change) > 0.25 * (a < b ? a : b);
}

template <class Source, class Medium = SameMedium>
struct SolveStage {
  static constexpr bool has_state = Source::has_state, steep = Source::steep, sticking = Source::sticking;
  Source source;
  Medium medium = {};
  static constexpr int most_rounds = 12;

  // Of r's coefficients those of a node that moves.
  struct Shared {
    double a, q, load;
    const Coefficients* c;
  };
  static Shared shared(const Coefficients& c, const Stage& t) {
    const double q = t.h * c.A / (1 + t.h * c.s_delta);
    return {1 + t.h * c.A * c.B + q * t.h * c.K0, q, t.h * c.K0 * c.v, &c};
  }
  // The same of node i, whose coefficients may be its own.
  Shared at_node(const Shared& same, const Stage& t, PetscInt i) const {
    if constexpr (Medium::differs) {
      const Shared k = shared(medium.at(*same.c, t.node + i), t);
      return {k.a, k.q, k.load, same.c};
    } else {
      return same;
    }
  }

  NodeEquation<Source> equation(const Shared& same, const Stage& t, PetscInt i) const {
    const Shared k = at_node(same, t, i);
    const bool moves = !t.held && (!sticking || t.direction[i] != 0);
    const double amplitude = t.amplitude ? t.amplitude[i] : 1, direction = sticking ? t.direction[i] : 0;
    const double q = moves ? k.q : 0;
    return {source,
            t.node + i,
            amplitude,
            direction,
            t.h,
            moves ? k.a : 1,
            q,
            t.z_psi[i] + q * (t.z_eta[i] + k.load),
            has_state ? t.z_state[i] : 0,
            t.scales};
  }

  // The slower way of node i; returns whether it led to a root.
  bool search(const Shared& k, const Stage& t, PetscInt i) const {
    const auto e = equation(k, t, i);
    double psi = 0, s = 0;
    if (!e.search(t.start[i], has_state ? t.start_state[i] : 0, t.target, t.strict, psi, s)) return false;
    t.psi[i] = psi;
    if constexpr (has_state) t.state[i] = s;
    return true;
  }

  bool is_safe(const Shared& k, const Stage& t, PetscInt i) const {
    if (!t.strict || !is_far(t.psi[i], t.start[i])) return true;
    return equation(k, t, i).rises_between(t.start[i], has_state ? t.start_state[i] : 0, t.psi[i]);
  }

  // All nodes of a tile at once: one round of Newton's method after the other, in which those that are done
  // stand. As wide as a double, so that the compiler can choose between doubles by it.
  using Flag = std::int64_t;

  // r's coefficients of the nodes of a tile, the amplitude in q.
  struct StageColumns {
    alignas(64) double a[tile_size], q[tile_size], R[tile_size];
  };
  void set_out(const Shared& of_all, const Stage& stage, PetscInt begin, PetscInt count,
               StageColumns& columns) const {
    const Shared same = of_all;  // copies, which no store can change
    const Stage t = stage;
#pragma GCC ivdep
    for (PetscInt i = 0; i < count; ++i) {
      const Shared k = at_node(same, t, begin + i);
      const double moves = t.held ? 0 : moving<sticking>(t.direction, begin + i), q = moves * k.q;
      columns.q[i] = q;
      columns.a[i] = 1 + moves * (k.a - 1);
      columns.R[i] = t.z_psi[begin + i] + q * (t.z_eta[begin + i] + k.load);
    }
    if (t.amplitude)
      for (PetscInt i = 0; i < count; ++i) columns.q[i] *= t.amplitude[begin + i];
  }

  // Leaves `open[i]` 1 where a node is not done; returns whether there is such a node.
  Flag newton(const Shared& k, const Stage& t, PetscInt begin, PetscInt count, Flag* open) const {
    StageColumns columns;
    set_out(k, t, begin, count, columns);
    const double *const a = columns.a, *const q = columns.q, *const R = columns.R;
    alignas(64) double before[tile_size];  // slope of the last round
    double* const psi = t.psi + begin;
    const double unit = t.scales.psi;
    for (PetscInt i = 0; i < count; ++i) {
      open[i] = 1;
      before[i] = 0;
    }
    if (t.slope) extrapolate(t, begin, count);
    const LawTile tile{psi, nullptr, sticking ? t.direction + begin : nullptr, count, t.node + begin};
    typename Source::Values values;
    Flag left = 1;
    for (int round = 0; round < most_rounds && left != 0; ++round) {
      const auto law = source.partials(tile, values);
      left = 0;
#pragma GCC ivdep
      for (PetscInt i = 0; i < count; ++i) {
        const Partials p = law.partials(i);
        const double own = a[i] * psi[i], force = q[i] * p.F, r = own + force - R[i];
        const double slope = a[i] + q[i] * p.F_psi;
        const double size = (own < 0 ? -own : own) + (force < 0 ? -force : force) + (R[i] < 0 ? -R[i] : R[i]);
        const double magnitude = psi[i] < 0 ? -psi[i] : psi[i], miss = r < 0 ? -r : r;
        const double allowed = t.target * (unit + magnitude), turn = slope - before[i];
        const bool close = (turn < 0 ? -turn : turn) * miss <= allowed * slope * slope;
        const bool rises = slope > 0, small = miss <= allowed * a[i] + 1e-15 * size;
        const double next = psi[i] - r / slope;
        psi[i] = ((open[i] != 0) & rises) ? next : psi[i];
        open[i] = (rises & (close | small)) ? 0 : open[i];
        before[i] = slope;
        left |= open[i];
      }
    }
    return left;
  }

  // The guess goes on as the stage before did, unless that leads far.
  void extrapolate(const Stage& t, PetscInt begin, PetscInt count) const {
    double* const psi = t.psi + begin;
#pragma GCC ivdep
    for (PetscInt i = 0; i < count; ++i) {
      const double guess = t.z_psi[begin + i] + t.h * t.slope[begin + i], change = guess - psi[i];
      const double size = psi[i] < 0 ? -psi[i] : psi[i];
      psi[i] = (change < 0 ? -change : change) < 0.25 * size ? guess : psi[i];
    }
  }

  Flag any_far(const Stage& t, PetscInt begin, PetscInt count) const {
    Flag far = 0;
    for (PetscInt i = begin; i < begin + count; ++i) far |= is_far(t.psi[i], t.start[i]) ? 1 : 0;
    return far;
  }

  // The same with a state: both unknowns at once, damped where the law is steep. A node from which no step
  // leads on is left where it stands.
  Flag newton_with_state(const Shared& k, const Stage& stage, PetscInt begin, PetscInt count,
                         Flag* open) const {
    constexpr int most = 40;
    constexpr double done = 0, goes_on = 1, stuck = 2;  // 1. and 2. have no bit in common
    const Stage t = stage;                              // a copy, which no store can change
    StageColumns columns;
    set_out(k, t, begin, count, columns);
    alignas(64) double now[tile_size], next[tile_size], next_state[tile_size], then[tile_size];
    alignas(64) double mass[tile_size];  // where friction is steep
    if (t.slope) extrapolate(t, begin, count);
    double *const psi = t.psi + begin, *const state = t.state + begin;
    const double unit = t.scales.psi;
    for (PetscInt i = 0; i < count; ++i) {
      now[i] = goes_on;
      psi[i] = columns.q[i] != 0 ? psi[i] : columns.R[i];
    }
    const LawTile tile{psi, state, sticking ? t.direction + begin : nullptr, count, t.node + begin};
    typename Source::Values values;
    std::uint64_t left = 1;
    for (int round = 0; round < most && left != 0; ++round) {
      using elementary::bits_of, elementary::where_less, std::abs;
      const auto law = source.partials(tile, values);
#pragma GCC ivdep
      for (PetscInt i = 0; i < count; ++i) {
        const double x = psi[i], s = state[i], a = columns.a[i], q = columns.q[i], R = columns.R[i];
        const Partials p = law.partials(i);
        const RatePartials g = law.rate_partials(i);
        const double r = a * x + q * p.F - R, rs = s - t.z_state[begin + i] - t.h * g.g,
                     of_s = 1 - t.h * g.g_state;
        const double slope = (a + q * p.F_psi) * of_s + q * p.F_state * t.h * g.g_psi;
        const double size = abs(a * x) + abs(q * p.F) + abs(R);
        const double off = abs(r) - (t.target * a * (unit + abs(x)) + 1e-15 * size);
        const double of_state = abs(rs) - allowed_of_state(t.target, t.scales, s) * of_s;
        double worse = where_less(off, of_state, of_state, off);
        if constexpr (steep) {  // the force goes by ln psi, and needs its digits however small it is
          const double stiff = q * p.F_psi, may = t.target * q * (t.scales.eta + abs(p.F)) + 1e-15 * size;
          const double of_force = abs(r) * stiff - may * (a + stiff);
          worse = where_less(worse, of_force, of_force, worse);
          mass[i] = a / q;
        }
        const double d_psi = (q * p.F_state * rs - r * of_s) / slope;
        next[i] = x + d_psi;
        next_state[i] = s + (t.h * g.g_psi * d_psi - rs) / of_s;
        then[i] = where_less(0, slope, where_less(0, worse, goes_on, done), stuck);
      }
      if constexpr (steep) {
        alignas(64) double safe[tile_size];
        source.newton_psi({psi, state, next, next_state, mass, safe, count, t.node + begin});
#pragma GCC ivdep
        for (PetscInt i = 0; i < count; ++i) next[i] = where_less(0, columns.q[i], safe[i], next[i]);
      }
      left = 0;
#pragma GCC ivdep
      for (PetscInt i = 0; i < count; ++i) {
        const double open_here = where_less(abs(now[i] - goes_on), 0.5, 1, 0),
                     moves = where_less(then[i], 1.5, open_here, 0);  // not where it is stuck
        psi[i] = where_less(0, moves, next[i], psi[i]);
        state[i] = where_less(0, moves, next_state[i], state[i]);
        now[i] = where_less(0, open_here, then[i], now[i]);
        left |= bits_of(now[i]) & bits_of(goes_on);
      }
    }
    Flag any = 0;
    for (PetscInt i = 0; i < count; ++i) {
      const bool number = (psi[i] - psi[i]) + (state[i] - state[i]) == 0;
      open[i] = now[i] == done && number ? 0 : 1;
      any |= open[i];
    }
    return any;
  }

  void finish(const Coefficients& c, const Stage& t) const {
    const double per_h = 1 / t.h, same_per_A = 1 / c.A;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const auto& own = medium.at(c, t.node + i);
      const double slope = (t.psi[i] - t.z_psi[i]) * per_h;
      const double per_A = Medium::differs ? 1 / own.A : same_per_A;
      double excess = slope * per_A + own.B * t.psi[i];  // eta - F, as psi's own equation has it
      if constexpr (sticking) excess *= t.direction[i] * t.direction[i];
      t.g_psi[i] = slope;
      const double eta_slope = own.K0 * (own.v - t.psi[i]) - own.s_delta * excess;
      t.g_eta[i] = eta_slope;
      t.eta[i] = t.z_eta[i] + t.h * eta_slope;
      if constexpr (has_state) t.g_state[i] = (t.state[i] - t.z_state[i]) * per_h;
    }
  }

  // Returns how many nodes are left without the root wanted.
  long operator()(const Coefficients& c, const Stage& t) const {
    const Shared k = shared(c, t);
    long unsolved = 0;
    alignas(64) Flag open[tile_size];
    for (PetscInt begin = 0; begin < t.count; begin += tile_size) {
      const PetscInt count = std::min(tile_size, t.count - begin);
      Flag left;
      if constexpr (has_state)
        left = newton_with_state(k, t, begin, count, open);
      else
        left = newton(k, t, begin, count, open);
      if (left == 0 && (!t.strict || any_far(t, begin, count) == 0)) continue;
      for (PetscInt i = 0; i < count; ++i)
        if ((open[i] != 0 || !is_safe(k, t, begin + i)) && !search(k, t, begin + i)) ++unsolved;
    }
    finish(c, t);
    return unsolved;
  }
};

}  // namespace stickslip::kernel
