// How fast the parts of a scene act, for steps in time (model.hpp), and how far (reach.hpp).
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/reach.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/springs.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

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

}  // namespace stickslip
