// A law with its state law and parameters as the class Friction.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "model/dispatch.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip {

// The class F of law.hpp behind virtual functions.
template <class F>
class Resolved final : public Friction {
 public:
  // `terms`: beside it, over the node's amplitude.
  Resolved(const F& f, const NodeTerms& terms, SlopeBounds slopes)
      : Friction(F::has_state, F::sticks, F::steep,
                 traits::van_der_pol<decltype(f.law)> && !F::has_state && terms.none(), slopes),
        f_(f), terms_(terms), holds_(what_holds(f)) {}

  double force(double psi, double s) const override {
    return with_terms<double>({f_.force(psi, s), 0, 0}, psi, std::abs(psi)).F;
  }
  Partials partials(double psi, double s) const override {
    return with_terms<double>(f_.partials(psi, s), psi, std::abs(psi));
  }
  RatePartials rate_partials(double psi, double s) const override { return f_.rate_partials(psi, s); }
  HigherPartials higher_partials(double psi, double s) const override {
    const Jet x = Jet::of_x(psi), y = Jet::of_y(s);
    const PartialsOf<Jet> f = with_terms<Jet>(f_.partials(x, y), x, abs(x));
    const RatePartialsOf<Jet> g = f_.rate_partials(x, y);
    const auto of = [](const Jet& by_psi, const Jet& by_state) {
      return HigherDerivatives{by_psi.x, by_psi.y, by_state.y, by_psi.xx, by_psi.xy, by_psi.yy, by_state.yy};
    };
    return {of(f.F_psi, f.F_state), of(g.g_psi, g.g_state)};
  }
  double steady_state(double psi) const override { return f_.steady_state(psi); }
  double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const override {
    if constexpr (F::steep) {  // terms weigh there like more mass
      const double slope = with_terms<double>({0, 0, 0}, psi, std::abs(psi)).F_psi;
      return f_.newton_psi(psi, s, psi_new, s_new, mass + slope);
    } else {
      return psi_new;
    }
  }
  double velocity_of_slope(double F_psi) const override {
    return terms_.none() ? traits::velocity_of_slope(f_.law, F_psi) : std::nan("");
  }

  Partials sliding_partials(double psi, double s, double direction) const override {
    if constexpr (F::sticks)
      return with_terms<double>(f_.sliding_partials(psi, s, direction), psi, direction * psi);
    else
      return refuse<Partials>();
  }
  RatePartials sliding_rate(double psi, double s, double direction) const override {
    if constexpr (F::sticks)
      return f_.sliding_rate(psi, s, direction);
    else
      return refuse<RatePartials>();
  }
  WithSlope threshold(double s) const override {
    if constexpr (!F::sticks) {
      return refuse<WithSlope>();
    } else if constexpr (F::has_state) {
      const WithSlope m = f_.factor(s);
      return {m.value * holds_, m.slope * holds_};
    } else {
      return {holds_, 0};
    }
  }
  double threshold_at_long_rest() const override {
    if constexpr (!F::sticks)
      return refuse<double>();
    else if constexpr (F::has_state)
      return f_.factor_at_long_rest() * holds_;
    else
      return holds_;
  }
  double state_at_rest(double s, double t) const override {
    if constexpr (!F::sticks)
      return refuse<double>();
    else if constexpr (F::has_state)
      return f_.state.at_rest(s, t);
    else
      return 0;
  }
  double time_at_rest(double s) const override {
    if constexpr (!F::sticks)
      return refuse<double>();
    else if constexpr (F::has_state)
      return f_.state.time_at_rest(s);
    else
      return 0;
  }

 private:
  template <class R>
  [[noreturn]] static R refuse() {
    throw std::logic_error("this law does not stick");
  }
  template <class Real>
  PartialsOf<Real> with_terms(PartialsOf<Real> p, const Real& psi, const Real& speed) const {
    terms_.beside(psi, speed, p.F, p.F_psi);
    return p;
  }
  // Of phi: what the node begins to slip against, the larger of both directions, to the last bit, but where
  // the law drops from more, by more than round-off: what begins to slip with a friction beyond what held it
  // would stop at once, and begin again, without end.
  static double what_holds(const F& f) {
    if constexpr (!F::sticks) {
      return 0;
    } else {
      constexpr double drop = 1 + 1e-12;
      const double slips = std::max(f.law.phi(0., SignFrozen{1}).value, -f.law.phi(0., SignFrozen{-1}).value);
      if constexpr (traits::drops<decltype(f.law)>)
        if (f.law.threshold() > drop * slips) return f.law.threshold();
      return slips;
    }
  }
  F f_;
  NodeTerms terms_;
  double holds_;
};

template <class F>
std::shared_ptr<const Friction> resolved(const F& f, const FrictionParameters& p, double amplitude) {
  return std::make_shared<const Resolved<F>>(
      f, p.terms.over(amplitude), p.regularised ? SlopeBounds{0, 1 / p.eps} : traits::slope_bounds(f.law));
}

struct FrictionFamily {
  using List = std::vector<std::shared_ptr<const Friction>>;
  using Make = List (*)(const FrictionParameters&, const FrictionPlaces&);
  static LawTable<Make>& table();

  // At each of the places; without any, the one everywhere.
  template <class L, class S>
  static List make(const FrictionParameters& p, const FrictionPlaces& places) {
    return with_friction<L, S>(p, [&](const auto& friction) {
      if (places.empty()) return List{resolved(friction, p, 1)};
      List list;
      for (const auto& f : frictions_along(friction, p, places))
        list.push_back(resolved(f, p, places[list.size()].amplitude));
      return list;
    });
  }
};

}  // namespace stickslip
