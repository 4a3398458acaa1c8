// The terms of the semi-discrete system and their linearisation at one node.
//
// Every form of the model is, at a node (scene.hpp),
//     psi_t   = A [eta - B psi - F(psi, state)]
//     eta_t   = K0 (v - psi) + K1 D2 psi - s delta [eta - F(psi, state)]
//     state_t = g(psi, state)
// A deviation from a solution obeys the linear system of this header; with -D2 replaced by its symbol kappa^2 it is
// that of a wave of wavenumber kappa in a uniform medium. The Jacobian of Model, the operator about steady sliding, the
// oscillator of travelling waves and the forecast of steps take their coefficients from here; the terms themselves
// stand in src/model/kernel.hpp. A new term of the equations is written in these two files.
//
// Nothing here communicates or allocates. Units: psi is a velocity, eta and F are numbers (forces over the friction
// amplitude), so A has the unit velocity/time, B time/length, K0 1/length, s delta 1/time.
#pragma once

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// Which terms of the right-hand side (pointwise + stencil = wave + reaction = full).
enum class Part {
  full,       // everything
  pointwise,  // everything but K1 D2 psi: the implicit part when friction is implicit
  stencil,    // K1 D2 psi alone, in eta
  wave,       // linear, constant: psi: A (eta - B psi); eta: K0 (v - psi) + K1 D2 psi - s delta eta
  reaction    // psi: -A F; eta: s delta F; state: g
};
inline bool has_stencil(Part part) { return part == Part::full || part == Part::stencil || part == Part::wave; }
inline bool has_friction(Part part) {
  return part == Part::full || part == Part::pointwise || part == Part::reaction;
}

// The Jacobian of a node's own rates by its own unknowns: row_column. eta does not drive the state.
struct NodeBlock {
  double psi_psi = 0, psi_eta = 0, psi_state = 0;
  double eta_psi = 0, eta_eta = 0, eta_state = 0;
  double state_psi = 0, state_state = 0;

  // The rows one behind the other, dof (2 or 3) entries each.
  void write(int dof, double* rows) const;
};

struct LinearPoint {
  double A, B, K0, K1, s_delta;        // of the scene
  double F_psi = 0, F_state = 0;       // times the node's amplitude of friction
  double g_psi = 0, g_state = 0;
  bool has_state = false;

  // The coefficients of a scene; without friction, or with that of a point. `F` includes the amplitude.
  explicit LinearPoint(const Scene& s)
      : A(s.A()), B(s.B()), K0(s.K0()), K1(s.K1()), s_delta(s.s_delta()), has_state(s.friction.has_state()) {}
  LinearPoint(const Scene& s, const Partials& F, const RatePartials& g) : LinearPoint(s) { set(F, g); }
  void set(const Partials& F, const RatePartials& g) {
    F_psi = F.F_psi;
    F_state = F.F_state;
    g_psi = g.g_psi;
    g_state = g.g_state;
  }

  // d(terms `part`)/d(psi, eta, state) of the node itself for a wave with that kappa^2; 0: all nodes alike, or the node
  // with its neighbours left out.
  NodeBlock block(Part part, double kappa2 = 0) const;
  // The same of a node that friction holds at rest (Part::full, pointwise and stencil): psi stays 0, friction is eta.
  NodeBlock block_at_rest(Part part) const;

  // With eta eliminated a deviation obeys  lambda [lambda/A + beta + F_state g_psi/(lambda + r)] + K = 0.
  double stiffness(double kappa2) const { return K0 + K1 * kappa2; }  // K
  double beta() const { return B + s_delta / A + F_psi; }             // resistance; the `a` of a cubic with a state
  double damping() const { return A * (B + F_psi) + s_delta; }        // C = A beta: without a state stable iff C > 0
  double r() const { return -g_state; }                               // rate at which the state relaxes

  // lambda^3 + c2 lambda^2 + c1 lambda + c0 with a state; without, lambda^2 + c2 lambda + c1 and c0 = 0.
  struct Characteristic {
    double c2, c1, c0;
  };
  Characteristic characteristic(double kappa2) const;
  // Whether every root of it lies left of the imaginary axis (Routh and Hurwitz). Where nothing pulls back (K = 0) the
  // root 0, a shift of everything along x, does not count.
  bool stable(double kappa2) const;
};

// Written here, since they stand in the inner loops of Jacobians: linear in the part's terms, wave + reaction = full.
inline NodeBlock LinearPoint::block(Part part, double kappa2) const {
  NodeBlock b;
  if (has_stencil(part)) b.eta_psi = -K1 * kappa2;
  if (part == Part::stencil) return b;
  if (part != Part::reaction) {
    b.psi_psi = -A * B;
    b.psi_eta = A;
    b.eta_psi += -K0;
    b.eta_eta = -s_delta;
  }
  if (!has_friction(part)) return b;
  b.psi_psi -= A * F_psi;
  b.psi_state = -A * F_state;
  b.eta_psi += s_delta * F_psi;
  b.eta_state = s_delta * F_state;
  b.state_psi = g_psi;
  b.state_state = g_state;
  return b;
}

inline NodeBlock LinearPoint::block_at_rest(Part part) const {
  NodeBlock b;
  if (part == Part::stencil) return b;
  b.eta_psi = -K0;
  b.state_psi = g_psi;
  b.state_state = g_state;
  return b;
}

inline void NodeBlock::write(int dof, double* rows) const {
  rows[0] = psi_psi;
  rows[1] = psi_eta;
  rows[dof] = eta_psi;
  rows[dof + 1] = eta_eta;
  if (dof == 2) return;
  rows[2] = psi_state;
  rows[5] = eta_state;
  rows[6] = state_psi;
  rows[7] = 0;
  rows[8] = state_state;
}

inline LinearPoint::Characteristic LinearPoint::characteristic(double kappa2) const {
  const double C = damping(), K = A * stiffness(kappa2) + s_delta * A * B;
  if (!has_state) return {C, K, 0};
  return {C + r(), K + C * r() + A * F_state * g_psi, K * r()};  // r > 0, so that c0 = 0 is K = 0
}

inline bool LinearPoint::stable(double kappa2) const {
  const auto [c2, c1, c0] = characteristic(kappa2);
  if (!has_state) return c2 > 0;
  return c2 > 0 && c1 > 0 && (c0 == 0 || (c0 > 0 && c2 * c1 > c0));
}

}  // namespace stickslip
