// The coefficients of the equations that a loop over nodes (kernel.hpp) is given.
#pragma once

#include <petscsys.h>

#include <array>
#include <cmath>

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

}  // namespace stickslip::kernel
