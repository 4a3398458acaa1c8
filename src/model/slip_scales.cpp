#include "stickslip/model/slip_scales.hpp"

#include <cmath>

#include "stickslip/model/scene.hpp"

namespace stickslip {

namespace {

double power_of_two(double x) { return std::exp2(std::round(std::log2(x))); }

}  // namespace

SlipScales slip_scales(const Scene& scene) {
  const Scene s = scene.medium.varies() ? scene.averaged() : scene;
  const double K = s.K0() > 0 ? s.K0() : s.K1(), B = s.B();
  const double of_force = s.massless() ? (B > 0 ? 1 / B : 0) : K > 0 ? std::sqrt(s.A() / K) : 0;
  const double rate = s.massless() ? (B > 0 ? K / B : 0) : std::sqrt(s.A() * K);
  SlipScales scales;
  if (const double psi = std::abs(s.v) + of_force; psi > 0) scales.psi = power_of_two(psi);
  if (s.friction.has_state() && s.friction.state->unit == "length" && rate > 0)
    scales.state = power_of_two(scales.psi / rate);
  return scales;
}

}  // namespace stickslip
