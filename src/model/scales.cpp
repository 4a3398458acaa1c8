#include "stickslip/model/scales.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/scales_family.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

LawTable<ScalesFamily::Make>& ScalesFamily::table() { return listed<ScalesFamily>(); }

namespace {

// Of the parameters as they are along x the least velocity and state, and the largest force.
LawScales law_scales(const Scene& s) {
  if (!s.friction.varies()) return ScalesFamily::table().of(s.friction)(s.friction, {});
  constexpr PetscInt most = 101;  // places, the ends among them
  const PetscInt count = std::min(s.n, most);
  FrictionPlaces places;
  for (PetscInt i = 0; i < count; ++i) places.push_back({s.x(count > 1 ? i * (s.n - 1) / (count - 1) : 0)});
  return ScalesFamily::table().of(s.friction)(s.friction, places);
}

double largest_amplitude(const Scene& s) {
  if (s.amplitude.points().empty()) return 1;
  const auto [low, high] = s.amplitude.range();
  return std::max(std::abs(low), std::abs(high));
}

double velocity_given(const Scene& s) {
  const double plate = s.load.varies() && s.force.amplitude == 0 ? s.load.largest() : std::abs(s.v);
  const double ends = std::max(s.left == End::velocity ? std::abs(s.left_value) : 0,
                               s.right == End::velocity ? std::abs(s.right_value) : 0);
  return plate > 0 ? plate : ends;
}

}  // namespace

Scales scales_of(const Scene& scene) {
  const Scene s = scene.medium.varies() ? scene.averaged() : scene;
  const LawScales law = law_scales(s);
  Scales scales;
  scales.eta = law.force * largest_amplitude(s) * (s.normal.varies() ? s.normal.largest() : 1);
  scales.state = law.state;
  scales.state_is_logarithm = s.friction.has_state() && state_is_logarithmic(s.friction.state);
  // Stick-slip is several times as fast as the plate that drives it.
  constexpr double slip = 5;
  const double spring = s.K0() > 0 ? s.K0() : s.K1();
  const double of_force = s.massless() ? 1 / s.B() : spring > 0 ? std::sqrt(s.A() / spring) : 0;
  const double of_length = s.massless() ? spring / s.B() : std::sqrt(s.A() * spring);
  double least = std::numeric_limits<double>::infinity();
  for (const double velocity :
       {slip * velocity_given(s), law.velocity, of_force * scales.eta, of_length * law.length})
    if (velocity > 0) least = std::min(least, velocity);
  if (std::isfinite(least)) scales.psi = least;
  return scales;
}

}  // namespace stickslip
