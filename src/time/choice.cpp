#include "time/methods.hpp"

#include <cmath>

#include "base/failure.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/options/library_options.hpp"
#include "stickslip/time/stick.hpp"
#include "time/sliding_step.hpp"

namespace stickslip {

std::string to_string(Implicit implicit) {
  switch (implicit) {
    case Implicit::friction: return "friction";
    case Implicit::wave: return "wave";
    case Implicit::both: return "both";
    default: return "none";
  }
}

PartsOfStep parts_of(Implicit implicit) {
  switch (implicit) {
    case Implicit::friction: return {Part::stencil, Part::pointwise};
    case Implicit::wave: return {Part::reaction, Part::wave};
    case Implicit::both: return {std::nullopt, Part::full};
    default: return {Part::full, std::nullopt};
  }
}

bool user_set(const std::string& prefix, const std::string& option) {
  PetscBool set;
  const std::string name = "-" + name_in_database(option);
  SS_TRY(PetscOptionsHasName(nullptr, prefix.c_str(), name.c_str(), &set));
  return set;
}

namespace {

// The rate of friction over the velocities that a run will meet, not at the start alone.
double friction_rate_ahead(const Model& model, Vec u) {
  double rate = model.friction_rate(u);
  const Scene& s = model.scene();
  const SlopeBounds ahead = model.slope_bounds();
  const double steepest = std::max(ahead.falling, ahead.rising);
  const double normal = s.normal.varies() ? s.normal.largest() : 1;
  if (steepest > 0) rate = std::max(rate, model.largest_resistance(normal * steepest));
  if (model.dof() == 3 && s.v != 0) {
    double fastest = 0;
    for (PetscInt i = 0; i < (s.friction.varies() ? model.local() : 1); ++i)
      fastest = std::max(fastest, -model.state_rate(i, s.v, model.steady_state(i, s.v)).g_state);
    rate = std::max(rate, s.friction.varies() ? largest_over(model.comm(), fastest) : fastest);
  }
  return rate;
}

// Without mass eta_t depends on psi alone, and psi on friction: there is nothing to split.
Implicit massless_implicit(const std::string& type, const Capabilities& can, const std::string& wish,
                           bool stiff) {
  if (wish == "friction" || wish == "wave")
    throw UsageError("imex_implicit " + wish +
                     ": with model_m 0 friction and the springs' forces are one term, through psi; " +
                     "use both or none");
  if (can.kicks)
    throw UsageError("ts_type " + type +
                     ": it splits friction from the springs' forces, which with model_m 0 are one term, "
                     "through psi; use rk, arkimex, rosw or another one-step method");
  if (can.remembers)
    throw UsageError("ts_type " + type +
                     ": it remembers psi of earlier steps, which with model_m 0 is no unknown; use rk, "
                     "arkimex, rosw or another one-step method");
  if (can.is_explicit) return Implicit::none;
  return !can.splits || wish == "both" || (wish == "auto" && stiff) ? Implicit::both
                                                                                 : Implicit::none;
}

// `stiff`: or an implicit method that the user named.
void fit_massless(const Model& model, Choice& choice, const Capabilities& can, const MethodSpec& spec,
                  bool stiff) {
  choice.implicit = massless_implicit(choice.type, can, spec.implicit, stiff);
  if (can.is_explicit && SlidingStep::applies_to(model)) return;
  if (choice.named_fused)
    throw usage_error("ts_type {}: of model_m 0 it supports explicit steps of rate-and-state friction alone; "
                      "use ts_type {}",
                      can.fused_type, choice.type);
  choice.fused = false;
}

// A Rosenbrock step is made for equations that do not depend on time: without the rate of change of what
// does, which the library does not ask for, its order falls.
void refuse_rosenbrock(const Choice& choice, const Capabilities& can, const char* what) {
  if (can.linearises) throw usage_error("ts_type {}: it does not follow {}; use arkimex", choice.type, what);
}

// Friction changes with time between the stages of a step too, which the library's own steps of most methods
// follow.
void fit_normal_load(Choice& choice, const Capabilities& can, const std::string& name) {
  constexpr const char* what =
      "a normal load that varies within a step (load_normal, load_normal_sine_amplitude)";
  refuse_rosenbrock(choice, can, what);
  if (can.kicks)
    throw usage_error("ts_type {}: it does not follow {}; use rk or arkimex", choice.type, what);
  if (choice.named_fused)
    throw usage_error("ts_type {}: it does not know load_normal; use ts_type {}", name, choice.type);
  choice.fused = false;
}

// Without mass what is fast is how short deviations die away, where their blocks slide.
Rates massless_rates(const Model& model, Vec u) {
  const Scene& s = model.scene();
  const double relaxation = model.wave_frequency(), own = scales_of(s).rate;
  return {relaxation, model.friction_rate(u), false, s.K0() > 0 && own < relaxation / 2400, own};
}

Implicit implicit_of(const std::string& type, const Capabilities& can, const std::string& wish,
                     Implicit stiff, const Rates& rates, bool sticks) {
  const bool wants_imex = wish != "auto" && wish != "none";
  if (can.is_explicit) {
    if (wants_imex)
      throw UsageError("imex_implicit " + wish + ": ts_type " + type +
                       " is explicit; use ts_type arkimex, or imex_implicit none");
    return Implicit::none;
  }
  if (can.kicks) {
    if (wants_imex && wish != "friction")
      throw UsageError("imex_implicit " + wish + ": ts_type " + type +
                       " takes friction implicitly and waves by kicks; use friction, or ts_type arkimex");
    return Implicit::friction;
  }
  if (!can.splits) {
    if (wish == "auto" || wish == "both") return Implicit::both;
    throw usage_error(
        "imex_implicit {}: ts_type {} does not split; use ts_type arkimex, or imex_implicit both", wish,
        type);
  }
  if (wish == "none") return Implicit::none;
  if (wants_imex)
    return wish == "friction" ? Implicit::friction : wish == "wave" ? Implicit::wave : Implicit::both;
  if (stiff != Implicit::none) return stiff;
  return sticks || rates.friction >= rates.wave ? Implicit::friction : Implicit::wave;
}

// Of the explicit pairs 7vr costs least at every error from 1e-2 down on all charts, up to 1.7 times less
// than 5dp: its ten stages err less than twice five's, and reach as far (docs/chart.md). That is so where its
// estimate sets the steps and what it goes through is smooth; else 5dp, whose values between steps cost
// nothing.
bool prefers_high_order(const Model& model, const MethodSpec& spec, const std::string& prefix) {
  char adapt[128] = "";
  SS_TRY(PetscOptionsGetString(nullptr, prefix.c_str(), "-ts_adapt_type", adapt, sizeof adapt, nullptr));
  return spec.step == 0 && std::string(adapt) != TSADAPTNONE && model.scene().friction.smooth();
}

// Whether the user tunes the solvers of the library's own steps, which then take them.
bool tunes_solvers(const std::string& prefix) {
  char* all;
  SS_TRY(PetscOptionsGetAll(nullptr, &all));
  const std::string text = " " + std::string(all ? all : "");
  SS_TRY(PetscFree(all));
  for (const char* begin :
       {"snes_", "ksp_", "pc_", "ts_arkimex_fully_implicit", "ts_arkimex_initial_guess_extrapolate",
        "ts_max_snes_failures"})
    if (text.find(" -" + prefix + begin) != std::string::npos) return true;
  return false;
}

// What has steps of its own: rk, arkimex whatever is implicit, and leapfrog, which is nothing else. The bands
// of what couples nodes are alike along x: where a `medium` differs, the library's own steps take these.
bool can_be_fused(const Capabilities& can, Implicit implicit, const std::string& prefix, bool medium) {
  if (can.fused_type.empty()) return false;
  if (can.is_explicit || can.kicks) return true;
  if (medium && implicit != Implicit::friction) return false;
  return implicit != Implicit::none && !tunes_solvers(prefix);
}

constexpr double usual_tolerance = 1e-6;

// Beyond this frequency steps that are stable are shorter than accuracy asks for: an accurate step of the
// explicit pair resolves times of order 0.1 in the scene's own unit of time, 1/sqrt(A K0), the period of a
// free block; it is stable up to about 3 over the fastest frequency.
double accurate_rate(const Model& model) {
  return 40 * scales_of(model.scene()).rate;
}

// Steps of an implicit method of order 4 shrink with the root of that order of the tolerance, those that
// stability sets do not: at c = 100 and 128 nodes waves are worth taking implicitly from a tolerance of 1e-5
// upwards (docs/methods.md).
bool has_stiff_wave(const Model& model, double wave, double friction, double tolerance) {
  return wave > 60 * std::max(friction, accurate_rate(model)) * std::pow(usual_tolerance / tolerance, 0.25);
}

double tolerance_of(const MethodSpec& spec, const std::string& prefix) {
  if (spec.tolerance > 0) return spec.tolerance;
  double largest = 0;
  for (const char* option : {"-ts_rtol", "-ts_atol"}) {
    PetscReal value = usual_tolerance;
    SS_TRY(PetscOptionsGetReal(nullptr, prefix.c_str(), option, &value, nullptr));
    largest = std::max(largest, double(value));
  }
  return largest > 0 ? largest : usual_tolerance;
}

// Whether friction damps waves about sliding at the plate's velocity at every node, so that they die and what
// is left is slow. Collective.
bool damps_waves(const Model& model) {
  const Scene& s = model.scene();
  bool amplifies = false;
  for (PetscInt i = 0; i < model.local() && !s.massless(); ++i) {
    const double state = model.dof() == 3 && s.v != 0 ? model.steady_state(i, s.v) : 0;
    amplifies = amplifies || model.linear_point(i, s.v, state).damping() <= 0;
  }
  return !on_any_rank(model.comm(), amplifies);
}

// What is worth taking implicitly. Where waves die, friction beside them costs order; where they live,
// everything implicit is the dearer way.
Implicit stiff_part(const Model& model, const Rates& rates, bool sticks) {
  if (rates.stiff_friction) return rates.stiff_wave ? Implicit::both : Implicit::friction;
  if (rates.stiff_wave) return sticks || damps_waves(model) ? Implicit::both : Implicit::wave;
  return Implicit::none;
}

}  // namespace

Rates rates_of(const Model& model, Vec u) {
  if (model.scene().massless()) return massless_rates(model, u);
  const double wave = stencil_rate(model.scene()), friction = friction_rate_ahead(model, u);
  // At equal error a run with friction implicit, tile by tile, costs as much as an explicit one where
  // friction acts 2 to 12 times as fast as an accurate step needs: 12 on a ring and beside a pacemaker, where
  // short waves follow each fall of a node, 2 where nodes creep between falls (docs/methods.md).
  // Rate-and-state friction creeps at velocities over many decades, down to where its rate A a/psi has no
  // bound.
  const bool creeps = model.friction_law(0).steep;
  return {wave, friction, creeps || friction > 12 * std::max(wave, accurate_rate(model)),
          has_stiff_wave(model, wave, friction, usual_tolerance), scales_of(model.scene()).rate};
}

double turns_in_recovery(const Model& model) {
  const Scene& s = model.scene();
  if (!model.friction_law(0).steep || model.dof() != 3 || s.v == 0) return 0;
  const bool alike = !s.friction.varies() && !s.medium.varies();
  const PetscInt places = alike ? std::min<PetscInt>(model.local(), 1) : model.local();
  const double wave = model.wave_frequency();
  double most = 0;
  for (PetscInt i = 0; i < places; ++i) {
    const NodeCoefficients c = model.coefficients(i);
    const double creeping = model.steady_state(i, s.v);
    const Partials before = model.friction(i, s.v, creeping);
    const double resistance = c.B + (s.massless() ? 0 : std::sqrt(c.K0 / c.A));
    if (!(resistance > 0)) continue;
    double slip = before.F / resistance;
    for (int round = 0; round < 50; ++round)
      slip = (before.F - model.friction(i, slip, model.steady_state(i, slip)).F) / resistance;
    if (!(slip / s.v > 1)) continue;
    constexpr int parts = 200;  // of the way of ln of the state, up to a factor of e
    const double from = model.steady_state(i, slip), part = (creeping - 1 - from) / parts;
    const double pull = s.massless() ? wave * (c.B + before.F_psi) : wave * wave / c.A - c.K0;
    double turns = 0;
    for (int k = 0; k < parts && part > 0; ++k) {
      const double state = from + (k + 0.5) * part, rate = model.state_rate(i, s.v, state).g;
      const double slide = pull / (c.B + model.friction(i, s.v, state).F_psi);
      if (rate > 0) turns += part / rate * (s.massless() ? slide : std::min(slide, wave));
    }
    most = std::max(most, turns);
  }
  return largest_over(model.comm(), most);
}

Choice choose_method(const Model& model, const Rates& usual, const MethodSpec& spec,
                     const std::string& prefix) {
  Rates rates = usual;
  if (!model.scene().massless())
    rates.stiff_wave = has_stiff_wave(model, rates.wave, rates.friction, tolerance_of(spec, prefix));
  // from so many on an explicit pair takes more evaluations for them than implicit steps for a whole cycle
  rates.stiff_wave = rates.stiff_wave || turns_in_recovery(model) > 1e4;
  const bool sticks = Stick::applies_to(model.scene());
  const Implicit stiff = stiff_part(model, rates, sticks);
  const bool wants_imex = spec.implicit != "auto" && spec.implicit != "none";
  Choice choice{wants_imex || stiff != Implicit::none ? TSARKIMEX : TSRK, "", Implicit::none, spec.fused,
                false};
  std::string wanted = spec.type;
  char name[128];
  PetscBool set;
  SS_TRY(PetscOptionsGetString(nullptr, prefix.c_str(), "-ts_type", name, sizeof name, &set));
  if (set) wanted = name;
  if (const std::string library = library_type(wanted); !library.empty()) {
    wanted = library;
    choice.fused = choice.named_fused = true;
  }
  if (!wanted.empty()) {
    check_type_offered(wanted);
    choice.type = wanted;
  }
  if (choice.type == TSRK && stiff == Implicit::none && !wants_imex)
    choice.subtype = wanted.empty() && !model.scene().massless() && prefers_high_order(model, spec, prefix)
                         ? TSRK7VR
                         : TSRK5DP;
  // 4 is cheaper than 3, which PETSc would take; but a block that rate-and-state friction has brought to a
  // creep of 1e-15 keeps its velocity's digits from step to step with 3 alone (measured: 4 stands still
  // there).
  const bool creeps = model.friction_law(0).steep && !model.scene().massless();
  if (choice.type == TSARKIMEX) choice.subtype = creeps ? TSARKIMEX3 : TSARKIMEX4;
  if (!spec.subtype.empty()) choice.subtype = spec.subtype;
  const bool friction = choice.named_fused && spec.implicit == "auto" && choice.type == TSARKIMEX;
  const Capabilities can = capabilities(offered_type(choice.type));
  choice.implicit = implicit_of(choice.type, can, friction ? "friction" : spec.implicit, stiff, rates,
                                sticks);
  if (model.scene().massless()) fit_massless(model, choice, can, spec, set || stiff != Implicit::none);
  if (model.scene().load.varies())
    refuse_rosenbrock(choice, can, "a load that varies (load_v, load_sine_amplitude, ...)");
  if (model.scene().normal.varies()) fit_normal_load(choice, can, set ? name : "");
  if (choice.fused)
    choice.fused = can_be_fused(can, choice.implicit, prefix, model.scene().medium.varies());
  if (choice.named_fused && !choice.fused)
    throw usage_error(
        "ts_type {}: it solves what is implicit by a solver of its own; use ts_type {}, or imex_implicit "
        "friction{} without options of snes, ksp and pc",
        name, choice.type, choice.type == TSARKIMEX ? ", wave or both" : "");
  if (can.kicks && model.viscous())
    throw UsageError(
        "ts_type " + choice.type + ": viscosity between neighbours (model_nu " +
        number_text(model.scene().nu) +
        ") spreads velocity, which its kicks cannot follow stably at order 2; use rk or arkimex");
  if (sticks && choice.implicit == Implicit::wave)
    throw UsageError(
        "imex_implicit wave: with friction_stick exact a node at rest is held by friction against eta, "
        "which this split takes apart; use friction or both, or ts_type rk");
  if (sticks && can.remembers)
    throw usage_error(
        "ts_type {}: it remembers earlier steps and would have to forget them wherever a node starts or "
        "stops (friction_stick exact); use rk, arkimex or another one-step method",
        choice.type);
  return choice;
}

}  // namespace stickslip
