// Laws of one velocity, which may have a state law beside them; and laws with a state law of their own.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "model/law.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// phi = psi^3/3 - psi, equation (4) of the paper.
struct Cubic : LawDefaults {
  static constexpr const char* name = "cubic";
  static constexpr bool jumps_at_rest = false;
  static constexpr bool van_der_pol = true;
  static std::vector<Declared<Cubic>> parameters() { return {}; }

  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign) const {
    return {psi * (psi * psi * (1. / 3) - 1), psi * psi - 1};
  }
  SlopeBounds slope_bounds() const { return {0, 3}; }  // at psi = 2, where the limit cycle turns
  double velocity_of_slope(double slope) const { return std::sqrt(1 + slope); }
};

// phi = (1 - sigma) sgn(psi)/(1 + 2 alpha |psi|/(1 - sigma)); equation (2) of the paper is sigma = 0, alpha =
// 1/2.

// 1/(1 + y) with its slope; against the direction of motion (y < 0) its Taylor polynomial, which joins it
// smoothly enough for methods of order 5 and has no pole for a stage to run into.
template <class Real>
WithSlopeOf<Real> falling(Real y) {
  const Real w = 1 / (1 + y);
  const Real value = y < 0 ? 1 - y * (1 - y * (1 - y * (1 - y))) : w;
  const Real slope = y < 0 ? -1 + y * (2 - y * (3 - y * 4)) : -w * w;
  return {value, slope};
}

struct CarlsonLanger : LawDefaults {
  static constexpr const char* name = "carlson-langer";
  static constexpr bool jumps_at_rest = true;
  double sigma = 0, alpha = 0.5;
  static std::vector<Declared<CarlsonLanger>> parameters() {
    using R = Parameter::Range;
    return {{&CarlsonLanger::sigma,
             {"sigma", "0", R::not_negative, "",
              "carlson-langer: friction drops from 1 to 1 - sigma as motion begins"}},
            {&CarlsonLanger::alpha,
             {"alpha", "0.5", R::not_negative, "",
              "carlson-langer: (1 - sigma)/(1 + 2 alpha |psi|/(1 - sigma))"}}};
  }
  void check() const {
    if (sigma >= 1)
      throw UsageError("-friction_sigma " + number_text(sigma) + ": below 1, or nothing is left of friction");
  }

  double threshold() const { return 1; }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    // what is left of the threshold, and its fall
    const double kinetic = 1 - sigma, weakening = 2 * alpha / kinetic;
    const WithSlopeOf<Real> s = sign.sign_slope(psi), a = sign.magnitude(psi);
    if constexpr (std::is_same_v<Sign, SignFrozen>) {
      const WithSlopeOf<Real> f = falling(weakening * a.value);
      return {s.value * kinetic * f.value, s.value * kinetic * weakening * a.slope * f.slope};
    }
    const Real w = 1 / (1 + weakening * a.value), k = kinetic * w;
    return {s.value * k, (s.slope - s.value * weakening * a.slope * w) * k};
  }
  LawScales scales() const { return {alpha > 0 ? (1 - sigma) / (2 * alpha) : 0, 1, 1}; }
  SlopeBounds slope_bounds() const { return {2 * alpha, 0}; }  // at the start of a slip
  double velocity_of_slope(double slope) const {
    return (std::sqrt(2 * alpha / -slope) - 1) * (1 - sigma) / (2 * alpha);
  }
};

// Static threshold fs, dynamic friction fd sgn(psi). Regularised, friction falls from fs to fd like
// exp(-|psi|/slip_velocity).
struct Coulomb : LawDefaults {
  static constexpr const char* name = "coulomb";
  static constexpr bool jumps_at_rest = true;
  double fs = 1, fd = 0.5, slip_velocity = 1e-2;
  static std::vector<Declared<Coulomb>> parameters() {
    using R = Parameter::Range;
    return {{&Coulomb::fs,
             {"fs", "1", R::positive, "", "coulomb, stribeck, slip-weakening, lugre: static friction"}},
            {&Coulomb::fd,
             {"fd", "0.5", R::not_negative, "",
              "coulomb, slip-weakening: dynamic friction, at most friction_fs"}},
            {&Coulomb::slip_velocity,
             {"slip_velocity", "1e-2", R::positive, "velocity",
              "coulomb, regularised: velocity over which fs falls to fd", "", "", true}}};
  }
  void check() const {
    if (fd > fs)
      throw UsageError("-friction_fd " + number_text(fd) +
                       ": dynamic friction must not exceed the static threshold " + "friction_fs " +
                       number_text(fs));
  }

  LawScales scales() const { return {0, fs, 1}; }
  double threshold() const { return fs; }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    using elementary::exp;
    const WithSlopeOf<Real> s = sign.sign_slope(psi);
    if constexpr (!Sign::smooth) return {fd * s.value, fd * s.slope};
    const WithSlopeOf<Real> a = sign.magnitude(psi);
    const Real e = (fs - fd) * exp(-a.value / slip_velocity), f = fd + e;
    return {f * s.value, f * s.slope - e * a.slope / slip_velocity * s.value};
  }
};

// phi = (fc + (fs - fc) exp(-|psi/vs|^p)) sgn(psi) + viscous psi: Stribeck's curve, a threshold fs, friction
// that falls to fc over the velocity vs and rises with lubrication (R. Stribeck, VDI-Zeitschrift 46 (1902);
// in this form B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, Automatica 30 (1994) 1083).

// exp(-|a/vs|^p) with its slope in a; against the direction of motion (a < 0) it goes on as smoothly as |a|^p
// lets it: p = 1 rises on, up to e.
template <class Real>
WithSlopeOf<Real> stribeck_fall(Real a, double vs, double p) {
  using elementary::exp, elementary::log, elementary::where_less, elementary::value_of, std::abs;
  constexpr double least = 1e-300;  // at rest the logarithm is finite, and |u|^p 0
  const double side = p == 1 ? elementary::sign_of(value_of(a)) : 1;
  const Real u = abs(a) / vs, l = log(where_less(u, least, Real(least), u));
  const Real power = exp((p - 1) * l);  // |u|^(p - 1)
  const Real w = side * u * power;
  const Real e = exp(where_less(-w, 1, Real(-w), Real(1.)));
  return {e, -e * p * power * (p == 1 ? 1 : elementary::sign_of(value_of(a))) / vs};
}

struct Stribeck : LawDefaults {
  static constexpr const char* name = "stribeck";
  static constexpr bool jumps_at_rest = true;
  double fc = 0.5, fs = 1, vs = 1, p = 2, viscous = 0;
  static std::vector<Declared<Stribeck>> parameters() {
    using R = Parameter::Range;
    using L = Stribeck;
    return {
        {&L::fc, {"fc", "0.5", R::not_negative, "", "stribeck, tanh, lugre, dahl: Coulomb's friction"}},
        {&L::fs, {"fs", "1", R::positive, "", ""}},
        {&L::vs,
         {"vs", "1", R::positive, "velocity",
          "stribeck, lugre: velocity over which fs falls to fc (Stribeck's); tanh: over which it rises"}},
        {&L::p, {"p", "2", R::positive, "", "stribeck: exponent of the fall, at least 1"}},
        {&L::viscous, {"viscous", "0", R::not_negative, "1/velocity", "stribeck: friction per velocity"}}};
  }
  void check() const {
    if (p < 1)
      throw UsageError("-friction_p " + number_text(p) +
                       ": at least 1, below it friction is infinitely steep at rest");
  }

  LawScales scales() const { return {vs, fs > fc ? fs : fc, 1}; }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    const WithSlopeOf<Real> s = sign.sign_slope(psi), a = sign.magnitude(psi);
    const WithSlopeOf<Real> fall = stribeck_fall(a.value, vs, p);
    const Real f = fc + (fs - fc) * fall.value;
    return {s.value * f + viscous * psi, s.slope * f + s.value * a.slope * (fs - fc) * fall.slope + viscous};
  }
  SlopeBounds slope_bounds() const {  // steepest where |psi/vs|^p = (p - 1)/p
    const double at = (p - 1) / p, steepest = p * std::pow(at, at) * std::exp(-at) * (fs - fc) / vs;
    return {std::max(steepest - viscous, 0.), std::max(-steepest, 0.) + viscous};
  }
};

// phi = fc tanh(psi/vs): Coulomb's friction smoothed over the velocity vs, without a threshold.
struct Tanh : LawDefaults {
  static constexpr const char* name = "tanh";
  static constexpr bool jumps_at_rest = false;
  double fc = 0.5, vs = 1;
  static std::vector<Declared<Tanh>> parameters() {
    using R = Parameter::Range;
    return {{&Tanh::fc, {"fc", "0.5", R::not_negative, "", ""}},
            {&Tanh::vs, {"vs", "1", R::positive, "velocity", ""}}};
  }

  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign) const {
    using elementary::tanh;
    const Real t = tanh(psi / vs);
    return {fc * t, fc * (1 - t * t) / vs};
  }
  LawScales scales() const { return {vs, fc > 0 ? fc : 1, 1}; }
  SlopeBounds slope_bounds() const { return {0, fc / vs}; }  // at rest
};

// With a state law of their own: what has slipped, or how far bristles are bent.

// Slip weakening: F = [fd + (fs - fd) exp(-s/Dc)] sgn(psi), where s is the slip since the contact was at
// rest, or linear, F = [fd + (fs - fd) max(0, 1 - s/Dc)] sgn(psi), which has a kink at s = Dc (Y. Ida, J.
// Geophys. Res. 77 (1972) 3796; D. J. Andrews, ibid. 81 (1976) 5679), or straight between the points of a
// table. What becomes of s: it is forgotten over the time t_h, s_t = |psi| - s/t_h; or it counts from the
// last stop, s_t = |psi| and 0 at every stop; or it is forgotten at rest alone, s_t = |psi| in motion and
// -s/t_h at rest. The last two have no steady value in motion but without bound.
inline constexpr Parameter forgetting_time{"t_h", "1", Parameter::Range::positive, "time",
                                           "slip-weakening: time in which slip is forgotten"};

struct SlipMemory : StateDefaults {
  static constexpr const char *name = "slip-memory", *symbol = "slip", *unit = "length";
  static constexpr const char* meaning = "contact state: slip since rest";
  static constexpr bool logarithmic = false;
  static constexpr bool of_its_law = true;
  double t_h = 1;
  static std::vector<Declared<SlipMemory>> parameters() {
    return {{&SlipMemory::t_h, forgetting_time}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    return {direction * psi - s / t_h, direction, -1 / t_h};
  }
  double steady_state(double psi) const { return std::abs(psi) * t_h; }
  double at_rest(double s, double t) const { return s * std::exp(-t / t_h); }
  double time_at_rest(double) const { return t_h; }
};

// Without bound where it goes on growing.
inline double slip_without_end(double psi) {
  return psi == 0 ? 0 : std::numeric_limits<double>::infinity();
}

struct SlipSinceStop : StateDefaults {
  static constexpr const char *name = "slip-since-stop", *symbol = "slip", *unit = "length";
  static constexpr const char* meaning = "contact state: slip since the last stop";
  static constexpr bool logarithmic = false;
  static constexpr bool of_its_law = true, needs_stops = true, renewed_at_stops = true;
  static std::vector<Declared<SlipSinceStop>> parameters() { return {}; }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real, double direction) const {
    return {direction * psi, direction, 0.};
  }
  double steady_state(double psi) const { return slip_without_end(psi); }
  double at_rest(double s, double) const { return s; }
  double time_at_rest(double) const { return std::numeric_limits<double>::infinity(); }
};

struct SlipHealedAtRest : StateDefaults {
  static constexpr const char *name = "slip-healed-at-rest", *symbol = "slip", *unit = "length";
  static constexpr const char* meaning = "contact state: slip that rest has not healed";
  static constexpr bool logarithmic = false;
  static constexpr bool of_its_law = true, needs_stops = true;
  double t_h = 1;
  static std::vector<Declared<SlipHealedAtRest>> parameters() {
    return {{&SlipHealedAtRest::t_h, forgetting_time}};
  }

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real s, double direction) const {
    const double heals = (1 - direction * direction) / t_h;
    return {direction * psi - s * heals, direction, -heals};
  }
  double steady_state(double psi) const { return slip_without_end(psi); }
  double at_rest(double s, double t) const { return s * std::exp(-t / t_h); }
  double time_at_rest(double) const { return t_h; }
};

// Strength against slip, straight between the points; the first and the last value hold beyond them.
class StrengthTable {
 public:
  // What is wrong with `points`, and at which of them; "" where nothing is.
  static std::string fault(const Points& points, std::size_t& at);
  explicit StrengthTable(const Points& points);

  template <class Real>
  WithSlopeOf<Real> operator()(Real s) const {
    using elementary::where_less;
    Real value = first_, slope = 0;
    for (const Piece& p : pieces_) {
      const Real within = s - p.from, begun = where_less(within, 0, Real(0.), within);
      value = value + p.slope * where_less(begun, p.length, begun, Real(p.length));
      slope = slope + where_less(within, 0, Real(0.), where_less(within, p.length, Real(p.slope), Real(0.)));
    }
    return {value, slope};
  }
  double at_rest() const { return first_; }
  double largest() const { return largest_; }
  double last_slip() const { return pieces_.back().from + pieces_.back().length; }

 private:
  struct Piece {
    double from, length, slope;
  };
  std::vector<Piece> pieces_;
  double first_, largest_;
};

struct SlipWeakening : LawDefaults {
  static constexpr const char* name = "slip-weakening";
  static constexpr bool jumps_at_rest = true, has_factor = true, takes_points = true;
  using State = Types<SlipMemory, SlipSinceStop, SlipHealedAtRest>;
  double fs = 1, fd = 0.5, Dc = 1, weakening = 0;
  std::shared_ptr<const StrengthTable> table;
  static std::vector<Declared<SlipWeakening>> parameters() {
    using R = Parameter::Range;
    using L = SlipWeakening;
    const auto of_formula = [](Parameter p) {
      p.only_with = {"friction_weakening", "exponential linear"};
      return p;
    };
    Parameter strength{"strength", "", R::curve, "length",
                       "slip-weakening, friction_weakening table: strength against slip, "
                       "slip1:strength1,slip2:strength2,... or a file of two columns, straight between them"};
    strength.fault = StrengthTable::fault;
    strength.only_with = {"friction_weakening", "table"};
    return {{&L::fs, of_formula({"fs", "1", R::positive, "", ""})},
            {&L::fd, of_formula({"fd", "0.5", R::not_negative, "", ""})},
            {&L::Dc, of_formula({"Dc", "1", R::positive, "length",
                                 "slip-weakening: slip over which fs falls to fd"})},
            {&L::weakening,
             {"weakening", "exponential", R::word, "", "slip-weakening: how friction falls with slip", "", "",
              false, "exponential linear table"}},
            {nullptr, strength}};
  }
  void take(const Points& points) {
    if (weakening != in_table) return;
    if (points.empty())
      throw UsageError(
          "friction_weakening table: -friction_strength is missing, slip1:strength1,slip2:strength2,... or "
          "a file of two columns");
    table = std::make_shared<const StrengthTable>(points);
  }
  void check() const {
    if (weakening != in_table && fd > fs)
      throw UsageError("-friction_fd " + number_text(fd) +
                       ": dynamic friction must not exceed the static threshold friction_fs " +
                       number_text(fs));
  }

  LawScales scales() const {
    if (table) return {0, table->largest(), table->last_slip(), table->last_slip()};
    return {0, fs, Dc, Dc};
  }
  template <class Real, class Sign>
  WithSlopeOf<Real> phi(Real psi, Sign sign) const {
    return sign.sign_slope(psi);
  }
  template <class Real>
  WithSlopeOf<Real> factor(Real s) const {
    using elementary::exp, elementary::where_less;
    if (table) return (*table)(s);
    const double linear = weakening;
    const Real u = s / Dc, e = exp(-u);
    const Real straight = where_less(u, 1, Real(1 - u), Real(0.)),
               falls = where_less(u, 1, Real(1.), Real(0.));
    const double drop = fs - fd;
    return {fd + drop * (linear * straight + (1 - linear) * e),
            -drop / Dc * (linear * falls + (1 - linear) * e)};
  }
  double factor_at_long_rest() const { return table ? table->at_rest() : fs; }

 private:
  static constexpr double in_table = 2;
};

// Friction by bristles that bend: LuGre's law, z_t = psi - |psi| z/g(psi) with g = [fc + (fs - fc)
// exp(-(psi/vs)^2)]/sigma0 and F = sigma0 z + sigma1 z_t + sigma2 psi (C. Canudas de Wit, H. Olsson, K. J.
// Astrom and P. Lischinsky, IEEE Trans. Automat. Control 40 (1995) 419). The deflection z has either sign and
// is 0 in a fresh contact. There is no threshold: at rest friction is a spring sigma0.

// The rate, which needs the law's parameters, stands with the laws.
struct Bristles : StateDefaults {
  static constexpr const char *name = "bristles", *symbol = "z", *unit = "length";
  static constexpr const char* meaning = "contact state: deflection of the bristles";
  static constexpr bool logarithmic = false;
  static constexpr bool of_its_law = true;
  static std::vector<Declared<Bristles>> parameters() { return {}; }
};

// Of a law L with sigma0, sigma1, sigma2 and largest(psi), the deflection g of steady motion with its slope.
template <class L>
struct OfBristles : LawDefaults {
  static constexpr bool jumps_at_rest = false;
  static constexpr bool takes_state = true, has_rate = true;
  using State = Bristles;

  template <class Real>
  RatePartialsOf<Real> rate_partials(Real psi, Real z, double direction) const {
    const WithSlopeOf<Real> g = law().largest(psi);
    const Real speed = direction * psi, bent = z / g.value;
    return {psi - speed * bent, 1 - direction * bent + speed * bent * g.slope / g.value, -speed / g.value};
  }
  template <class Real>
  PartialsOf<Real> partials(Real psi, Real z) const {
    const double s0 = law().sigma0, s1 = law().sigma1, s2 = law().sigma2;
    const RatePartialsOf<Real> z_t =
        rate_partials(psi, z, elementary::sign_or_zero(elementary::value_of(psi)));
    return {s0 * z + s1 * z_t.g + s2 * psi, s1 * z_t.g_psi + s2, s0 + s1 * z_t.g_state};
  }
  double steady_state(double psi) const { return elementary::sign_or_zero(psi) * law().largest(psi).value; }

 private:
  const L& law() const { return static_cast<const L&>(*this); }
};

struct LuGre : OfBristles<LuGre> {
  static constexpr const char* name = "lugre";
  double fc = 0.5, fs = 1, vs = 1, sigma0 = 100, sigma1 = 1, sigma2 = 0;
  static std::vector<Declared<LuGre>> parameters() {
    using R = Parameter::Range;
    using L = LuGre;
    return {
        {&L::fc, {"fc", "0.5", R::not_negative, "", ""}},
        {&L::fs, {"fs", "1", R::positive, "", ""}},
        {&L::vs, {"vs", "1", R::positive, "velocity", ""}},
        {&L::sigma0, {"sigma0", "100", R::positive, "1/length", "lugre, dahl: stiffness of the bristles"}},
        {&L::sigma1, {"sigma1", "1", R::not_negative, "1/velocity", "lugre: damping of the bristles"}},
        {&L::sigma2, {"sigma2", "0", R::not_negative, "1/velocity", "lugre: viscous friction"}}};
  }
  void check() const {
    if (fc == 0)
      throw UsageError("-friction_fc 0: above 0 with this law, or the bristles have no deflection at speed");
  }
  LawScales scales() const { return {vs, fs > fc ? fs : fc, fc / sigma0, fc / sigma0}; }
  template <class Real>
  WithSlopeOf<Real> largest(Real psi) const {
    const WithSlopeOf<Real> fall = stribeck_fall(psi, vs, 2);
    return {(fc + (fs - fc) * fall.value) / sigma0, (fs - fc) / sigma0 * fall.slope};
  }
};

// Dahl's friction, z_t = psi (1 - sgn(psi) sigma0 z/fc), F = sigma0 z: a spring that yields at fc (P. Dahl,
// AIAA J. 14 (1976) 1675). It depends on the path alone, not on how fast it is gone.
struct Dahl : OfBristles<Dahl> {
  static constexpr const char* name = "dahl";
  static constexpr double sigma1 = 0, sigma2 = 0;
  double fc = 0.5, sigma0 = 100;
  static std::vector<Declared<Dahl>> parameters() {
    using R = Parameter::Range;
    return {{&Dahl::fc, {"fc", "0.5", R::not_negative, "", ""}},
            {&Dahl::sigma0, {"sigma0", "100", R::positive, "1/length", ""}}};
  }
  void check() const {
    if (fc == 0)
      throw UsageError("-friction_fc 0: above 0 with this law, or the bristles have no deflection");
  }
  LawScales scales() const { return {0, fc, fc / sigma0, fc / sigma0}; }
  template <class Real>
  WithSlopeOf<Real> largest(Real) const {
    return {fc / sigma0, 0.};
  }
};

}  // namespace stickslip
