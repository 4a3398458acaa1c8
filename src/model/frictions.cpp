#include "stickslip/model/frictions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "stickslip/model/model.hpp"

namespace stickslip {

namespace {

// Those that friction alone asks for.
FrictionPlaces law_places(const Scene& scene, PetscInt count, const std::function<PetscInt(PetscInt)>& node) {
  FrictionPlaces places;
  if (!scene.laws_differ()) {
    if (!scene.friction.terms.none()) places.push_back({});
    return places;
  }
  for (PetscInt i = 0; i < count; ++i)
    places.push_back({scene.x(node(i)), friction_amplitude(scene, node(i), 1)[0]});
  return places;
}

}  // namespace

Frictions::Frictions(const Scene& scene, PetscInt first, PetscInt count) : vary_(scene.laws_differ()) {
  const auto node = [first](PetscInt i) { return first + i; };
  if (const FrictionPlaces places = law_places(scene, count, node); !places.empty())
    list_ = Friction::along(scene.friction, places);
  else if (!vary_)
    list_ = {Friction::of(scene.friction)};
}

FrictionPlaces friction_places(const Scene& scene, PetscInt count,
                               const std::function<PetscInt(PetscInt)>& node) {
  FrictionPlaces places = law_places(scene, count, node);
  if (!scene.medium.nodes_differ()) return places;
  if (!scene.laws_differ()) places.assign(std::size_t(count), FrictionPlace{});
  for (PetscInt i = 0; i < count; ++i) places[std::size_t(i)].medium = scene.coefficients(node(i));
  return places;
}

FrictionPlaces friction_places(const Scene& scene, PetscInt first, PetscInt count) {
  return friction_places(scene, count, [first](PetscInt i) { return first + i; });
}

std::vector<double> positions(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> x;
  for (PetscInt i = first; i < first + count; ++i) x.push_back(scene.x(i));
  return x;
}

// Spread of the friction amplitude: the same medium for any number of ranks and, in the continuum, for any
// grid.

namespace {

// A bijective mixing of 64 bits (xor-shift-multiply rounds, constants of splitmix64): neighbouring counters
// give unrelated numbers.
std::uint64_t mix(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

double uniform_from(std::uint64_t key) { return (static_cast<double>(mix(key) >> 11) + 0.5) * 0x1p-53; }

std::uint64_t key_of(PetscInt seed, PetscInt index) {
  return mix(static_cast<std::uint64_t>(seed)) ^ (static_cast<std::uint64_t>(index) * 2);
}

// One draw of the amplitude.
double draw(const Scene& scene, PetscInt index) {
  if (scene.spread_kind == SpreadKind::uniform)
    return 1 + scene.spread * (2 * counter_uniform(scene.friction_seed, index) - 1);
  const double z = counter_normal(scene.friction_seed, index);
  return std::exp(scene.spread * z - scene.spread * scene.spread / 2);
}

}  // namespace

double counter_uniform(PetscInt seed, PetscInt index) { return uniform_from(key_of(seed, index)); }

double counter_normal(PetscInt seed, PetscInt index) {
  const std::uint64_t key = key_of(seed, index);
  const double r = std::sqrt(-2 * std::log(uniform_from(key)));
  return r * std::cos(2 * M_PI * uniform_from(key ^ 1));
}

namespace {

// Draws at points `length` apart; on a ring a whole number of them, so that it closes. Between them the
// quintic 10 s^3 - 15 s^4 + 6 s^5, with two continuous derivatives; it keeps the mean and the range of the
// draws.
template <class Draw>
double between_draws(const Scene& scene, double length, double x, const Draw& draw_at) {
  const PetscInt cells = std::max<PetscInt>(1, static_cast<PetscInt>(std::llround(scene.length / length)));
  const double q = x / (scene.ring() ? scene.length / double(cells) : length);
  const PetscInt corner = static_cast<PetscInt>(std::floor(q));
  const double s = q - double(corner), w = s * s * s * (10 + s * (6 * s - 15));
  const auto at = [&](PetscInt j) { return draw_at(scene.ring() ? j % cells : j); };
  return (1 - w) * at(corner) + w * at(corner + 1);
}

double profile_at(const Scene& scene, double x) {
  return scene.amplitude.points().empty() ? 1 : scene.amplitude.at(x);
}

}  // namespace

std::vector<double> friction_amplitude(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> a(count, 1.);
  if (scene.unit_amplitude()) return a;
  const bool block_by_block = scene.form == Form::chain && scene.spread != 0;
  for (PetscInt i = 0; i < count; ++i) {
    const double x = scene.x(first + i);
    a[i] = block_by_block ? draw(scene, first + i) * profile_at(scene, x) : friction_amplitude_at(scene, x);
  }
  return a;
}

double friction_amplitude_at(const Scene& scene, double x) {
  const double profile = profile_at(scene, x);
  if (scene.spread == 0) return profile;
  return between_draws(scene, scene.spread_length, x, [&](PetscInt j) { return draw(scene, j); }) * profile;
}

double Scene::friction_length() const {
  double least = spread != 0 ? spread_length : std::numeric_limits<double>::infinity();
  least = std::min(least, amplitude.shortest());
  for (const auto* profiles : {&friction.profiles, &medium.profiles})
    for (const auto& [name, profile] : *profiles) least = std::min(least, profile.shortest());
  return least;
}

double noise_at(const Scene& scene, double length, PetscInt seed, PetscInt node) {
  const auto draw_at = [&](PetscInt j) { return 2 * counter_uniform(seed, j) - 1; };
  if (scene.form == Form::chain || length == 0) return draw_at(node);
  return between_draws(scene, length, scene.x(node), draw_at);
}

}  // namespace stickslip
