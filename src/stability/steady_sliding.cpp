#include "stickslip/stability/steady_sliding.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/stability/coupling.hpp"

namespace stickslip {

namespace {

// Boundary layers, by deviations u from v: (K0 - K1 D2) u = K1 (D2 to the held nodes)(psi_e - v). The largest
// residual of that equation is returned.
double put_layers(const Scene& s, std::vector<double>& psi) {
  for (const PetscInt i : {PetscInt(0), s.n - 1})
    if (s.held(i)) psi[i] = i == 0 ? s.left_value : s.right_value;
  if (s.mean_K1() == 0 || std::all_of(psi.begin(), psi.end(), [&](double x) { return x == s.v; })) return 0;
  const Coupling coupling(s);
  const std::size_t n = coupling.size();
  if (n == 0) return 0;
  const auto K0 = [&](std::size_t i) { return s.coefficients(coupling.node[i]).K0; };
  std::vector<Complex> b(n, Complex(0));
  for (std::size_t i = 0; i < n; ++i) {
    const PetscInt g = coupling.node[i];
    if (g >= s.order && g < s.n - s.order) continue;
    for (const auto& [column, value] : coupling_row(s, g))
      if (s.held(column)) b[i] += value * (psi[column] - s.v);
  }
  BandLU lu;
  lu.reset(n, coupling.band(), coupling.band());
  for (std::size_t i = 0; i < n; ++i) lu.add(coupling.position(i), coupling.position(i), K0(i));
  coupling.add_to(lu, s.mean_K1());
  if (!std::isfinite(lu.factor().log_abs)) throw Failure("no steady sliding: its equation is singular");
  std::vector<Complex> u = b;
  coupling.solve(lu, u);
  const std::vector<Complex> image = coupling.minus_d2(u);
  double residual = 0;
  for (std::size_t i = 0; i < n; ++i) {
    psi[coupling.node[i]] = s.v + u[i].real();
    residual = std::max(residual, std::abs(b[i] - K0(i) * u[i] - s.mean_K1() * image[i]));
  }
  return residual;
}

// N D2 psi of node i: 0 where sliding is uniform.
double viscous_force(const Scene& s, const std::vector<double>& psi, PetscInt i) {
  if (s.N() == 0 || !s.any_held()) return 0;
  double d2 = 0;
  for (const auto& [column, weight] : second_difference_row(s, i)) d2 += weight * (psi[column] - psi[i]);
  return s.N() * d2;
}

}  // namespace

SteadySliding::SteadySliding(const Scene& s) : scene(s), psi(s.n, s.v) {
  residual = put_layers(s, psi);
  const std::vector<double> amplitude = friction_amplitude(s, 0, s.n);
  const Frictions frictions(s, 0, s.n);
  slopes.resize(psi.size());
  eta.resize(psi.size());
  if (s.friction.has_state()) state.resize(psi.size());
  for (std::size_t i = 0; i < psi.size(); ++i) {
    const bool solved_for = !s.held(i);
    const Friction* const friction = &frictions[i];
    const double x = friction->steady_state(psi[i]);
    const auto place = [&] { return "(x = " + rounded_text(s.x(i), 6) + ")"; };
    if (friction->has_state && !std::isfinite(x))
      throw Failure("no steady sliding: the contact state grows without end at psi = 0 " + place() +
                    "; the plate must move (model_v)");
    if (psi[i] == 0 && friction->sticks && solved_for)
      throw Failure("no steady sliding: at psi = 0 " + place() +
                    " the law sticks; take model_v other than 0, or friction_stick regularised");
    Partials f = friction->partials(psi[i], x);
    const RatePartials g = friction->rate_partials(psi[i], x);
    for (double* part : {&f.F, &f.F_psi, &f.F_state}) *part *= amplitude[i];
    slopes[i] = {f.F_psi, f.F_state, g.g_psi, g.g_state};
    eta[i] = s.coefficients(PetscInt(i)).B * psi[i] + f.F - viscous_force(s, psi, i);
    if (friction->has_state) state[i] = x;
    if (!std::isfinite(eta[i]) || !std::isfinite(f.F_psi))
      throw Failure("no steady sliding: the friction at psi = " + rounded_text(psi[i], 6) + " is not finite");
    if (solved_for) residual = std::max(residual, std::abs(g.g));
  }
}

}  // namespace stickslip
