#include "stickslip/stability/continuum.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();

// From this wavenumber on N k^2 outweighs all else.
double last_that_may_lead(const LinearPoint& medium) {
  const double drag = std::abs(medium.beta()) + std::abs(medium.q()) / std::max(medium.r(), 1e-300);
  return 30 * (std::sqrt((drag + std::sqrt(medium.K0 / medium.A)) / medium.N) +
               (medium.K1 > 0 ? std::sqrt(medium.K0 / medium.K1) : 0));
}

}  // namespace

double spring_frequency(const LinearisedOperator& s) {
  const double K = s.scene.form == Form::chain ? s.K0 + s.K1 : s.K0;
  return K > 0 ? s.rate_of(K) : s.rate;
}
double own_rate(const LinearisedOperator& s) {
  const double w = spring_frequency(s);
  return w / (1 + damping_scale(s) / w);
}
double damping_scale(const LinearisedOperator& s) {
  return s.scene.massless() ? 0 : std::abs(s.mean().damping());
}

std::optional<ContinuumLead> continuum_lead(const LinearisedOperator& s) {
  if (s.scene.form != Form::continuum || !s.uniform || s.size() == 0) return std::nullopt;
  const LinearPoint medium = s.mean();
  const double level = same_growth(medium);
  Waves waves = Waves::of_continuum(s.scene, 2);
  const bool between = s.N > 0 && s.has_state();
  if (between) waves.count += std::int64_t(std::min(last_that_may_lead(medium) / waves.k(1), 1e12));

  ContinuumLead best;
  best.growth = -infinite;
  const auto offer = [&](double k, Complex value) {
    const double ahead = value.real() - best.growth;
    if (ahead > level)
      best = {value.real(), value.imag(), k, false};
    else if (ahead > -level && k != best.wavenumber)
      best.degenerate = true;
  };
  const std::int64_t lead = between ? fastest_wave(medium, waves, level)->index : 0;
  for (const std::int64_t j : {lead, lead + 1})  // the second only to tell whether the first is alone
    offer(waves.k(j), *rightmost_root(medium, waves.kappa2(j)));
  if (s.N > 0) {
    offer(infinite, std::max(-s.K1 / s.N, s.has_state() ? -medium.r() : -infinite));
  } else if (s.K1 > 0) {
    const double oscillating = -medium.damping() / 2, decaying = s.has_state() ? -medium.r() : -infinite;
    offer(infinite, oscillating >= decaying ? Complex(oscillating, infinite) : Complex(decaying, 0));
  }
  return best;
}

}  // namespace stickslip
