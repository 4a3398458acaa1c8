#include "stickslip/model/scales.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <utility>

#include "model/dispatch.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"

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

// How fast the parts of a scene act, for steps in time (model.hpp), and how far.

namespace {

// What Gershgorin's theorem says of the rows of A (K0 - K1 D2).
double wave_frequency_of_medium(const Scene& s) {
  const double same = s.medium.links_differ() ? 0 : s.K1() * largest_symbol(s.order, s.spacing());
  const bool alone = s.n * s.copies == 1;
  double largest = 0;
  for (PetscInt i = 0; i < s.n; ++i) {
    const NodeCoefficients c = s.coefficients(i);
    const double springs = alone ? 0 : s.medium.links_differ() ? 2 * (s.link(i - 1) + s.link(i)) : same;
    largest = std::max(largest, c.A * (c.K0 + springs));
  }
  return std::sqrt(largest);
}

}  // namespace

double wave_frequency(const Scene& s) {
  if (s.medium.varies()) return wave_frequency_of_medium(s);
  const double kappa2 = s.n * s.copies > 1 ? largest_symbol(s.order, s.form == Form::chain ? 1 : s.h()) : 0;
  const double K = (springless(s) ? 0 : s.K0()) + s.K1() * kappa2;
  return s.massless() ? K / scales_of(s).resistance : std::sqrt(s.A() * K);
}

double viscous_rate(const Scene& s) {
  if (s.N() == 0) return 0;
  return s.n * s.copies > 1 ? s.A() * s.N() * largest_symbol(s.order, s.form == Form::chain ? 1 : s.h()) : 0;
}

double nodes_to_forget(const Scene& s) {
  if (s.medium.varies()) return std::numeric_limits<double>::infinity();  // not looked for
  if (s.K1() == 0) return 0;
  return 45 / (2 * std::asinh((s.form == Form::chain ? 1 : s.h()) * std::sqrt(s.K0() / s.K1()) / 2));
}

double stencil_rate(const Scene& s) { return std::max(wave_frequency(s), viscous_rate(s)); }

double Model::wave_frequency() const { return stickslip::wave_frequency(scene()); }

double Model::largest_resistance(double slope) const {
  const bool alike = !scene().medium.nodes_differ();
  double largest = 0;
  for (PetscInt i = 0; i < (alike ? 1 : local()); ++i)
    largest = std::max(largest, coefficients(i).A * (coefficients(i).B + slope));
  return alike ? largest : largest_over(comm(), largest);
}

double Model::friction_rate(Vec u) const {
  const Reading a(u);
  double largest = 0;
  for (PetscInt i = 0; i < local(); ++i) {
    const double psi = a[i * dof()], state = dof() == 3 ? a[i * dof() + 2] : 0;
    const LinearPoint p = linear_point(i, psi, state);
    const double rate = scene().massless() ? 0 : std::abs(p.A * (p.B + p.F_psi)) + std::abs(p.s_delta);
    largest = std::max(largest, std::abs(p.g_state));  // 0 without a state
    largest = std::max(largest, rate);
  }
  return largest_over(comm(), largest);
}

// Of unequal nodes that of mean ones.
double escape_velocity(const Scene& scene) {
  const Scene s = scene.averaged();
  constexpr double never = std::numeric_limits<double>::infinity();
  constexpr int doublings = 200, beyond = 20;
  if (s.massless()) return never;
  const double gain = -(s.A() * s.B() + s.s_delta());
  if (!(gain > 0)) return never;
  const std::shared_ptr<const Friction> law = Friction::of(s.friction);
  const bool state = s.friction.has_state();
  const double velocity = s.v != 0 ? s.v : scales_of(s).velocity;
  // An oscillation of size w gains gain w^2/2 a turn and loses (2/pi) A |F| w at most; the state rests
  // between.
  const auto holds = [&](double w) {
    double most = 0;
    for (const double psi : {w, -w}) {
      const double rested = state ? law->steady_state(velocity) : 0;
      for (const double at : {rested, state ? law->steady_state(psi) : 0})
        most = std::max(most, std::abs(law->partials(psi, at).F));
    }
    return !(4 * s.A() * most < gain * w);
  };
  double w = 100 * std::abs(s.v) + 1e-6 * s.A() / gain;
  for (int k = 0; k < doublings; ++k, w *= 2) {
    bool held = false;
    for (int j = 0; j <= beyond && !held; ++j) held = holds(std::ldexp(w, j));
    if (!held) return 10 * w;
  }
  return never;
}

}  // namespace stickslip
