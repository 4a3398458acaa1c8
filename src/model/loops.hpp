// A round of Newton's method for a stage that takes everything implicitly, node by node but for the linear
// system.
//
// As in implicit_kernel.hpp eta and the state are put into psi's equation, and so is p D2 psi now,
//     a psi - p D2 psi + q F(psi, s) = R,   p = q (h K1 + N),   R = z_psi + q (z_eta + h K0 v)
// What is solved for is the change x = psi - u since the start of the step, of which D2 u is known:
//     a x - p D2 x + q F(u + x, s) = R',   R' = (z_psi - u) + q (z_eta + h K0 v) - (a - 1) u + p D2 u
// Linearised at x_k, s_k this is (d - p D2) x = b: what is left over after the round is what friction is off
// its tangent. p D2 psi = p D2 u + d x - b gives eta, and (x - (z_psi - u))/h the slope of psi. All of these
// are of the size of a step, and so is what they are rounded by: psi itself in the place of its change would
// leave 1/h^2 times the round-off of psi in the slope of eta. Only where a steep law brings psi down by many
// orders in one step is x as large as u, and psi = u + x without digits: then `from` is 0 in the place of u.
#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <vector>

#include "model/implicit_kernel.hpp"

namespace stickslip::kernel {

// The stage's coefficients, see above and implicit_kernel.hpp.
struct BandStage {
  double h, q, a, more, p, load;  // more: a - 1
  double kappa;                   // K1/p, 0 where p is
  double row;                     // at least the sum of |p D2| over a row
};
inline BandStage band_stage(const Coefficients& c, double K1, double N, double d2_row, double h) {
  const double q = h * c.A / (1 + h * c.s_delta), p = q * (h * K1 + N), more = h * c.A * c.B + q * h * c.K0;
  return {h, q, 1 + more, more, p, h * c.K0 * c.v, p != 0 ? K1 / p : 0, p * d2_row};
}

struct Round {
  BandStage stage;
  const double *from, *d2_from;           // u or 0, and D2 of it
  const double *z_psi, *z_eta, *z_state;  // z_psi: less `from`
  const double *amplitude, *direction;    // as in Stage
  // where it is linearised, change = psi - from; with `advance` then the next ones
  double *psi, *change, *state;
  double *d, *b;
  const double *x, *R;              // R: R'
  double *g_psi, *g_eta, *g_state;  // slopes of the implicit part
  double target, immovable;
  Scales scales;
  PetscInt count, node;
};

// R' of all nodes.
struct RightSides {
  void operator()(const Round& round, double* into) const {
    const Round t = round;
    const BandStage k = round.stage;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i)
      into[i] = t.z_psi[i] + k.q * (t.z_eta[i] + k.load) - k.more * t.from[i] + k.p * t.d2_from[i];
  }
};

// The slopes that follow from psi and its change. `moves`: 1, or 0 at rest.
struct BandSlopes {
  double psi, eta;
};
inline BandSlopes band_slopes(const Coefficients& c, const BandStage& k, double z_psi, double change,
                              double psi, double per_h, double coupling, double moves) {
  const double slope = (change - z_psi) * per_h;
  return {slope, c.K0 * (c.v - psi) + k.kappa * coupling - c.s_delta * (moves * (slope / c.A + c.B * psi))};
}

// As wide as a double, so that the compiler can choose between doubles by it.
using Flag = std::int64_t;

template <class Source>
struct NewtonRound {
  static constexpr bool has_state = Source::has_state, steep = Source::steep, sticking = Source::sticking;
  Source source;

  // d and b. With `advance` what x makes of them: psi, the state and the slopes; returns in bits what is true
  // of some node: 1 what is left over is too much, 2 it is no number, 4 psi has lost its digits beside
  // `from`.
  Flag operator()(const Coefficients& c, const Round& t, bool advance) const {
    Flag left = 0;
    for (PetscInt begin = 0; begin < t.count; begin += tile_size) {
      const PetscInt count = std::min(tile_size, t.count - begin);
      if (t.amplitude)
        left |= advance ? next<true>(c, t, begin, count) : linearise<true>(t, begin, count);
      else
        left |= advance ? next<false>(c, t, begin, count) : linearise<false>(t, begin, count);
    }
    return left;
  }

 private:
  static constexpr double least_part = 1e-6;
  // So close both are right, but for what the linear system leaves to second order; its own agrees with its
  // neighbours.
  static constexpr double same = 1e-9;

  // The tangent at a node: q F and the residual of the state's equation, in the change of psi.
  struct Tangent {
    double force, slope;     // q F, its slope, the state following
    double change, follows;  // of the state: change + follows (x - psi)
  };
  template <class Reader>
  static Tangent tangent(const Reader& law, const Round& t, double amplitude, PetscInt begin, PetscInt i) {
    const double q = t.stage.q * amplitude;
    const Partials p = law.partials(i);
    if constexpr (has_state) {
      const RatePartials g = law.rate_partials(i);
      const double s = t.state[begin + i], one = 1 - t.stage.h * g.g_state,
                   change = -(s - t.z_state[begin + i] - t.stage.h * g.g) / one;
      const double follows = t.stage.h * g.g_psi / one;
      return {q * (p.F + p.F_state * change), q * (p.F_psi + p.F_state * follows), change, follows};
    } else {
      return {q * p.F, q * p.F_psi, 0, 0};
    }
  }
  static const double* state_at(const Round& t, PetscInt begin) {
    return has_state ? t.state + begin : nullptr;
  }
  LawTile tile(const Round& t, const double* psi, const double* state, PetscInt begin, PetscInt count) const {
    return {psi, state, sticking ? t.direction + begin : nullptr, count, t.node + begin};
  }

  template <bool spread>
  Flag linearise(Round t, PetscInt begin, PetscInt count) const {  // a copy, which no store can change
    typename Source::Values values;
    const auto law = source.partials(tile(t, t.psi + begin, state_at(t, begin), begin, count), values);
#pragma GCC ivdep
    for (PetscInt i = 0; i < count; ++i) {
      const PetscInt n = begin + i;
      const Tangent k = tangent(law, t, spread ? t.amplitude[n] : 1, begin, i);
      const double moves = moving<sticking>(t.direction, n), R = t.R[n];
      t.d[n] = moves != 0 ? t.stage.a + k.slope : t.immovable;
      t.b[n] = moves != 0 ? R - k.force + k.slope * t.change[n] : R;
    }
    return 0;
  }

  template <bool spread>
  Flag next(Coefficients c, Round t, PetscInt begin, PetscInt count) const {
    const double per_h = 1 / t.stage.h;
    // A threshold that is smoothed: force against velocity is an S about rest. From one side of it Newton's
    // method jumps to the other and back; from rest, where the S is steepest, it goes the right way, and
    // steps that fall short.
    const double other_side = source.smoothed() ? 0 : -std::numeric_limits<double>::infinity();
    alignas(64) double psi_next[tile_size], state_next[tile_size], linear[tile_size], mass[tile_size];
    const auto aim = [t, begin](PetscInt i) {
      const PetscInt n = begin + i;
      return t.from[n] + (moving<sticking>(t.direction, n) != 0 ? t.x[n] : t.z_psi[n]);
    };
    typename Source::Values values;
    Flag left = 0;
    {
      const auto law = source.partials(tile(t, t.psi + begin, state_at(t, begin), begin, count), values);
#pragma GCC ivdep
      for (PetscInt i = 0; i < count; ++i) {
        const PetscInt n = begin + i;
        const double amplitude = spread ? t.amplitude[n] : 1, psi = aim(i);
        const Tangent k = tangent(law, t, amplitude, begin, i);
        const double step = moving<sticking>(t.direction, n) != 0 ? t.x[n] - t.change[n] : 0;
        linear[i] = k.force + k.slope * step;
        psi_next[i] = t.psi[n] * psi < other_side ? 0 : psi;
        if constexpr (has_state) state_next[i] = t.state[n] + k.change + k.follows * step;
        if constexpr (steep) mass[i] = t.stage.a / (t.stage.q * amplitude);
      }
    }
    if constexpr (steep) {
      alignas(64) double safe[tile_size];
      source.newton_psi({t.psi + begin, t.state + begin, psi_next, state_next, mass, safe, count,
                         t.node + begin});
#pragma GCC ivdep
      for (PetscInt i = 0; i < count; ++i) {
        const double psi = magnitude(safe[i] - aim(i)) <= same * magnitude(aim(i)) ? aim(i) : safe[i];
        psi_next[i] = psi;
        left |= magnitude(psi) < least_part * magnitude(t.from[begin + i]) ? 4 : 0;
      }
    }
    const auto law = source.partials(tile(t, psi_next, state_next, begin, count), values);
#pragma GCC ivdep
    for (PetscInt i = 0; i < count; ++i) {
      const PetscInt n = begin + i;
      const double amplitude = spread ? t.amplitude[n] : 1, moves = moving<sticking>(t.direction, n);
      const double coupling = t.stage.p * t.d2_from[n] + (t.d[n] * t.x[n] - t.b[n]);
      const double psi = psi_next[i], damped = magnitude(psi - aim(i));
      const double change = damped != 0 ? psi - t.from[n] : moves != 0 ? t.x[n] : t.z_psi[n];
      const double q = t.stage.q * amplitude;
      const Partials p = law.partials(i);
      const double force = q * p.F, miss = magnitude(force - linear[i]);
      const double size = 2 * (magnitude(t.stage.a * psi) + magnitude(force));
      const double off = moves * (miss + (t.stage.a + t.stage.row) * damped);
      double ratio = off / (t.target * t.stage.a * (t.scales.psi + magnitude(psi)) + 1e-15 * size);
      if constexpr (steep) {  // the force goes by ln psi, and needs its digits however small it is
        const double stiff = q * p.F_psi, share = stiff / (t.stage.a + stiff);
        const double of_force = share * off / (t.target * q * (t.scales.eta + magnitude(p.F)) + 1e-15 * size);
        ratio = ratio > of_force ? ratio : of_force;
      }
      if constexpr (has_state) {
        const RatePartials g = law.rate_partials(i);
        const double s = state_next[i], miss_of_state = magnitude(s - t.z_state[n] - t.stage.h * g.g);
        const double of_state =
            miss_of_state / ((1 - t.stage.h * g.g_state) * allowed_of_state(t.target, t.scales, s));
        ratio = ratio > of_state ? ratio : of_state;
        t.state[n] = s;
        t.g_state[n] = (s - t.z_state[n]) * per_h;
      }
      const bool small = ratio <= 1, number = ratio < 1e300;
      left |= small ? 0 : 1;
      left |= number ? 0 : 2;
      const BandSlopes slopes = band_slopes(c, t.stage, t.z_psi[n], change, psi, per_h, coupling, moves);
      t.psi[n] = psi;
      t.change[n] = change;
      t.g_psi[n] = slopes.psi;
      t.g_eta[n] = slopes.eta;
    }
    return left;
  }
  static double magnitude(double a) { return a < 0 ? -a : a; }
};

// With the waves alone implicit: psi, from its change in its place, and the slopes.
struct WaveRound {
  void operator()(const Coefficients& coefficients, const Round& round) const {
    const Coefficients c = coefficients;
    const Round t = round;
    const double per_h = 1 / t.stage.h;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const double change = t.psi[i], psi = t.from[i] + change;
      const double coupling = t.stage.p * t.d2_from[i] + (t.stage.a * change - t.R[i]);
      const BandSlopes slopes = band_slopes(c, t.stage, t.z_psi[i], change, psi, per_h, coupling, 1);
      t.psi[i] = psi;
      t.g_psi[i] = slopes.psi;
      t.g_eta[i] = slopes.eta;
    }
  }
};

}  // namespace stickslip::kernel

namespace stickslip {

// The loops over nodes as they are chosen for a scene, compiled for each set of instructions: for each order,
// or for what laws have (a state, a threshold, a steep rise), but for no law. Who calls one knows neither.

// K1 D2 psi; `links`, where they differ, by the numbers of nodes.
using StencilLoop = std::function<void(const kernel::Coefficients&, const kernel::ColumnRange&)>;
StencilLoop stencil_loop(const Scene& scene, const std::vector<double>& links = {});

// All that is pointwise; the stage of a method that takes it implicitly, with the number of nodes left
// unsolved; a round of Newton's method with everything implicit.
using PointwiseLoop = std::function<void(const kernel::Coefficients&, const kernel::Columns&)>;
using StageLoop = std::function<long(const kernel::Coefficients&, const kernel::Stage&)>;
using NewtonLoop =
    std::function<kernel::Flag(const kernel::Coefficients&, const kernel::Round&, bool advance)>;
// One of these three. `sticking`: with the direction of motion given, for laws that stick. `places`:
// friction_places() of the nodes by their numbers.
template <class Loop>
Loop loop_for(const FrictionParameters& friction, bool sticking, const FrictionPlaces& places);

// The terms of nodes between which there is viscosity: what drives a node is e = eta + N D2 psi in the place
// of eta, of which the pointwise loops know nothing.
struct ViscousTerms {
  double N, K1;

  // As pointwise(c, k), with D2 psi in the place of k.coupling (which is written to, and may be k.f_eta), for
  // room of k.count numbers each. `linear`: eta is among the terms that are asked for; else what rests feels
  // nothing.
  void operator()(const PointwiseLoop& pointwise, const kernel::Coefficients& c, kernel::Columns k,
                  double* coupling, double* d2, double* driving, bool linear = true) const;
};

// The rates of a held node: psi stands, and in the continuum eta, which is output there, does too.
inline void hold(const Scene& scene, double& psi_t, double& eta_t) {
  psi_t = 0;
  if (scene.form == Form::continuum) eta_t = 0;
}

// What is pointwise without friction; `medium`: of each node, empty where all are alike.
PointwiseLoop frictionless_loop(int dof, const std::vector<NodeCoefficients>& medium);

// F of `count` nodes side by side, the first of number `node`, of friction amplitude 1, at psi and the stored
// state (not read without one), whatever their coefficients.
using ForceLoop =
    std::function<void(PetscInt node, PetscInt count, const double* psi, const double* state, double* F)>;
ForceLoop force_loop(const FrictionParameters& friction, const FrictionPlaces& places);

}  // namespace stickslip
