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

#include <type_traits>

#include "model/implicit_kernel.hpp"
#include "model/law.hpp"

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

// A threshold that is smoothed: force against velocity is an S about rest. From one side of it Newton's
// method jumps to the other and back; from rest, where the S is steepest, it goes the right way, and steps
// that fall short.
template <class F>
struct IsSmoothed : std::false_type {};
template <class L, class S>
struct IsSmoothed<Product<L, SignRegularised, S>> : std::true_type {};
template <bool state, bool smoothed, bool steep>
struct IsSmoothed<AnyFriction<state, smoothed, steep>> : std::bool_constant<smoothed> {};
template <class F>
struct IsSmoothed<Varying<F>> : IsSmoothed<F> {};

// As wide as a double, so that the compiler can choose between doubles by it.
using Flag = std::int64_t;

template <class F, bool sticking>
struct NewtonRound {
  static constexpr int dof = F::has_state ? 3 : 2;
  static constexpr bool all_versions = dof == 2 || F::steep;
  F friction;

  // The tangent at a node: q F and the residual of the state's equation, in the change of psi.
  struct Tangent {
    double force, slope;     // q F, its slope, the state following
    double change, follows;  // of the state: change + follows (x - psi)
  };
  template <class Own>
  static Tangent tangent(const Own& own, const Round& t, double amplitude, PetscInt i) {
    const double psi = t.psi[i], s = F::has_state ? t.state[i] : 0,
                 going = direction_at<sticking>(t.direction, i);
    const double q = t.stage.q * amplitude;
    const Partials p = partials_at<sticking>(own, psi, s, going);
    if constexpr (F::has_state) {
      const RatePartials g = rate_at<sticking>(own, psi, s, going);
      const double one = 1 - t.stage.h * g.g_state, change = -(s - t.z_state[i] - t.stage.h * g.g) / one;
      const double follows = t.stage.h * g.g_psi / one;
      return {q * (p.F + p.F_state * change), q * (p.F_psi + p.F_state * follows), change, follows};
    } else {
      return {q * p.F, q * p.F_psi, 0, 0};
    }
  }

  // d and b. With `advance` what x makes of them: psi, the state and the slopes; returns in bits what is true
  // of some node: 1 what is left over is too much, 2 it is no number, 4 psi has lost its digits beside
  // `from`.
  Flag operator()(const Coefficients& c, const Round& t, bool advance) const {
    if (t.amplitude) return advance ? next<true>(c, t) : linearise<true>(t);
    return advance ? next<false>(c, t) : linearise<false>(t);
  }

 private:
  static constexpr double least_part = 1e-6;
  // So close both are right, but for what the linear system leaves to second order; its own agrees with its
  // neighbours.
  static constexpr double same = 1e-9;

  template <bool spread>
  Flag linearise(Round t) const {  // copies, whose members no store can change
    const F law = friction;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const Tangent k = tangent(friction_of(law, t.node + i), t, spread ? t.amplitude[i] : 1, i);
      const double moves = moving<sticking>(t.direction, i), R = t.R[i];
      t.d[i] = moves != 0 ? t.stage.a + k.slope : t.immovable;
      t.b[i] = moves != 0 ? R - k.force + k.slope * t.change[i] : R;
    }
    return 0;
  }

  template <bool spread>
  Flag next(Coefficients c, Round t) const {
    const F law = friction;
    const double per_h = 1 / t.stage.h;
    Flag left = 0;
#pragma GCC ivdep
    for (PetscInt i = 0; i < t.count; ++i) {
      const auto& own = friction_of(law, t.node + i);
      const double amplitude = spread ? t.amplitude[i] : 1, going = direction_at<sticking>(t.direction, i);
      const double moves = moving<sticking>(t.direction, i);
      const double coupling = t.stage.p * t.d2_from[i] + (t.d[i] * t.x[i] - t.b[i]);
      const Tangent k = tangent(own, t, amplitude, i);
      const double step = moves != 0 ? t.x[i] - t.change[i] : 0, linear = k.force + k.slope * step;
      double change = moves != 0 ? t.x[i] : t.z_psi[i], s = 0, damped = 0;
      const double aim = t.from[i] + change;
      double psi = aim;
      if constexpr (F::has_state) s = t.state[i] + k.change + k.follows * step;
      if constexpr (F::steep) {
        psi = own.newton_psi(t.psi[i], t.state[i], aim, s, t.stage.a / (t.stage.q * amplitude));
        psi = magnitude(psi - aim) <= same * magnitude(aim) ? aim : psi;
        damped = magnitude(psi - aim);
        left |= magnitude(psi) < least_part * magnitude(t.from[i]) ? 4 : 0;
      }
      if constexpr (IsSmoothed<F>::value) {
        psi = t.psi[i] * psi < 0 ? 0 : psi;
        damped = magnitude(psi - aim);
      }
      change = damped != 0 ? psi - t.from[i] : change;
      const double q = t.stage.q * amplitude;
      const Partials p = partials_at<sticking>(own, psi, s, going);
      const double force = q * p.F, miss = magnitude(force - linear);
      const double size = 2 * (magnitude(t.stage.a * psi) + magnitude(force));
      const double off = moves * (miss + (t.stage.a + t.stage.row) * damped);
      double ratio = off / (t.target * t.stage.a * (t.scales.psi + magnitude(psi)) + 1e-15 * size);
      if constexpr (F::steep) {  // the force goes by ln psi, and needs its digits however small it is
        const double stiff = q * p.F_psi, share = stiff / (t.stage.a + stiff);
        const double of_force = share * off / (t.target * q * (t.scales.eta + magnitude(p.F)) + 1e-15 * size);
        ratio = ratio > of_force ? ratio : of_force;
      }
      if constexpr (F::has_state) {
        const RatePartials g = rate_at<sticking>(own, psi, s, going);
        const double miss_of_state = magnitude(s - t.z_state[i] - t.stage.h * g.g);
        const double of_state =
            miss_of_state / ((1 - t.stage.h * g.g_state) * allowed_of_state(t.target, t.scales, s));
        ratio = ratio > of_state ? ratio : of_state;
        t.state[i] = s;
        t.g_state[i] = (s - t.z_state[i]) * per_h;
      }
      const bool small = ratio <= 1, number = ratio < 1e300;
      left |= small ? 0 : 1;
      left |= number ? 0 : 2;
      const BandSlopes slopes = band_slopes(c, t.stage, t.z_psi[i], change, psi, per_h, coupling, moves);
      t.psi[i] = psi;
      t.change[i] = change;
      t.g_psi[i] = slopes.psi;
      t.g_eta[i] = slopes.eta;
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
