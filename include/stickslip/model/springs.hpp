// What ties the nodes of a scene to the plate, and what friction holds them. Local, not collective.
#pragma once

#include <algorithm>

#include "stickslip/model/scene.hpp"

namespace stickslip {

// A harmonic force is in `Scene::load` the velocity, over K0, of a plate that exerts it. Of a chain without
// springs to the plate (k0 = 0) it acts through springs of this K0, in 1/length, whose force no motion
// changes by a digit.
inline constexpr double no_spring = 0x1p-200;

// Whether no force says where the chain is, but for held ends.
inline bool springless(const Scene& s) {
  return s.form == Form::chain && (s.medium.varies() ? s.averaged().K0() : s.K0()) <= no_spring;
}

// Of the velocity `v` of the plate in Scene::load what is the plate's own, without the harmonic force.
inline double velocity_of_plate_alone(const Scene& s, double v, double t) {
  return springless(s) ? s.v : v - s.push_velocity(t);
}

// Whether a point of the profile of the friction amplitude is 0: nodes there have no friction.
inline bool frictionless_somewhere(const Scene& s) {
  const auto& points = s.amplitude.points();
  return std::any_of(points.begin(), points.end(), [](const auto& point) { return point.second == 0; });
}

}  // namespace stickslip
