// How fast the parts of a scene act, for steps in time (model.hpp), and how far (reach.hpp).
#include <algorithm>
#include <cmath>

#include "stickslip/model/frictions.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/reach.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

// B + F_psi of sliding at psi = v, of the first node; B, or 1, where that is not a positive number.
double sliding_resistance(const Scene& s) {
  const Frictions frictions(s, 0, 1);
  const Friction& law = frictions[0];
  const double b = s.B() + law.partials(s.v, law.steady_state(s.v)).F_psi;
  return b > 0 && std::isfinite(b) ? b : s.B() > 0 ? s.B() : 1;
}

}  // namespace

double wave_frequency(const Scene& s) {
  const double kappa2 = s.n * s.copies > 1 ? largest_symbol(s.order, s.form == Form::chain ? 1 : s.h()) : 0;
  if (s.massless()) return (s.K0() + s.K1() * kappa2) / sliding_resistance(s);
  return std::sqrt(s.A() * (s.K0() + s.K1() * kappa2));
}

double own_frequency(const Scene& s) {
  return s.massless() ? s.K0() / sliding_resistance(s) : std::sqrt(s.A() * s.K0());
}

double viscous_rate(const Scene& s) {
  return s.n * s.copies > 1 ? s.A() * s.N() * largest_symbol(s.order, s.form == Form::chain ? 1 : s.h()) : 0;
}

double nodes_to_forget(const Scene& s) {
  if (s.K1() == 0) return 0;
  return 45 / (2 * std::asinh((s.form == Form::chain ? 1 : s.h()) * std::sqrt(s.K0() / s.K1()) / 2));
}

double stencil_rate(const Scene& s) { return std::max(wave_frequency(s), viscous_rate(s)); }

}  // namespace stickslip
