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
                 decltype(f.law)::van_der_pol && !F::has_state && terms.none(), slopes),
        f_(f), terms_(terms), holds_(what_holds(f)) {}

  double force(double psi, double s) const override { return partials(psi, s).F; }
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
    return terms_.none() ? f_.law.velocity_of_slope(F_psi) : std::nan("");
  }

  Partials sliding_partials(double psi, double s, double direction) const override {
    return sticking<Partials>([&](const auto& f) {
      return with_terms<double>(f.sliding_partials(psi, s, direction), psi, direction * psi);
    });
  }
  RatePartials sliding_rate(double psi, double s, double direction) const override {
    return sticking<RatePartials>([&](const auto& f) { return f.sliding_rate(psi, s, direction); });
  }
  WithSlope threshold(double s) const override {
    return sticking<WithSlope>([&](const auto& f) {
      const WithSlope m = f.factor(s);
      return WithSlope{m.value * holds_, m.slope * holds_};
    });
  }
  double threshold_at_long_rest() const override {
    return sticking<double>([&](const auto& f) { return f.factor_at_long_rest() * holds_; });
  }
  double state_at_rest(double s, double t) const override {
    return sticking<double>([&](const auto& f) { return f.state.at_rest(s, t); });
  }
  double time_at_rest(double s) const override {
    return sticking<double>([&](const auto& f) { return f.state.time_at_rest(s); });
  }

 private:
  template <class R, class Body>
  R sticking(const Body& body) const {
    if constexpr (F::sticks)
      return body(f_);
    else
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
      return f.law.threshold() > drop * slips ? f.law.threshold() : slips;
    }
  }
  F f_;
  NodeTerms terms_;
  double holds_;
};

template <class F>
std::shared_ptr<const Friction> resolved(const F& f, const FrictionParameters& p, double amplitude) {
  return std::make_shared<const Resolved<F>>(
      f, p.terms.over(amplitude), p.regularised ? SlopeBounds{0, 1 / p.eps} : f.law.slope_bounds());
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

// The scales that a law's class declares (law.hpp), for the parameters of a scene.

// And by how much friction that sticks drops as slip begins.
struct DroppingScales : LawScales {
  double drop = 0;
};

struct ScalesFamily {
  using Make = DroppingScales (*)(const FrictionParameters&, const FrictionPlaces&);
  static LawTable<Make>& table();

  // Over the places the least velocity and state, and the largest force; without any, those everywhere.
  template <class L, class S>
  static DroppingScales make(const FrictionParameters& p, const FrictionPlaces& places) {
    return with_friction<L, S>(p, [&](const auto& friction) {
      if (places.empty()) return of(friction);
      const auto along = frictions_along(friction, p, places);
      DroppingScales all = of(along.front());
      for (const auto& f : along) {
        const DroppingScales here = of(f);
        all.drop = std::min(all.drop, here.drop);
        if (here.velocity > 0) all.velocity = std::min(all.velocity, here.velocity);
        all.force = std::max(all.force, here.force);
        all.state = std::min(all.state, here.state);
        all.length = std::min(all.length, here.length);
      }
      return all;
    });
  }

 private:
  template <class F>
  static DroppingScales of(const F& f) {
    DroppingScales scales{f.law.scales()};
    if constexpr (F::sticks)
      scales.drop = std::max(0., f.law.threshold() - f.law.phi(0., SignFrozen{1}).value);
    return scales;
  }
};

}  // namespace stickslip
