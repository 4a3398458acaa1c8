#include "stickslip/model/medium.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

const ProfileAlongX* Medium::profile(const char* name) const {
  if (profiles.empty()) return nullptr;
  const auto found = profiles.find(name);
  return found == profiles.end() ? nullptr : &found->second;
}

void Medium::refuse_varying(const char* name) const {
  if (profile(name)) throw std::logic_error(std::string(name) + " differs along x: there is no one number");
}

Scene Scene::averaged() const {
  Scene mean = *this;
  mean.medium.profiles.clear();
  return mean;
}

NodeCoefficients Scene::coefficients(PetscInt i) const {
  const auto at = [&](const char* name, double same) {
    const ProfileAlongX* const profile = medium.profile(name);
    return profile ? profile->at(x(i)) : same;
  };
  if (form == Form::chain)
    return {f0 / at("model_m", m), at("model_zeta", zeta) / f0, at("model_k0", k0) / f0, 0};
  const double damping = at("model_delta", delta);
  return {gamma, 0, 1 / gamma, derived_sign ? damping : -damping};
}

namespace {

// c^2 between two places: half-way, or its harmonic mean where c jumps between them.
double square_between(const ProfileAlongX& c, const Scene& s, double from, double to) {
  const double near = 1e-9 * (to - from), half = c.at((from + to) / 2);
  std::vector<double> cuts = {from};
  for (const double x : c.jumps())
    for (const double at : {x - s.length, x, x + s.length})
      if (at > from + near && at < to - near && (s.ring() || at == x)) cuts.push_back(at);
  if (cuts.size() == 1) return half * half;
  std::sort(cuts.begin(), cuts.end());
  cuts.push_back(to);
  double resistance = 0;
  for (std::size_t k = 1; k < cuts.size(); ++k) {
    double middle = (cuts[k - 1] + cuts[k]) / 2;
    if (s.ring()) middle = std::fmod(middle + s.length, s.length);
    resistance += (cuts[k] - cuts[k - 1]) / std::pow(c.at(middle), 2);
  }
  return (to - from) / resistance;
}

}  // namespace

double Scene::link(PetscInt i) const {
  const double step = spacing(), scale = step * step;
  if (ring())
    i = (i + n) % n;
  else
    i = std::clamp(i, PetscInt(0), std::max(n - 2, PetscInt(0)));
  if (const ProfileAlongX* const springs = medium.profile("model_k1"))
    return springs->at(double(i) + 0.5) / f0;
  if (const ProfileAlongX* const speed = medium.profile("model_c"))
    return square_between(*speed, *this, x(i), x(i) + step) / gamma / scale;
  return mean_K1() / scale;
}

std::vector<NodeCoefficients> coefficients_along(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<NodeCoefficients> all;
  if (!scene.medium.nodes_differ()) return all;
  for (PetscInt i = 0; i < count; ++i) all.push_back(scene.coefficients(first + i));
  return all;
}

std::vector<double> links_along(const Scene& scene, PetscInt first, PetscInt count) {
  std::vector<double> all;
  if (!scene.medium.links_differ()) return all;
  for (PetscInt i = -1; i < count; ++i) all.push_back(scene.link(first + i));
  return all;
}

}  // namespace stickslip
