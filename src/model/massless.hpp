// The massless chain (m = 0): inertia is gone, and at every moment
//     r(psi) = B psi + a_i F(psi, state) - eta = 0
// says what psi of a node is, from its own eta and state. What is advanced in time is eta and the state; psi
// stands in its place beside them, where the next solution starts from the last one.
//
// The motion goes on along one branch of r's zeros as long as dr/dpsi = B + a_i F_psi > 0. Where that is lost
// psi would have to jump, over no time: then there is no answer, and the node is named (NaN in psi). Between
// the last psi and a far new one the slope is looked at in steps of at most half of psi.
//
// Friction that is steep at rest (a direct effect, ln or asinh of psi) rises with psi at every state, so that
// r has one zero, over any number of decades of psi: it is solved for in ln |psi|, and lies in what a double
// can hold.
//
// Friction that sticks holds psi = 0 while |eta| is within its threshold and begins to slip without a jump
// where sliding friction begins at the threshold (no fs > fd) and B psi rises faster than friction falls
// (jump_at_rest).
//
// Nothing here communicates. eta and F are numbers, psi a velocity.
#pragma once

#include <string>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// One node.
struct MasslessNode {
  const Friction& law;
  double amplitude, B;
  bool back_slip;

  // The zero of r on the branch of `guess`, a zero at other eta and state; NaN where the branch ends before.
  double velocity(double eta, double state, double guess) const;
  // dpsi/deta (value) and dpsi/dstate (slope) there; both 0 at rest.
  struct Slopes {
    double by_eta, by_state;
  };
  Slopes slopes(double psi, double state) const;

 private:
  Partials force(double psi, double state, double direction) const;
  double zero(double eta, double state, double guess, double direction) const;
  double steep_zero(double eta, double state, double guess) const;
  bool rises_between(double from, double to, double state, double direction) const;
};

// "" where every slip of this node begins without a jump, as far as its law alone says; else why not.
std::string jump_at_rest(const MasslessNode& node);

}  // namespace stickslip
