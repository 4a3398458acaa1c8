#include "stickslip/model/friction.hpp"

#include <cmath>
#include <cstdlib>

#include "base/failure.hpp"
#include "model/dispatch.hpp"

namespace stickslip {

namespace {

template <class T>
std::vector<Parameter> parameters_of() {
  std::vector<Parameter> list;
  for (const auto& declared : T::parameters()) list.push_back(declared.parameter);
  return list;
}

const std::vector<StateTraits>& state_table() {
  static const std::vector<StateTraits> table = [] {
    std::vector<StateTraits> all;
    for_each_type(StateLaws(), [&](auto state) {
      using S = typename std::decay_t<decltype(state)>::type;
      all.push_back({S::name, S::symbol, S::unit, S::meaning, S::logarithmic, parameters_of<S>()});
    });
    return all;
  }();
  return table;
}

const std::vector<LawTraits>& law_table() {
  static const std::vector<LawTraits> table = [] {
    std::vector<LawTraits> all;
    for_each_type(Laws(), [&](auto law) {
      using L = typename std::decay_t<decltype(law)>::type;
      LawTraits traits{L::name,
                       traits::jumps_at_rest<L>(),
                       traits::continuous_derivatives<L>(),
                       traits::only_for<L>(),
                       parameters_of<L>(),
                       {}};
      if constexpr (traits::takes_points<L>) traits.continuous_at_rest = L::continuous_at_rest;
      for_each_type(StateLaws(), [&](auto state) {
        using S = typename std::decay_t<decltype(state)>::type;
        const bool usual = traits::usual_state<L>() == std::string(S::name);
        if (classes_belong_together<L, S>())
          traits.states.emplace(usual ? traits.states.begin() : traits.states.end(), S::name);
      });
      all.push_back(traits);
    });
    return all;
  }();
  return table;
}

template <class Traits>
const Traits* find(const std::vector<Traits>& table, const std::string& name) {
  for (const Traits& traits : table)
    if (traits.name == name) return &traits;
  throw std::logic_error("no law is called " + name);
}

template <class Handle, class Traits>
std::vector<Handle> handles(const std::vector<Traits>& table) {
  std::vector<Handle> all;
  for (const Traits& traits : table) all.emplace_back(traits.name);
  return all;
}

// The class F of law.hpp behind virtual functions.
template <class F>
class Resolved final : public Friction {
 public:
  // `terms`: beside it, over the node's amplitude.
  Resolved(const F& f, const NodeTerms& terms, SlopeBounds slopes)
      : Friction(F::has_state, F::sticks, F::steep,
                 traits::van_der_pol<decltype(f.law)> && !F::has_state && terms.none(), slopes),
        f_(f), terms_(terms) {}

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
    if constexpr (!F::sticks)
      return refuse<WithSlope>();
    else if constexpr (F::has_state) {
      const WithSlope m = f_.factor(s);
      return {m.value * f_.law.threshold(), m.slope * f_.law.threshold()};
    } else {
      return {f_.law.threshold(), 0};
    }
  }
  double threshold_at_long_rest() const override {
    if constexpr (!F::sticks)
      return refuse<double>();
    else if constexpr (F::has_state)
      return f_.factor_at_long_rest() * f_.law.threshold();
    else
      return f_.law.threshold();
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
  F f_;
  NodeTerms terms_;
};

}  // namespace

StateLaw::StateLaw(const std::string& name) : traits_(find(state_table(), name)) {}
Law::Law(const std::string& name) : traits_(find(law_table(), name)) {}

const std::vector<Law>& all_laws() {
  static const std::vector<Law> laws = handles<Law>(law_table());
  return laws;
}
const std::vector<StateLaw>& all_state_laws() {
  static const std::vector<StateLaw> laws = handles<StateLaw>(state_table());
  return laws;
}
bool belong_together(Law law, StateLaw state) {
  return std::find(law->states.begin(), law->states.end(), state) != law->states.end();
}
std::string to_string(Law law) { return law->name; }
std::string to_string(StateLaw law) { return law->name; }

double FrictionParameters::value(const std::string& option) const {
  const Parameter* own = nullptr;
  const std::pair<const char*, const std::vector<Parameter>*> families[] = {{"friction_", &law->parameters},
                                                                            {"state_", &state->parameters}};
  for (const auto& [family, parameters] : families)
    for (const Parameter& p : *parameters) {
      const std::string name = family + std::string(p.name);
      if (p.same_as == option) return value(name);  // one quantity under two names: the law's stands above
      if (name == option) own = &p;
    }
  if (!own) return 0;
  for (const std::string& name : {option, std::string(own->same_as)}) {
    const auto set = values.find(name);
    if (set != values.end()) return set->second;
  }
  return std::strtod(own->value, nullptr);
}

bool FrictionParameters::smooth() const { return !jumps_at_rest() && !piecewise() && terms.none(); }

bool FrictionParameters::piecewise() const {
  constexpr int of_highest_order = 9;
  return law->continuous_derivatives < of_highest_order;
}

const ProfileAlongX* FrictionParameters::profile(const std::string& option) const {
  if (profiles.empty()) return nullptr;
  std::string name = option;
  for (const Parameter& p : law->parameters)  // one quantity under two names, as in value()
    if (p.same_as == option) name = "friction_" + std::string(p.name);
  const auto found = profiles.find(name);
  return found == profiles.end() ? nullptr : &found->second;
}

namespace {

template <class F>
std::shared_ptr<const Friction> resolved(const F& f, const FrictionParameters& p, double amplitude) {
  return std::make_shared<const Resolved<F>>(
      f, p.terms.over(amplitude), p.regularised ? SlopeBounds{0, 1 / p.eps} : traits::slope_bounds(f.law));
}

}  // namespace

std::shared_ptr<const Friction> Friction::of(const FrictionParameters& p) {
  if (p.varies())
    throw usage_error("{}_profile: what is asked for here needs friction that is the same everywhere",
                      p.profiles.begin()->first);
  return dispatch_friction<std::shared_ptr<const Friction>>(p,
                                                            [&](const auto& f) { return resolved(f, p, 1); });
}

std::vector<std::shared_ptr<const Friction>> Friction::along(const FrictionParameters& p,
                                                             const FrictionPlaces& places) {
  using List = std::vector<std::shared_ptr<const Friction>>;
  return dispatch_friction<List>(p, [&](const auto& friction) {
    List list;
    for (const auto& f : frictions_along(friction, p, places))
      list.push_back(resolved(f, p, places[list.size()].amplitude));
    return list;
  });
}

double state_to_output(StateLaw law, double s) { return law->logarithmic ? std::exp(s) : s; }
double state_from_output(StateLaw law, double shown) { return law->logarithmic ? std::log(shown) : shown; }

}  // namespace stickslip
