#include "stickslip/stability/continuum.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

Complex rightmost(const LinearPoint& medium, double k) {
  Complex best = -infinite;
  for (const Complex& z : dispersion(medium, k * k))
    if (z.imag() >= 0 && z.real() > best.real()) best = z;
  return best;
}

// The number j >= 0 of the wave of wavenumber unit (first + j) that grows fastest in a viscous medium with a state.
double fastest_number(const LinearPoint& medium, double unit, double first) {
  const auto growth = [&](double j) { return rightmost(medium, unit * (first + j)).real(); };
  // from here on N k^2 outweighs all else
  const double drag = std::abs(medium.beta()) + std::abs(medium.q()) / std::max(medium.r(), 1e-300);
  const double scale = std::sqrt((drag + std::sqrt(medium.K0 / medium.A)) / medium.N) +
                       (medium.K1 > 0 ? std::sqrt(medium.K0 / medium.K1) : 0);
  const double last = std::ceil(std::min(30 * scale / unit, 1e12)) + 2;
  double best = 0, most = growth(0), step = 1;
  for (double j = 1; j <= last; j += std::max(1., std::floor(j / 50))) {
    const double here = growth(j);
    if (!(here > most)) continue;
    most = here;
    best = j;
    step = std::max(1., std::floor(j / 50));
  }
  while (step >= 1) {
    const double before = best;
    for (const double j : {before - step, before + step})
      if (j >= 0 && growth(j) > most) most = growth(best = j);
    if (best == before) step = std::floor(step / 2);
  }
  return best;
}

}  // namespace

double unit_frequency(const LinearisedOperator& s) { return s.rate_of(s.K0 > 0 ? s.K0 : s.K1) + 1e-300; }
double damping_scale(const LinearisedOperator& s) { return s.scene.massless() ? 0 : std::abs(s.mean().damping()); }

std::optional<ContinuumLead> continuum_lead(const LinearisedOperator& s) {
  if (s.scene.form != Form::continuum || !s.uniform || s.size() == 0) return std::nullopt;
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
  const double lead = s.N > 0 && s.has_state() ? fastest_number(medium, unit, first) : 0;
  for (const double j : {lead, lead + 1}) {  // the second only to tell whether the first is alone
    const double k = unit * (first + j);
    offer(k, rightmost(medium, k));
  }
  if (s.N > 0) {
    offer(infinite, std::max(-s.K1 / s.N, s.has_state() ? -medium.r() : -infinite));
  } else if (s.K1 > 0) {
    const double oscillating = -medium.damping() / 2, decaying = s.has_state() ? -medium.r() : -infinite;
    offer(infinite, oscillating >= decaying ? Complex(oscillating, infinite) : Complex(decaying, 0));
  }
  return best;
}

}  // namespace stickslip
