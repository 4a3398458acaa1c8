// What a loop over nodes (kernel.hpp) is given for a node: coefficients of its equations, and its friction.
#pragma once

#include <petscsys.h>

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip::kernel {

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

// No friction, for what is linear alone.
template <bool state>
struct Frictionless {
  static constexpr bool has_state = state, steep = false, looks_up = false;
  Partials partials(double, double) const { return {0, 0, 0}; }
  RatePartials rate_partials(double, double) const { return {0, 0, 0}; }
};

// Any friction, or none (nullptr), behind its virtual functions: terms stand beside it, and nodes have
// coefficients of their own, in loops that are compiled once for all laws and are no vector code.
template <bool state, bool is_smoothed, bool is_steep>
struct AnyFriction {
  static constexpr bool has_state = state, sticks = true, smoothed = is_smoothed, steep = is_steep;
  std::shared_ptr<const Friction> own;
  std::optional<NodeCoefficients> medium;

  Partials partials(double psi, double s) const { return own ? own->partials(psi, s) : Partials{0, 0, 0}; }
  Partials sliding_partials(double psi, double s, double direction) const {
    return own->sliding_partials(psi, s, direction);
  }
  RatePartials rate_partials(double psi, double s) const {
    return own ? own->rate_partials(psi, s) : RatePartials{0, 0, 0};
  }
  RatePartials sliding_rate(double psi, double s, double direction) const {
    return own->sliding_rate(psi, s, direction);
  }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    return own->newton_psi(psi, s, psi_new, s_new, mass);
  }
};

// Friction of its own at every node, a law or AnyFriction; of AnyFriction also the same at all. The loops
// take it in place of one law, which friction_of() hands on as it is: a scene without profiles and terms runs
// the same instructions as if there were none.
template <class Own>
struct Varying {
  static constexpr bool has_state = Own::has_state, sticks = Own::sticks, steep = Own::steep,
                        looks_up = false;
  std::shared_ptr<const std::vector<Own>> nodes;
};
template <class F>
const F& friction_of(const F& friction, PetscInt) {
  return friction;
}
template <class F>
const F& friction_of(const Varying<F>& friction, PetscInt node) {
  return (*friction.nodes)[node];
}
template <bool... flags>
const AnyFriction<flags...>& friction_of(const Varying<AnyFriction<flags...>>& friction, PetscInt node) {
  const std::vector<AnyFriction<flags...>>& nodes = *friction.nodes;
  return nodes[nodes.size() == 1 ? 0 : node];
}

// Whether nodes may have coefficients of their own; and those of a node with that friction: its own, else c.
template <class F>
constexpr bool knows_medium = false;
template <bool... flags>
constexpr bool knows_medium<Varying<AnyFriction<flags...>>> = true;
template <class F>
const Coefficients& coefficients_at(const F&, const Coefficients& c) {
  return c;
}
template <bool... flags>
Coefficients coefficients_at(const AnyFriction<flags...>& friction, const Coefficients& c) {
  if (!friction.medium) return c;
  const NodeCoefficients& own = *friction.medium;
  return {own.A, c.linear * own.B, c.linear * own.K0, c.v, own.s_delta, {}};
}

}  // namespace stickslip::kernel
