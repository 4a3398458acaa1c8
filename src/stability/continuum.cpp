#include "stickslip/stability/continuum.hpp"

#include <cmath>
#include <limits>

namespace stickslip {

double unit_frequency(const LinearisedOperator& s) { return std::sqrt(s.A * (s.K0 > 0 ? s.K0 : s.K1)) + 1e-300; }

std::optional<ContinuumLead> continuum_lead(const LinearisedOperator& s) {
  if (s.scene.form != Form::continuum || !s.uniform || s.size() == 0) return std::nullopt;
  const double infinite = std::numeric_limits<double>::infinity();
  const LinearPoint medium = s.mean();
  const bool left = s.scene.left == End::velocity, right = s.scene.right == End::velocity;
  const double unit = (s.scene.ring() ? 2 : 1) * M_PI / s.scene.length;
  const double first = left && right ? 1 : left || right ? 0.5 : 0;
  const double level = 1e-9 * (unit_frequency(s) + std::abs(medium.damping()));

  ContinuumLead best;
  best.growth = -infinite;
  const auto offer = [&](double k, Complex value) {
    const double ahead = value.real() - best.growth;
    if (ahead > level) best = {value.real(), value.imag(), k, false};
    else if (ahead > -level && k != best.wavenumber) best.degenerate = true;
  };
  for (const double j : {0., 1.}) {  // the second only to tell whether the longest is alone
    const double k = unit * (first + j);
    Complex rightmost = -infinite;
    for (const Complex& z : dispersion(medium, k * k))
      if (z.imag() >= 0 && z.real() > rightmost.real()) rightmost = z;
    offer(k, rightmost);
  }
  if (s.K1 > 0) {
    const double oscillating = -medium.damping() / 2, decaying = s.has_state() ? -medium.r() : -infinite;
    offer(infinite, oscillating >= decaying ? Complex(oscillating, infinite) : Complex(decaying, 0));
  }
  return best;
}

}  // namespace stickslip
