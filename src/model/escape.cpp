#include "model/escape.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scales.hpp"

namespace stickslip {

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
