// The terms of the semi-discrete system and their linearisation at one node.
//
// Every form of the model is, at a node (scene.hpp),
//     psi_t   = A [eta + N D2 psi - B psi - F(psi, state)]
//     eta_t   = K0 (v - psi) + K1 D2 psi - s delta [eta + N D2 psi - F(psi, state)]
//     state_t = g(psi, state)
// A deviation from a solution obeys the linear system of this header; with -D2 replaced by its symbol kappa^2
// it is that of a wave of wavenumber kappa in a uniform medium. The Jacobian of Model, the operator about
// steady sliding, the oscillator of travelling waves and the forecast of steps take their coefficients from
// here; the terms themselves stand in src/model/kernel.hpp. A new term of the equations is written in these
// two files.
//
// At a given lambda eta and the state of a node follow from its psi and what drives it, so that J - lambda is
// solved by one equation a node, coupled by (K1 + lambda N) D2 alone (`diagonal`, `condense`, `expand`).
//
// Without mass (scene.massless(), A infinite) the first equation is eta = B psi + F, and psi is no unknown: a
// deviation obeys
//     eta_t = -K psi, state_t = g_psi psi + g_state state,  psi = (eta - F_state state)/(B + F_psi)
// (`massless_block`), the relations in lambda are those above with 1/A = 0, and B + F_psi > 0 is asked for
// everywhere.
//
// Nothing here communicates or allocates. Units: psi is a velocity, eta and F are numbers (forces over the
// friction amplitude), so A has the unit velocity/time, B time/length, K0 1/length, s delta 1/time; N kappa^2
// has that of B.
#pragma once

#include <cmath>
#include <complex>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// Which terms of the right-hand side (pointwise + stencil = wave + reaction = full).
enum class Part {
  full,       // everything
  pointwise,  // everything but D2 psi: the implicit part when friction is implicit
  stencil,    // psi: A N D2 psi; eta: (K1 - s delta N) D2 psi
  // linear, constant: psi: A (e - B psi); eta: K0 (v - psi) + K1 D2 psi - s delta e; e = eta + N D2 psi
  wave,
  reaction  // psi: -A F; eta: s delta F; state: g
};
inline bool has_stencil(Part part) {
  return part == Part::full || part == Part::stencil || part == Part::wave;
}
inline bool has_friction(Part part) {
  return part == Part::full || part == Part::pointwise || part == Part::reaction;
}
// what is linear in psi and eta of the node itself
inline bool has_linear(Part part) { return part != Part::stencil && part != Part::reaction; }

// The Jacobian of a node's own rates by its own unknowns: row_column. eta does not drive the state.
struct NodeBlock {
  double psi_psi = 0, psi_eta = 0, psi_state = 0;
  double eta_psi = 0, eta_eta = 0, eta_state = 0;
  double state_psi = 0, state_state = 0;

  // The rows one behind the other, dof (2 or 3) entries each.
  void write(int dof, double* rows) const { write(dof, rows, std::size_t(dof), 1, 0); }
  // beta times it, and alpha on its diagonal, the rows `width` apart; besides added in the column of psi.
  void write(int dof, double* rows, std::size_t width, double beta, double alpha, double psi_by_psi = 0,
             double eta_by_psi = 0) const;
};

// The same without mass, of eta and the state.
struct MasslessBlock {
  double eta_eta, eta_state, state_eta, state_state;

  // The rows one behind the other, dof (1 or 2) entries each.
  void write(int dof, double* rows) const;
};

// A deviation of a node's unknowns, or a right-hand side for them.
struct NodeVector {
  std::complex<double> psi = 0, eta = 0, state = 0;
};

// What friction and its kinetic equation do to a deviation; F includes the node's amplitude.
struct FrictionSlopes {
  double F_psi = 0, F_state = 0, g_psi = 0, g_state = 0;
  bool operator==(const FrictionSlopes& o) const {
    return F_psi == o.F_psi && F_state == o.F_state && g_psi == o.g_psi && g_state == o.g_state;
  }
};

struct LinearPoint : FrictionSlopes {
  using Complex = std::complex<double>;

  double A, B, K0, K1, N, s_delta;  // of the scene
  bool has_state = false;

  // The coefficients of a scene; without friction, or with that of a point. `F` includes the amplitude.
  explicit LinearPoint(const Scene& s)
      : A(s.A()), B(s.B()), K0(s.K0()), K1(s.K1()), N(s.N()), s_delta(s.s_delta()),
        has_state(s.friction.has_state()) {}
  LinearPoint(const Scene& s, const Partials& F, const RatePartials& g) : LinearPoint(s) { set(F, g); }
  // Those of a node; where links differ K1 is their mean.
  LinearPoint(const Scene& s, PetscInt node) : LinearPoint(s, s.coefficients(node)) {}
  LinearPoint(const Scene& s, const NodeCoefficients& c)
      : A(c.A), B(c.B), K0(c.K0), K1(s.mean_K1()), N(s.N()), s_delta(c.s_delta),
        has_state(s.friction.has_state()) {}
  void set(const Partials& F, const RatePartials& g) { set({F.F_psi, F.F_state, g.g_psi, g.g_state}); }
  void set(const FrictionSlopes& slopes) { static_cast<FrictionSlopes&>(*this) = slopes; }

  // d(terms `part`)/d(psi, eta, state) of the node itself for a wave with that kappa^2; 0: all nodes alike,
  // or the node with its neighbours left out.
  NodeBlock block(Part part, double kappa2 = 0) const;
  // The same of a node that friction holds at rest (Part::full, pointwise and stencil): psi stays 0, friction
  // is eta.
  NodeBlock block_at_rest(Part part) const;

  // Without mass, of a wave with that kappa^2.
  MasslessBlock massless_block(double kappa2) const;
  bool massless() const { return std::isinf(A); }

  // With eta and the state eliminated a deviation obeys  lambda [lambda/A + beta + N kappa^2 + q/(lambda +
  // r)] + K = 0.
  double stiffness(double kappa2) const { return K0 + K1 * kappa2; }  // K
  // resistance; the `a` of a cubic with a state
  double beta() const { return B + s_delta / A + F_psi; }
  // C = A (beta + N kappa^2): without a state stable iff C > 0
  double damping(double kappa2 = 0) const { return A * (B + F_psi) + s_delta + A * N * kappa2; }
  // How fast that stiffness alone would turn or relax a node: sqrt(A K); without mass the modulus of the
  // roots.
  double rate_of(double K) const {
    if (!massless()) return std::sqrt(A * K);
    return has_state ? std::sqrt(std::abs(K * r() / beta())) : K / std::abs(beta());
  }
  double r() const { return -g_state; }         // rate at which the state relaxes
  double q() const { return F_state * g_psi; }  // what acts through the state
  // Resistance to slow changes of a uniform motion, b = B + s delta/A + dF_ss/dv.
  double slow_beta() const { return has_state ? beta() + q() / r() : beta(); }

  // That relation without K and N, as a function of lambda, and its derivative. J - lambda is singular where
  // lambda = -r.
  Complex diagonal(Complex lambda) const;
  Complex diagonal_slope(Complex lambda) const;
  // (J - lambda) y = b:  -(diagonal + K0 - (K1 + lambda N) D2) y.psi = condense(b),  y = expand(y.psi, b), to
  // whose eta -N D2 y.psi is to be added. With b = 0: an eigenvector.
  Complex condense(Complex lambda, const NodeVector& b) const;
  NodeVector expand(Complex lambda, Complex psi, const NodeVector& b = {}) const;
  // The same for the transposed (not conjugated) J - lambda, in eta:
  // -(diagonal + K0 - (K1 + lambda N) D2^T) y.eta = condense_transposed(b) - N D2^T b.eta
  Complex condense_transposed(Complex lambda, const NodeVector& b) const;
  NodeVector expand_transposed(Complex lambda, Complex eta, const NodeVector& b) const;

  // lambda^3 + c2 lambda^2 + c1 lambda + c0 with a state; without, lambda^2 + c2 lambda + c1 and c0 = 0.
  // Without mass one power less: lambda^2 + c1 lambda + c0, or lambda + c1, and c2 = 0.
  struct Characteristic {
    double c2, c1, c0;
  };
  Characteristic characteristic(double kappa2) const;
  // Whether every root of it lies left of the imaginary axis (Routh and Hurwitz). Where nothing pulls back (K
  // = 0) the root 0, a shift of everything along x, does not count.
  bool stable(double kappa2) const;
};

// Written here, since they stand in the inner loops of Jacobians: linear in the part's terms, wave + reaction
// = full.
inline NodeBlock LinearPoint::block(Part part, double kappa2) const {
  NodeBlock b;
  if (has_stencil(part)) {
    b.psi_psi = -A * N * kappa2;
    b.eta_psi = (s_delta * N - K1) * kappa2;
  }
  if (has_linear(part)) {
    b.psi_psi -= A * B;
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

inline void NodeBlock::write(int dof, double* psi, std::size_t width, double beta, double alpha,
                             double psi_by_psi, double eta_by_psi) const {
  double *const eta = psi + width, *const state = eta + width;
  psi[0] = beta * psi_psi + alpha + psi_by_psi;
  psi[1] = beta * psi_eta;
  eta[0] = beta * eta_psi + eta_by_psi;
  eta[1] = beta * eta_eta + alpha;
  if (dof == 2) return;
  psi[2] = beta * psi_state;
  eta[2] = beta * eta_state;
  state[0] = beta * state_psi;
  state[1] = 0;
  state[2] = beta * state_state + alpha;
}

inline MasslessBlock LinearPoint::massless_block(double kappa2) const {
  const double resistance = B + F_psi, pull = stiffness(kappa2) / resistance;
  return {-pull, pull * F_state, g_psi / resistance, g_state - g_psi * F_state / resistance};
}

inline void MasslessBlock::write(int dof, double* rows) const {
  rows[0] = eta_eta;
  if (dof == 1) return;
  rows[1] = eta_state;
  rows[2] = state_eta;
  rows[3] = state_state;
}

inline LinearPoint::Complex LinearPoint::diagonal(Complex lambda) const {
  Complex c = beta();
  if (has_state) c += q() / (lambda + r());
  return lambda * (lambda / A + c);
}

inline LinearPoint::Complex LinearPoint::diagonal_slope(Complex lambda) const {
  Complex c = 2. * lambda / A + beta();
  if (has_state) c += q() * r() / ((lambda + r()) * (lambda + r()));
  return c;
}

// The first and the last row of (J - lambda) y = b give
//     state = (g_psi psi - b_state)/(lambda + r),   eta = b_psi/A + (lambda/A + B + F_psi) psi + F_state
//                                                   state.
inline LinearPoint::Complex LinearPoint::condense(Complex lambda, const NodeVector& b) const {
  Complex c = b.eta + (s_delta + lambda) * b.psi / A;
  if (has_state) c -= lambda * F_state * b.state / (lambda + r());
  return c;
}

inline NodeVector LinearPoint::expand(Complex lambda, Complex psi, const NodeVector& b) const {
  NodeVector y{psi, b.psi / A + (lambda / A + B + F_psi) * psi};
  if (has_state) {
    y.state = (g_psi * psi - b.state) / (lambda + r());
    y.eta += F_state * y.state;
  }
  return y;
}

// The second and the last column of J - lambda, transposed, give
//     psi = (b_eta + (s delta + lambda) eta)/A,   state = -(F_state (b_eta + lambda eta) + b_state)/(lambda +
//                                                 r).
inline LinearPoint::Complex LinearPoint::condense_transposed(Complex lambda, const NodeVector& b) const {
  Complex c = b.psi + (B + F_psi + lambda / A) * b.eta;
  if (has_state) c += g_psi * (F_state * b.eta + b.state) / (lambda + r());
  return c;
}

inline NodeVector LinearPoint::expand_transposed(Complex lambda, Complex eta, const NodeVector& b) const {
  NodeVector y{(b.eta + (s_delta + lambda) * eta) / A, eta};
  if (has_state) y.state = -(F_state * (b.eta + lambda * eta) + b.state) / (lambda + r());
  return y;
}

inline LinearPoint::Characteristic LinearPoint::characteristic(double kappa2) const {
  if (massless()) {
    const MasslessBlock b = massless_block(kappa2);
    if (!has_state) return {0, -b.eta_eta, 0};
    return {0, -b.eta_eta - b.state_state, b.eta_eta * b.state_state - b.eta_state * b.state_eta};
  }
  const double C = damping(kappa2), K = A * stiffness(kappa2) + s_delta * A * B;
  if (!has_state) return {C, K, 0};
  return {C + r(), K + C * r() + A * F_state * g_psi, K * r()};  // r > 0, so that c0 = 0 is K = 0
}

inline bool LinearPoint::stable(double kappa2) const {
  const auto [c2, c1, c0] = characteristic(kappa2);
  if (massless()) return B + F_psi > 0 && (has_state ? c1 > 0 && c0 >= 0 : c1 >= 0);
  if (!has_state) return c2 > 0;
  return c2 > 0 && c1 > 0 && (c0 == 0 || (c0 > 0 && c2 * c1 > c0));
}

}  // namespace stickslip
