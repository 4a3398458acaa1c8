// What acts at a node beside its damping B psi: friction, with the terms beside it (node_terms.hpp). Loops
// over nodes and Friction ask here alone.
#pragma once

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "stickslip/model/friction.hpp"

namespace stickslip {

template <class F>  // a class of law.hpp
struct NodeFriction {
  static constexpr bool has_state = F::has_state, sticks = F::sticks, steep = F::steep;
  F friction;
  NodeTerms terms;  // over the node's amplitude

  template <class Real>
  PartialsOf<Real> with_terms(PartialsOf<Real> p, const Real& psi, const Real& speed) const {
    terms.beside(psi, speed, p.F, p.F_psi);
    return p;
  }
  double force(double psi, double s) const {
    return with_terms<double>({friction.force(psi, s), 0, 0}, psi, std::abs(psi)).F;
  }
  template <class Real>
  PartialsOf<Real> partials(const Real& psi, const Real& s) const {
    using std::abs;
    return with_terms<Real>(friction.partials(psi, s), psi, abs(psi));
  }
  Partials sliding_partials(double psi, double s, double direction) const {
    return with_terms<double>(friction.sliding_partials(psi, s, direction), psi, direction * psi);
  }
  template <class Real>
  RatePartialsOf<Real> rate_partials(const Real& psi, const Real& s) const {
    return friction.rate_partials(psi, s);
  }
  RatePartials sliding_rate(double psi, double s, double direction) const {
    return friction.sliding_rate(psi, s, direction);
  }
  double rate(double psi, double s) const { return friction.rate(psi, s); }
  // Terms weigh there like more mass.
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    const double slope = with_terms<double>({0, 0, 0}, psi, std::abs(psi)).F_psi;
    return friction.newton_psi(psi, s, psi_new, s_new, mass + slope);
  }
};

namespace kernel {

// Friction with parameters of its own at every node, or the same at all where terms stand beside it. Own: a
// law alone, or NodeFriction. The loops take it in place of one law, which friction_of() hands on as it is: a
// scene without profiles and terms runs the same instructions as if there were none.
template <class Own>
struct Varying {
  static constexpr bool has_state = Own::has_state, sticks = Own::sticks, steep = Own::steep,
                        looks_up = false;
  std::shared_ptr<const std::vector<Own>> nodes;
};
template <class F>
const F& friction_of(const F& friction, std::ptrdiff_t) {
  return friction;
}
template <class F>
const F& friction_of(const Varying<F>& friction, std::ptrdiff_t node) {
  return (*friction.nodes)[static_cast<std::size_t>(node)];
}
template <class F>
const NodeFriction<F>& friction_of(const Varying<NodeFriction<F>>& friction, std::ptrdiff_t node) {
  const std::vector<NodeFriction<F>>& nodes = *friction.nodes;
  return nodes[nodes.size() == 1 ? 0 : static_cast<std::size_t>(node)];
}

}  // namespace kernel

}  // namespace stickslip
