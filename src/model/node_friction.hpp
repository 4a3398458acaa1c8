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

// Any friction, behind its virtual functions: terms stand beside it in loops that are compiled once for all
// laws and are no vector code.
template <bool state, bool is_smoothed, bool is_steep>
struct AnyFriction {
  static constexpr bool has_state = state, sticks = true, smoothed = is_smoothed, steep = is_steep;
  std::shared_ptr<const Friction> own;

  Partials partials(double psi, double s) const { return own->partials(psi, s); }
  Partials sliding_partials(double psi, double s, double direction) const {
    return own->sliding_partials(psi, s, direction);
  }
  RatePartials rate_partials(double psi, double s) const { return own->rate_partials(psi, s); }
  RatePartials sliding_rate(double psi, double s, double direction) const {
    return own->sliding_rate(psi, s, direction);
  }
  double rate(double psi, double s) const { return own->rate(psi, s); }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const {
    return own->newton_psi(psi, s, psi_new, s_new, mass);
  }
};

namespace kernel {

// Friction of its own at every node, a law or AnyFriction; of AnyFriction also the same at all. The loops
// take it in place of one law, which friction_of() hands on as it is: a scene without profiles and terms runs
// the same instructions as if there were none.
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
template <bool... flags>
const AnyFriction<flags...>& friction_of(const Varying<AnyFriction<flags...>>& friction,
                                         std::ptrdiff_t node) {
  const std::vector<AnyFriction<flags...>>& nodes = *friction.nodes;
  return nodes[nodes.size() == 1 ? 0 : static_cast<std::size_t>(node)];
}

}  // namespace kernel

}  // namespace stickslip
