// How an Integrator is put together: the method, its split, its steps, and what is refused.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <petscdmshell.h>

#include "base/failure.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/options/library_options.hpp"
#include "time/integrator_impl.hpp"
#include "time/methods.hpp"

namespace stickslip {

namespace {
// The norm in which the error of a step is kept below its tolerance, where the user names none: PETSc's mean
// over all unknowns, but with friction that sticks exactly, and without mass where friction is steep at rest,
// the largest. There mostly a few blocks move while the others rest or creep and err by nothing, and the mean
// would let these few err by the more the longer the chain is. PETSc takes the norm of a TSAdapt from the
// options alone, among which it therefore stands while this does.
class UsualNorm {
 public:
  UsualNorm(const Model& model, const std::string& prefix) : name_("-" + prefix + "ts_adapt_wnormtype") {
    if (!names_few(model) || user_set(prefix, "ts_adapt_wnormtype")) return;
    SS_TRY(PetscOptionsSetValue(nullptr, name_.c_str(), "infinity"));
    set_ = true;
  }
  ~UsualNorm() {
    if (set_) (void)PetscOptionsClearValue(nullptr, name_.c_str());
  }
  UsualNorm(const UsualNorm&) = delete;
  UsualNorm& operator=(const UsualNorm&) = delete;

  static bool names_few(const Model& model) {
    return Stick::applies_to(model.scene()) ||
           (model.scene().massless() && model.friction_law(0).steep);
  }

 private:
  std::string name_;
  bool set_ = false;
};
}  // namespace

void Integrator::Impl::set_up(const MethodSpec& spec, Vec u) {
  register_time_steppers();
  create_ts(u);
  const Rates rates = rates_of(model, u);
  const Choice choice = choose_method(model, rates, spec, prefix);
  implicit = choice.implicit;
  can = capabilities(offered_type(choice.type));
  SS_TRY(TSSetType(ts, (choice.named_fused ? can.fused_type : choice.type).c_str()));
  if (!choice.named_fused) set_subtype(ts, choice.type, choice.subtype);
  const std::string given = given_subtype(choice.type);
  const bool fuses = will_fuse(choice);  // asks no solver, nor a matrix, most of a run's memory
  if (!fuses) stepper = std::make_unique<PetscStepper>(model, ts, implicit, can, prefix, loop());
  set_step_control(spec, rates);
  {
    const UsualNorm norm(model, prefix);
    SS_TRY(TSSetFromOptions(ts));
  }
  // What the method was given overrides the options of PETSc.
  if (spec.step > 0) SS_TRY(TSSetTimeStep(ts, spec.step));
  SS_TRY(TSSetErrorIfStepFails(ts, PETSC_FALSE));  // advance() says what failed
  if (fuses) fuse(choice, given.empty() ? choice.subtype : given);
  set_tolerances(tolerances_of(spec));
  if (fuses && model.scene().massless() && user_set(prefix, "ts_atol"))
    warn("ts_atol has no effect: explicit steps of massless rate-and-state friction err by ts_rtol of ln psi "
         "and of ln theta, which have no unit");
  if (!fuses) SS_TRY(TSSetUp(ts));
  method = &offered_method(choice.type, fuses ? fused->subtype() : subtype_of(ts, choice.type));
  can = capabilities(*method);
  if (Stick::applies_to(model.scene())) stick = std::make_unique<StickSteps>(model, *stepper, fused, drive);
  read_adaptivity(spec.step > 0, u);
  SS_TRY(TSGetTimeStep(ts, &fixed_dt));
  drive.h = fixed_dt;
  set_dense_output();
  shorter.set_up(fused, *method, implicit, adaptive);
  drive.report.method = method->name();
  drive.report.implicit = implicit;
}

// As given with the method, else as the options say.
Tolerances Integrator::Impl::tolerances_of(const MethodSpec& spec) const {
  const Scales scales = scales_of(model.scene()).least;
  if (spec.tolerance > 0) return Tolerances::automatic(scales, spec.tolerance, spec.tolerance);
  double absolute, relative;
  SS_TRY(TSGetTolerances(ts, &absolute, nullptr, &relative, nullptr));
  return user_set(prefix, "ts_atol") ? Tolerances::as_set(scales, relative, absolute)
                                     : Tolerances::automatic(scales, relative, spec.parts);
}

void Integrator::Impl::set_tolerances(const Tolerances& given) {
  tolerances = given;
  SS_TRY(TSSetTolerances(ts, given.absolute[0], nullptr, given.relative[0], nullptr));
  stepper->set_tolerances(given);
}

void Integrator::Impl::create_ts(Vec u) {
  SS_TRY(TSCreate(model.comm(), ts.out()));
  SS_TRY(TSSetOptionsPrefix(ts, prefix.c_str()));
  // That of a mesh would list every node, which nobody reads.
  SS_TRY(DMShellCreate(model.comm(), dm.out()));
  SS_TRY(DMShellSetGlobalVector(dm, u));
  SS_TRY(TSSetDM(ts, dm));
  SS_TRY(TSSetProblemType(ts, TS_NONLINEAR));
  SS_TRY(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_MATCHSTEP));
  SS_TRY(TSSetSolution(ts, u));
}

// The user's subtype, "" where none is named, before the library meets one that it does not know.
std::string Integrator::Impl::given_subtype(const std::string& type) const {
  const std::string& option = can.subtype_option;
  char subtype[80];
  PetscBool set = PETSC_FALSE;
  if (!option.empty())
    SS_TRY(PetscOptionsGetString(nullptr, prefix.c_str(), ("-" + option).c_str(), subtype, sizeof subtype,
                                 &set));
  if (!set) return "";
  (void)offered_method(type, subtype);
  return subtype;
}

void Integrator::Impl::set_step_control(const MethodSpec& spec, const Rates& rates) const {
  if (spec.step > 0) {
    TSAdapt adapt;
    SS_TRY(TSGetAdapt(ts, &adapt));
    SS_TRY(TSAdaptSetType(adapt, TSADAPTNONE));
  }
  SS_TRY(TSSetTolerances(ts, Tolerances::usual, nullptr, Tolerances::usual, nullptr));
  SS_TRY(TSSetTimeStep(ts, rates.first_step()));
}

// Whether steps are taken tile by tile.
bool Integrator::Impl::will_fuse(const Choice& choice) const {
  if (!choice.fused) return false;
  if (!user_set(prefix, "ts_adapt_max_ignore")) return true;
  if (!choice.named_fused) return false;
  throw usage_error("ts_adapt_max_ignore: ts_type {} does not support it; use ts_type {}",
                    can.fused_type, choice.type);
}

// Takes the steps tile by tile from now on. The type is changed only here, since -ts_type rk names the
// library's own.
void Integrator::Impl::fuse(const Choice& choice, const std::string& subtype) {
  SS_TRY(TSSetType(ts, can.fused_type.c_str()));
  auto made = std::make_unique<FusedStepper>(model, ts, choice.type, subtype, implicit,
                                             Stick::applies_to(model.scene()), loop());
  fused = made.get();
  stepper = std::move(made);
}

Stepper::Loop Integrator::Impl::loop() {
  return {[this](double until) {
            if (fused) return !dense && output_due(until);
            return stick || ((dense || shorter.may_be_asked()) && output_due(until));
          },
          [this] { drive.idling.at(drive.t_before, {}, drive.same_time); }};
}

// What the user may rely on and would not get.
void Integrator::Impl::read_adaptivity(bool step_given, Vec u) {
  TSAdapt adapt;
  TSAdaptType kind;
  SS_TRY(TSGetAdapt(ts, &adapt));
  SS_TRY(TSAdaptGetType(adapt, &kind));
  const std::string chosen = kind ? kind : TSADAPTNONE;
  if (chosen != TSADAPTNONE && chosen != TSADAPTBASIC && chosen != TSADAPTDSP)
    throw usage_error("ts_adapt_type {}: it needs what this program does not have; use basic, dsp or none",
                      chosen);
  if (method->adaptivity == Adaptivity::never) {
    if (user_set(prefix, "ts_adapt_type") && chosen != TSADAPTNONE)
      throw usage_error("ts_adapt_type {}: {} has no error estimate; use none, or an adaptive method", chosen,
                        method->name());
    SS_TRY(TSAdaptSetType(adapt, TSADAPTNONE));
  }
  adaptive = method->adaptivity != Adaptivity::never && chosen != TSADAPTNONE;
  stepper->set_up(*method, adaptive, most_rejections());
  if (fused)
    fused->control_by(StepControl(ts, prefix, UsualNorm::names_few(model) ? NORM_INFINITY : NORM_2));
  if (!adaptive) return warn_of_fixed_step(step_given);
  PetscReal longest;
  SS_TRY(TSAdaptGetStepLimits(adapt, &floor, &longest));
  clock_limits = model.friction_law(0).steep;
  // the library's 1e-20 is of one unit; what shrinks below the digits of the time is found out (base/process)
  if (!can.multistep && !user_set(prefix, "ts_adapt_dt_min"))
    SS_TRY(TSAdaptSetStepLimits(adapt, floor = 0, longest));
  if (user_set(prefix, "ts_adapt_always_accept"))
    warn("ts_adapt_always_accept: steps are taken whatever their error; ts_rtol and ts_atol do not hold");
  refuse_below_round_off(u);
}

PetscInt Integrator::Impl::most_rejections() const {
  PetscInt most = 60;
  const std::string name = "-" + name_in_database("ts_max_reject");
  SS_TRY(PetscOptionsGetInt(nullptr, prefix.c_str(), name.c_str(), &most, nullptr));
  return most;
}

void Integrator::Impl::warn_of_fixed_step(bool step_given) const {
  double dt;
  SS_TRY(TSGetTimeStep(ts, &dt));
  const std::string name = method->name();
  const std::string how =
      method->adaptivity == Adaptivity::on_request ? " has a fixed step unless ts_adapt_type is basic"
      : method->adaptivity == Adaptivity::never    ? " has no error estimate and a fixed step"
                                                   : " has a fixed step with ts_adapt_type none";
  for (const char* tolerance : {"ts_rtol", "ts_atol"})
    if (user_set(prefix, tolerance))
      warn(fmt::format("{} has no effect: {}{}; every step is {}", tolerance, name, how, number_text(dt)));
  if (!user_set(prefix, "ts_dt") && !step_given)
    warn(name + how + ": every step is " + number_text(dt) +
         ", chosen for stability and not for accuracy; set ts_dt, or use an adaptive method such as " +
         (can.is_explicit ? "rk:5dp"
          : can.splits    ? "arkimex:4"
                          : "rosw:ra34pw2"));
  if (can.multistep && method->subtype > std::string("2"))
    warn("ts_bdf_order " + std::string(method->subtype) +
         ": with fixed steps the order is 2 (its first steps are); " + "use ts_adapt_type basic");
}

// Steps would shrink until time stands still.
void Integrator::Impl::refuse_below_round_off(Vec u) const {
  constexpr double least = 1e-17;
  PetscReal size;
  const double rtol = tolerances.relative[0], atol = tolerances.absolute[0];
  if (rtol >= least) return;
  SS_TRY(VecNorm(u, NORM_INFINITY, &size));
  size = std::max(size, std::abs(model.scene().v));
  if (atol < least * size)
    throw UsageError("ts_rtol " + number_text(rtol) + " with ts_atol " + number_text(atol) +
                     ": below round-off, which is 1e-16 of values as large as " + number_text(size) +
                     "; a tolerance of 1e-14 is the least that makes sense");
}

void Integrator::Impl::set_dense_output() {
  if (can.degree > 0) dense = std::make_unique<DenseOutput>(model, can.degree);
}

}  // namespace stickslip
