// Whether stick-slip grows out of a Hopf point of steady sliding (supercritical) or sliding loses to it by a
// jump (subcritical): the first Lyapunov coefficient.
//
// With x the deviation of all unknowns from sliding, J x its linear rate and B, C the second and third
// derivatives of the rates, which are those of friction and of the state's rate, node by node; J q = i omega
// q and p its left vector, p^T q = 1,
//     c = p^T [ C(q, q, q*) - 2 B(q, J^-1 B(q, q*)) + B(q*, (2 i omega - J)^-1 B(q, q)) ].
// The amplitude a of psi (half of its range at the node that moves most) then obeys, near the point,
//     da/dt = growth a + l a^3,     l = Re c/(8 max |q_psi|^2),
// so that the oscillation born there has a^2 = -growth/l. The unit of l is that of 1/(time velocity^2).
// Uniform motion without a state: l = -A F'''(v)/16.
//
// On a ring of equal nodes a wave of wavenumber k other than 0 crosses with its mirror image. Travelling
// waves and standing ones then both branch off, each with its coefficient (`travelling`, `standing`). With z,
// w the complex amplitudes of the two directions, z' = (i omega + alpha |z|^2 + beta |w|^2) z and the same
// for w; alpha and (alpha + beta)/2 say how sum |z|^2 + |w|^2 grows on either, and the larger of the two is
// the largest of all directions: where it is negative sliding attracts and the wave that has it is the stable
// one, where it is positive that wave leaves by a jump. `coefficient` is that wave's.
//
// Source: Y. A. Kuznetsov, Elements of Applied Bifurcation Theory, 3rd ed., Springer 2004, section 5.4
// (5.62); for waves: M. Golubitsky, I. Stewart and D. G. Schaeffer, Singularities and Groups in Bifurcation
// Theory II, Springer 1988, chapter XVII. Not collective; every rank that calls holds the whole line.
#pragma once

#include <limits>
#include <string>

#include "stickslip/stability/spectrum.hpp"
#include "stickslip/stability/steady_sliding.hpp"

namespace stickslip {

struct Criticality {
  static constexpr double none = std::numeric_limits<double>::quiet_NaN();
  // l of the oscillation that `of` names; NaN where why_not says why
  double coefficient = none;
  double travelling = none, standing = none;  // of both, on a ring with k other than 0
  // uniform, travelling, standing, or mode (of a medium that differs)
  std::string of;
  std::string why_not;

  bool known() const { return coefficient == coefficient; }
  // supercritical, subcritical, or empty.
  std::string word() const { return !known() ? "" : coefficient < 0 ? "supercritical" : "subcritical"; }
};

// Of the mode `m` of J = LinearisedOperator(steady), Im > 0, whose real part is near 0 and is left out.
// `continuum`: the grid plays no part, and the mode is the wave of its wavenumber; its psi may then be empty,
// as it may where J has exact waves. The cost is that of two banded factorisations.
Criticality criticality(const SteadySliding& steady, const LinearisedOperator& J, const Mode& m,
                        bool continuum);

}  // namespace stickslip
