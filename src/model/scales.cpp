#include "stickslip/model/scales.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "model/scales_family.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/springs.hpp"

namespace stickslip {

LawTable<ScalesFamily::Make>& ScalesFamily::table() { return listed<ScalesFamily>(); }

namespace {

// Of the parameters as they are along x the least velocity and state, and the largest force.
DroppingScales law_scales(const Scene& s) {
  if (!s.friction.varies()) return ScalesFamily::table().of(s.friction)(s.friction, {});
  constexpr PetscInt most = 101;  // places, the ends among them
  const PetscInt count = std::min(s.n, most);
  FrictionPlaces places;
  for (PetscInt i = 0; i < count; ++i) places.push_back({s.x(count > 1 ? i * (s.n - 1) / (count - 1) : 0)});
  return ScalesFamily::table().of(s.friction)(s.friction, places);
}

// Along x, of friction without its spread.
std::pair<double, double> amplitude_range(const Scene& s) {
  return s.amplitude.points().empty() ? std::pair(1., 1.) : s.amplitude.range();
}

// What a node gains that lets go alone, against its own and its neighbours' springs.
double velocity_of_drop(const Scene& s, double drop) {
  if (drop == 0 || s.massless()) return 0;
  const double h = s.n > 1 ? s.spacing() : 1, K = s.K0() + (s.n > 1 ? 2 * s.K1() / (h * h) : 0);
  return amplitude_range(s).first * drop / (s.B() + std::sqrt(K / s.A()));
}

double velocity_given(const Scene& s) {
  const double plate = s.load.varies() && s.force.amplitude == 0 ? s.load.largest() : std::abs(s.v);
  const double ends = std::max(s.left == End::velocity ? std::abs(s.left_value) : 0,
                               s.right == End::velocity ? std::abs(s.right_value) : 0);
  return plate > 0 ? plate : ends;
}

double power_of_two(double x) { return std::exp2(std::round(std::log2(x))); }

// Without mass: the rate of a node's own springs K, or of its state, and what resists its sliding.
void set_massless(const Scene& s, double K, SceneScales& scales) {
  const Frictions frictions(s, 0, 1);
  const Friction& law = frictions[0];
  const double state = law.steady_state(s.v), b = s.B() + law.partials(s.v, state).F_psi;
  const bool known = b > 0 && std::isfinite(b);
  scales.resistance = known ? b : s.B() > 0 ? s.B() : scales.least.eta / scales.velocity;
  const double of_state =
      law.has_state && std::isfinite(state) ? std::abs(law.rate_partials(s.v, state).g_state) : 0;
  scales.rate = K > 0 ? K / scales.resistance : of_state > 0 ? of_state : 1;  // 1: nothing ever moves
}

}  // namespace

SceneScales scales_of(const Scene& scene) {
  std::optional<Scene> mean;
  if (scene.medium.varies()) mean = scene.averaged();
  const Scene& s = mean ? *mean : scene;
  const DroppingScales law = law_scales(s);
  const double K = springless(s) ? s.K1() : s.K0(), B = s.B();
  const double of_force = s.massless() ? (B > 0 ? 1 / B : 0) : K > 0 ? std::sqrt(s.A() / K) : 0;
  const double of_length = s.massless() ? (B > 0 ? K / B : 0) : std::sqrt(s.A() * K);
  SceneScales scales;
  Scales &least = scales.least, &slips = scales.slip;
  least.eta = law.force * amplitude_range(s).second * (s.normal.varies() ? s.normal.largest() : 1);
  least.state = law.state;
  least.state_is_logarithm = s.friction.has_state() && state_is_logarithmic(s.friction.state);
  // Stick-slip is several times as fast as the plate that drives it.
  constexpr double slip = 5;
  double psi = std::numeric_limits<double>::infinity();
  const double driven = std::max(slip * velocity_given(s), velocity_of_drop(s, law.drop));
  for (const double velocity : {driven, law.velocity, of_force * least.eta, of_length * law.length})
    if (velocity > 0) psi = std::min(psi, velocity);
  if (std::isfinite(psi)) least.psi = psi;
  const double fast = std::abs(s.v) + of_force;
  slips.psi = power_of_two(fast > 0 ? fast : least.psi);
  if (s.friction.has_state() && s.friction.state->unit == "length" && of_length > 0)
    slips.state = power_of_two(slips.psi / of_length);
  scales.velocity = s.v != 0 ? std::abs(s.v) : slips.psi / 32;
  scales.rate = K > 0 ? of_length : s.A() * least.eta / least.psi;
  if (s.massless()) set_massless(s, K, scales);
  return scales;
}

}  // namespace stickslip
