// Friction laws F(psi, state) and their kinetic equations state_t = g(psi, state), as the program uses them.
//
// Laws of one velocity (F = phi without a state, else times a factor of the state):
//     cubic            phi = psi^3/3 - psi                                    (the paper's equation 4)
//     carlson-langer   phi = (1 - sigma) sgn(psi)/(1 + 2 alpha |psi|/(1 - sigma))   (equation 2: sigma 0,
//                                                                                   alpha 1/2)
//     coulomb          phi = fd sgn(psi), regularised with a peak of fs
//     table            phi from measured points, a monotone piecewise cubic between them
//     rate-and-state   F = a asinh[ psi/(2 psi0) exp((mu0 + b ln(psi0 theta/D))/a) ]
// State laws:
//     healing      F = tau phi,  tau_t = (tau_inf - tau)/t_h - (|psi|/D)(tau - 1)
//     contact-age  F = (1 + b ln(1 + theta/theta0)) phi,  theta_t = 1 - |psi| theta/D
//     ageing       rate-and-state,  theta_t = 1 - |psi| theta/D
//     slip         rate-and-state,  theta_t = -(|psi| theta/D) ln(|psi| theta/D)
// Regularised: sgn(psi) -> tanh(psi/eps), |psi| -> psi tanh(psi/eps). On the exact sliding branch sgn(0) = 0.
//
// A law is a class, in src/model/laws/ or a file of its own, and stands in the list src/model/law_list.hpp; a
// state law likewise (docs/developers/adding.md). Nothing outside src/model names one: `Law` and `StateLaw`
// hold what the class says of itself, `Friction` is a law with its state law and parameters, resolved once.
// Loops over nodes are compiled for each class (src/model/loops.hpp).
//
// The state s that is stored and advanced is tau itself for `healing`, and ln(theta) for the laws in theta,
// so that theta stays positive over any number of decades; state_to_output() gives what files and pictures
// show.
//
// Nothing here communicates. F is a force over the common friction amplitude, a number; psi is a velocity; g
// has the unit of the stored state over time.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stickslip/model/medium.hpp"
#include "stickslip/model/node_terms.hpp"

namespace stickslip {

// Of any number type: double, or one that carries derivatives (src/numerics/elementary.hpp).
template <class Real>
struct PartialsOf {
  Real F, F_psi, F_state;
};
template <class Real>
struct RatePartialsOf {
  Real g, g_psi, g_state;
};
// A value and its derivative with respect to psi (or, where it is said, the state).
template <class Real>
struct WithSlopeOf {
  Real value, slope;
};
using Partials = PartialsOf<double>;
using RatePartials = RatePartialsOf<double>;
using WithSlope = WithSlopeOf<double>;

// Second and third derivatives of a function of psi and the stored state.
struct HigherDerivatives {
  double pp = 0, ps = 0, ss = 0, ppp = 0, pps = 0, pss = 0, sss = 0;
};
struct HigherPartials {
  HigherDerivatives F, g;
};

// Slopes |F_psi| that the motion may meet although it does not now, where friction falls and where it rises
// with velocity; 0 where there is nothing steeper ahead than what is met. Steps in time are chosen with them.
struct SlopeBounds {
  double falling = 0, rising = 0;
};

// One parameter of a law or state law, as its class declares it.
using Points = std::vector<std::pair<double, double>>;
struct Parameter {
  // word: the member holds its number, 0 for the first; curve: points, which the class takes whole
  enum class Range { positive, not_negative, word, curve };
  const char* name;   // without the family: "fs" is the option friction_fs, or state_fs of a state law
  const char* value;  // by default
  Range range;
  const char* unit;
  const char* help;
  // what -help shows in place of the default, where that may follow another option
  const char* default_help = "";
  // option that means the same and is taken where it alone is set, e.g. "state_D"
  const char* same_as = "";
  bool regularised = false;  // has no meaning with exact stick
  const char* words = "";    // of Range::word, separated by blanks
  // of Range::curve: what is wrong with points, and at which of them; "" where nothing is
  std::string (*fault)(const Points& points, std::size_t& at) = nullptr;
  // has a meaning with one of these words of that option alone; of none: always
  struct OnlyWith {
    const char *option, *words;
  } only_with = {"", ""};
};

// What a state law's class says of itself.
struct StateTraits {
  std::string name;                   // as in the option state_law
  std::string symbol, unit, meaning;  // of what files show: tau, theta, with what it is; "" for none
  bool logarithmic = false;           // the stored state is ln(theta)
  std::vector<Parameter> parameters;  // options state_<name>
  bool needs_stops = false;           // nodes stop and rest: with exact stick alone
};

// A state law by its name; cheap to copy. Throws std::logic_error where the list holds no such name.
class StateLaw {
 public:
  StateLaw() : StateLaw("none") {}
  StateLaw(const char* name) : StateLaw(std::string(name)) {}
  StateLaw(const std::string& name);
  const StateTraits* operator->() const { return traits_; }
  bool none() const { return traits_->symbol.empty(); }
  friend bool operator==(StateLaw a, StateLaw b) { return a.traits_ == b.traits_; }
  friend bool operator!=(StateLaw a, StateLaw b) { return !(a == b); }

 private:
  const StateTraits* traits_;
};

// What a law's class says of itself.
struct LawTraits {
  std::string name;                   // as in the option friction_law
  bool jumps_at_rest;                 // F may take any value up to a threshold at psi = 0
  int continuous_derivatives;         // of phi in psi; a large number where it is smooth
  std::string only_for;               // velocities for which alone it holds, in words; "" for all
  std::vector<Parameter> parameters;  // options friction_<name>
  std::vector<StateLaw> states;       // that may accompany it; the first is taken by default
  // of a law that may do without the jump: whether it does, with these points
  bool (*continuous_at_rest)(const Points&) = nullptr;
};

// A law by its name, likewise.
class Law {
 public:
  Law() : Law("cubic") {}
  Law(const char* name) : Law(std::string(name)) {}
  Law(const std::string& name);
  const LawTraits* operator->() const { return traits_; }
  friend bool operator==(Law a, Law b) { return a.traits_ == b.traits_; }
  friend bool operator!=(Law a, Law b) { return !(a == b); }

 private:
  const LawTraits* traits_;
};

const std::vector<Law>& all_laws();             // in the order of the list
const std::vector<StateLaw>& all_state_laws();  // with none, first
bool belong_together(Law law, StateLaw state);  // whether a scene may have the two together
std::string to_string(Law law);
std::string to_string(StateLaw law);

// The choice of a law and its parameters, as a scene holds it.
struct FrictionParameters {
  Law law;
  StateLaw state;
  bool regularised = false;              // sgn(psi) -> tanh(psi/eps); false: the exact sliding branch
  double eps = 1e-3;                     // velocity of the regularisation
  bool back_slip = true;                 // exact stick: false lets no force drive a stuck node backwards
  std::map<std::string, double> values;  // parameters that are set, by option name, e.g. friction_fs
  std::map<std::string, ProfileAlongX> profiles;  // of those that differ along x, in place of their values
  Points curve;                                   // velocity and force, of the law `table`
  NodeTerms terms;                                // what stands beside the law

  bool has_state() const { return !state.none(); }
  // At psi = 0 friction takes any value up to a threshold, or does so when it is not regularised.
  bool jumps_at_rest() const {
    return law->jumps_at_rest && !(law->continuous_at_rest && law->continuous_at_rest(curve));
  }
  bool sticks() const { return jumps_at_rest() && !regularised; }  // exactly
  bool piecewise() const;  // a derivative that methods of high order rely on jumps at some velocities
  // Methods of high order keep it at every velocity: neither a threshold, nor pieces, nor terms beside the
  // law, whose slopes may have a corner at rest.
  bool smooth() const;
  bool varies() const { return !profiles.empty(); }  // along x
  // The parameter's profile; nullptr where it is the same everywhere.
  const ProfileAlongX* profile(const std::string& option) const;
  // The parameter of that option name: as set, else its default. 0 where neither law has it.
  double value(const std::string& option) const;
};

// A place along x at which friction is asked for, with its amplitude there; and with the coefficients of the
// node there, where these differ along x (of interest to the loops over nodes alone).
struct FrictionPlace {
  double x = 0, amplitude = 1;
  std::optional<NodeCoefficients> medium = std::nullopt;
};
using FrictionPlaces = std::vector<FrictionPlace>;

// A law with its state law and parameters, and with it, over the amplitude, the terms that stand beside it
// (node_terms.hpp): F is the sum. Friction that `sticks` has a threshold and is not regularised: at psi = 0
// it takes any value up to the threshold (stick.hpp), and elsewhere it is called with the direction of motion
// given, +1 or -1, so that it is smooth through psi = 0.
class Friction {
 public:
  // Where the amplitude is 1. Throws UsageError where the parameters contradict each other, and where they
  // vary along x: there is no one friction then.
  static std::shared_ptr<const Friction> of(const FrictionParameters& parameters);
  // At each of the places. Throws UsageError where the parameters of one contradict each other.
  static std::vector<std::shared_ptr<const Friction>> along(const FrictionParameters& parameters,
                                                            const FrictionPlaces& places);
  virtual ~Friction() = default;

  const bool has_state, sticks;
  const bool steep;        // at rest: too steep for explicit methods and for Newton's own steps (newton_psi)
  const bool van_der_pol;  // the cubic without a state, whose closed formulas hold
  const bool renewed_at_stops;  // a node that stops has the state 0 again
  const SlopeBounds slope_bounds;

  virtual double force(double psi, double s) const = 0;
  virtual Partials partials(double psi, double s) const = 0;
  virtual RatePartials rate_partials(double psi, double s) const = 0;  // zeros without a state
  // By automatic differentiation of the two above; on the side of psi = 0 where psi is.
  virtual HigherPartials higher_partials(double psi, double s) const = 0;
  double rate(double psi, double s) const { return rate_partials(psi, s).g; }
  virtual double steady_state(double psi) const = 0;  // the s at which g = 0; infinite where there is none

  // Where friction is steep: in place of Newton's step from (psi, s) to (psi_new, s_new) for
  // mass psi + F(psi, s) = given, the psi to go to; else psi_new.
  virtual double newton_psi(double psi, double s, double psi_new, double s_new, double mass) const = 0;
  // |psi| > 0 at which F_psi has this value, by a closed formula; NaN where there is none.
  virtual double velocity_of_slope(double F_psi) const = 0;

  // Of friction that sticks; std::logic_error for other. `direction`: 1, -1, or 0 at rest.
  virtual Partials sliding_partials(double psi, double s, double direction) const = 0;
  virtual RatePartials sliding_rate(double psi, double s, double direction) const = 0;
  // the force that holds a node, and its slope in the state
  virtual WithSlope threshold(double s) const = 0;
  virtual double threshold_at_long_rest() const = 0;  // infinite where it grows without end
  // what becomes of s after the time t at psi = 0
  virtual double state_at_rest(double s, double t) const = 0;
  // over which the threshold of a resting node changes
  virtual double time_at_rest(double s) const = 0;

 protected:
  Friction(bool state, bool stick, bool is_steep, bool cubic, bool renewed, SlopeBounds slopes)
      : has_state(state), sticks(stick), steep(is_steep), van_der_pol(cubic), renewed_at_stops(renewed),
        slope_bounds(slopes) {}
};

// What the stored state means outside: tau itself, or theta = exp(s).
double state_to_output(StateLaw law, double s);
double state_from_output(StateLaw law, double shown);
inline bool state_is_logarithmic(StateLaw law) { return law->logarithmic; }
inline const std::string& state_name(StateLaw law) { return law->symbol; }

}  // namespace stickslip
