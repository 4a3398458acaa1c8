#include "stickslip/stability/uniform_states.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/fastest_wave.hpp"
#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

namespace {

// The fastest wave on uniform sliding at psi. lambda = 0 of the uniform mode is the shift of the whole.
void find_growth(const Scene& scene, UniformState& u) {
  Scene sliding = scene;
  sliding.v = u.psi;
  const LinearPoint medium = LinearisedOperator(sliding).mean();
  const auto found = fastest_wave(medium, Waves::of(scene), 1e-3 * same_growth(medium));
  u.slope = medium.slow_beta();
  u.growth_rate = found ? found->value.real() : -std::numeric_limits<double>::infinity();
  u.frequency = found ? found->value.imag() : 0;
  u.wavenumber = found ? found->wavenumber : 0;
  u.stable = u.growth_rate < 0;
}

}  // namespace

bool has_uniform_states(const Scene& s) {
  return s.form == Form::chain && s.k0 == 0 && s.spread == 0 && !s.friction.varies() && !s.medium.varies() &&
         s.left != End::velocity && s.right != End::velocity;
}

std::vector<UniformState> uniform_states(const Scene& scene, double stress) {
  constexpr double lowest = -290, highest = 8, step = 1 / 16.;  // of log10 |psi/unit|
  const double unit = scales_of(scene).slip.psi;
  const auto friction = Friction::of(scene.friction);
  const auto excess = [&](double psi) {
    return scene.B() * psi + friction->force(psi, friction->steady_state(psi)) - stress;
  };
  std::vector<double> found;
  for (const double sign : {-1., 1.}) {
    const auto at = [&](double exponent) { return excess(sign * unit * std::pow(10., exponent)); };
    double before = lowest, f_before = at(before);
    for (double e = lowest + step; e <= highest; e += step) {
      const double f = at(e);
      if (std::isfinite(f) && std::isfinite(f_before) && f != 0 &&
          (f_before == 0 || (f < 0) != (f_before < 0)))
        found.push_back(sign * unit * std::pow(10., find_root(at, {before, f_before, e, f}, 0)));
      before = e;
      f_before = f;
    }
  }
  const double state = friction->steady_state(0);
  const bool rest = friction->sticks ? std::abs(stress) <= friction->threshold_at_long_rest()
                                     : std::isfinite(state) && excess(0) == 0;
  if (rest) found.push_back(0);
  std::sort(found.begin(), found.end());
  std::vector<UniformState> states;
  for (const double psi : found) {
    UniformState u;
    u.psi = psi;
    u.rests = psi == 0 && friction->sticks;
    const double s = friction->steady_state(psi);
    if (friction->has_state && std::isfinite(s)) u.state = state_to_output(scene.friction.state, s);
    if (u.rests)
      u.stable = true;
    else
      find_growth(scene, u);
    states.push_back(u);
  }
  return states;
}

}  // namespace stickslip
