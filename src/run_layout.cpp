// What the file of a run says of its scene.
#include <algorithm>
#include <cmath>

#include "stickslip/file.hpp"
#include "stickslip/friction.hpp"

namespace stickslip {

namespace {

// Velocities for the table of friction: every hundredth up to 4, and both signs of 1e-12 ... 1e3, twelve a decade, for
// laws that live on a logarithmic axis.
std::vector<double> table_velocities() {
  std::vector<double> psi;
  for (int k = -400; k <= 400; ++k) psi.push_back(k / 100.0);
  for (int k = -144; k <= 36; ++k)
    for (const double sign : {-1.0, 1.0}) psi.push_back(sign * std::pow(10.0, k / 12.0));
  std::sort(psi.begin(), psi.end());
  psi.erase(std::unique(psi.begin(), psi.end()), psi.end());
  return psi;
}

// Routh and Hurwitz for uniform sliding at psi = v. With K = K0 + K1 kappa^2 the characteristic polynomial of a mode is
// lambda^2 + c1 lambda + c0 without a state (c0 = A K > 0), and with one
// lambda^3 + c2 lambda^2 + c1 lambda + c0, whose conditions c2 > 0, c0 > 0, c2 c1 > c0 are linear in K: it is enough
// to look at both ends of its range.
bool stable_sliding(const Scene& scene, const Partials& F, const RatePartials& g, bool has_state) {
  const double A = scene.A(), sd = scene.s_delta(), damping = A * (scene.B() + F.F_psi) + sd;
  if (!has_state) return damping > 0;
  const double kappa2 = 4 * (scene.order >= 8 ? 1 + 1. / 3 + 8. / 45 + 4. / 35
                             : scene.order == 6 ? 1 + 1. / 3 + 8. / 45
                             : scene.order == 4 ? 1 + 1. / 3
                                                : 1.0) / (scene.h() * scene.h());
  const double r = -g.g_state, coupling = A * F.F_state * g.g_psi;
  for (const double K : {scene.K0(), scene.K0() + scene.K1() * kappa2}) {
    // rows: psi, eta, state;  eta's row is -K psi - sd (eta - F), with A (eta - B psi - F) in psi's
    const double c2 = damping + r;
    const double c1 = A * K + damping * r + coupling + sd * A * scene.B();
    const double c0 = A * K * r;
    if (!(c2 > 0 && c0 > 0 && c2 * c1 > c0)) return false;
  }
  return true;
}

}  // namespace

RunLayout RunLayout::of(const Scene& scene) {
  RunLayout layout;
  for (PetscInt i = 0; i < scene.n; ++i) layout.x.push_back(scene.x(i));
  layout.fields = {standard_field("psi"), standard_field("eta")};
  const StateLaw state = scene.friction.state;
  if (state != StateLaw::none) layout.fields.push_back(standard_field(state_name(state)));
  layout.numbers = {{"A", scene.A()},   {"B", scene.B()},           {"K0", scene.K0()},
                    {"K1", scene.K1()}, {"s_delta", scene.s_delta()}, {"v", scene.v}};
  dispatch_friction(scene.friction, [&](const auto& friction) {
    const bool has_state = friction.has_state;
    for (const double psi : table_velocities()) {
      const double s = friction.steady_state(psi), F = friction.force(psi, s);
      if (!std::isfinite(F)) continue;  // theta at rest has no steady value
      layout.friction_psi.push_back(psi);
      layout.friction_F.push_back(F);
    }
    const double s = friction.steady_state(scene.v);
    // a law with a threshold has no slope at rest
    const bool sliding = scene.v != 0 || scene.friction.regularised || scene.friction.law == Law::cubic;
    if (std::isfinite(s) && sliding) {
      const Partials F = friction.partials(scene.v, s);
      layout.numbers["steady_eta"] = scene.B() * scene.v + F.F;
      layout.numbers["steady_stable"] = stable_sliding(scene, F, friction.rate_partials(scene.v, s), has_state);
    }
  });
  return layout;
}

}  // namespace stickslip
