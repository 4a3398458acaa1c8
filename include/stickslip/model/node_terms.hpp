// Forces on a node beside its friction that depend on its own psi: a term of the equations is a member, its
// option, and its lines of beside(). Whatever asks for friction has them with it (friction.hpp): loops,
// Jacobians, solves, cells, moving frames, tangents, the forecast of steps.
//
// They stand beside F in both equations; the friction amplitude a_i multiplies F and not them. All are 0 at
// rest, so that thresholds are those of friction; where the velocity passes 0 their slopes may have a corner
// (FrictionParameters::smooth), and closed forms of a law give way to them.
//
// Nothing here communicates. Forces are over f0 or gamma, as F is.
#pragma once

namespace stickslip {

struct NodeTerms {
  double drag = 0;  // c3, 1/velocity^2

  template <class Options>
  static NodeTerms from(const Options& o) {
    return {o.real("model_drag")};
  }
  bool none() const { return drag == 0; }
  // Over an amplitude that will multiply them as it does F.
  NodeTerms over(double amplitude) const { return {drag / amplitude}; }
  // Adds the forces at psi to F, their slopes to F_psi. `speed`: |psi|, or psi times the direction of motion
  // where that is given, in which all is smooth. Real: a number, or one that carries derivatives.
  template <class Real>
  void beside(const Real& psi, const Real& speed, Real& F, Real& F_psi) const {
    F = F + drag * psi * speed;
    F_psi = F_psi + 2 * drag * speed;
  }
};

}  // namespace stickslip
