#include "time/integrator_impl.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/time/methods.hpp"

namespace stickslip {

namespace {

struct Filter {
  const char* name;
  double scale, beta[3], alpha[2];
};
constexpr Filter filters[] = {
    {"basic", 1, {1, 0, 0}, {0, 0}},     {"PI30", 3, {1, 0, 0}, {0, 0}},
    {"PI42", 5, {3, -1, 0}, {0, 0}},     {"PI33", 3, {2, -1, 0}, {0, 0}},
    {"PI34", 10, {7, -4, 0}, {0, 0}},    {"PC11", 1, {2, -1, 0}, {-1, 0}},
    {"PC47", 10, {11, -7, 0}, {-10, 0}}, {"PC36", 10, {9, -6, 0}, {-10, 0}},
    {"H0211", 2, {1, 1, 0}, {1, 0}},     {"H211b", 4, {1, 1, 0}, {1, 0}},
    {"H211PI", 6, {1, 1, 0}, {0, 0}},    {"H0312", 4, {1, 2, 1}, {3, 1}},
    {"H312b", 8, {1, 2, 1}, {3, 1}},     {"H312PID", 18, {1, 2, 1}, {0, 0}},
    {"H0321", 4, {5, 2, -3}, {-1, -3}},  {"H321", 18, {6, 1, -5}, {-15, -3}}};
constexpr const char* usual_filter = "PI42";

// The numbers of an option behind one another; those that it does not say are 0.
template <std::size_t count>
void read(const std::string& prefix, const char* option, std::array<double, count>& into) {
  std::array<PetscReal, count> given{};
  PetscInt found = count;
  PetscBool set;
  SS_TRY(PetscOptionsGetRealArray(nullptr, prefix.c_str(), option, given.data(), &found, &set));
  if (set) std::copy(given.begin(), given.end(), into.begin());
}

bool says_yes(const std::string& prefix, const char* option) {
  PetscBool yes = PETSC_FALSE;
  SS_TRY(PetscOptionsGetBool(nullptr, prefix.c_str(), option, &yes, nullptr));
  return yes;
}

}  // namespace

StepControl::StepControl(TS ts, const std::string& prefix, NormType usual_norm) : ts_(ts), norm_(usual_norm) {
  TSAdaptType kind;
  SS_TRY(TSGetAdapt(ts, &adapt_));
  SS_TRY(TSAdaptGetType(adapt_, &kind));
  const std::string name = kind ? kind : TSADAPTNONE;
  kind_ = name == TSADAPTBASIC ? basic : name == TSADAPTDSP ? dsp : none;
  PetscEnum norm = PetscEnum(usual_norm);
  SS_TRY(PetscOptionsGetEnum(nullptr, prefix.c_str(), "-ts_adapt_wnormtype", NormTypes, &norm, nullptr));
  norm_ = NormType(norm);
  always_accepts_ = says_yes(prefix, "-ts_adapt_always_accept");
  monitors_ = says_yes(prefix, "-ts_adapt_monitor");
  if (kind_ == dsp) read_filter(prefix);
}

void StepControl::read_filter(const std::string& prefix) {
  char given[32] = "";
  SS_TRY(PetscOptionsGetString(nullptr, prefix.c_str(), "-ts_adapt_dsp_filter", given, sizeof given,
                               nullptr));
  for (const Filter& f : filters) {
    PetscBool same;
    SS_TRY(PetscStrcasecmp(f.name, *given ? given : usual_filter, &same));
    if (!same) continue;
    for (int k = 0; k < 3; ++k) beta_[k] = f.beta[k] / f.scale;
    for (int k = 0; k < 2; ++k) alpha_[k] = f.alpha[k] / f.scale;
  }
  constexpr double unset = std::numeric_limits<double>::infinity();
  std::array<double, 3> pid{unset, 0, 0};
  read(prefix, "-ts_adapt_dsp_pid", pid);
  if (pid[0] != unset) {
    beta_ = {pid[0] + pid[1] + pid[2], -(pid[1] + 2 * pid[2]), pid[2]};
    alpha_ = {};
  }
  read(prefix, "-ts_adapt_dsp_kbeta", beta_);
  read(prefix, "-ts_adapt_dsp_alpha", alpha_);
}

double StepControl::after_failure(double h) const {
  double scale;
  SS_TRY(TSAdaptGetScaleSolveFailed(adapt_, &scale));
  return scale * h;
}

StepControl::Choice StepControl::choose(const Tried& tried) {
  Choice choice{true, tried.h};
  if (tried.error < 0)
    errors_ = ratios_ = {1, 1, 1};
  else if (kind_ != none)
    choice = kind_ == basic ? by_error(tried) : by_filter(tried);
  // Steps meet the end: the last one may be longer by a hundredth, or half of what is left.
  const double t = tried.t + tried.h, ends = t + choice.h, left = tried.t_end - t;
  if (choice.accepted && t < tried.t_end) {
    const double h = choice.h;
    if (ends > tried.t_end) choice.h = left;
    if (ends < tried.t_end && h * 2. > left) choice.h = left / 2;
    if (ends < tried.t_end && h * (1. + 0.01) > left) choice.h = left;
  }
  if (monitors_) monitor(tried, choice);
  return choice;
}

// The step that the error would allow, at the rate at which it falls.
StepControl::Choice StepControl::by_error(const Tried& tried) const {
  double safety, reject_safety, low, high, least, most;
  SS_TRY(TSAdaptGetSafety(adapt_, &safety, &reject_safety));
  SS_TRY(TSAdaptGetClip(adapt_, &low, &high));
  SS_TRY(TSAdaptGetStepLimits(adapt_, &least, &most));
  const bool too_large = tried.error > 1;
  if (too_large && tried.again) safety *= reject_safety;  // it failed before
  const bool at_floor = tried.h < (1 + PETSC_SQRT_MACHINE_EPSILON) * least;
  const double factor =
      safety * (tried.error > 0 ? std::pow(tried.error, -1. / tried.order) : PETSC_INFINITY);
  const double h = tried.h * std::max(low, std::min(factor, tried.steady ? 1. : high));
  return {!too_large || at_floor || always_accepts_, std::max(least, std::min(h, most))};
}

StepControl::Choice StepControl::by_filter(const Tried& tried) {
  double safety, reject_safety, low, high, least, most;
  SS_TRY(TSAdaptGetSafety(adapt_, &safety, &reject_safety));
  SS_TRY(TSAdaptGetClip(adapt_, &low, &high));
  SS_TRY(TSAdaptGetStepLimits(adapt_, &least, &most));
  if (tried.restarts) errors_ = ratios_ = {1, 1, 1};
  const double error = std::pow(1 / std::max(tried.error, double(PETSC_SMALL)), 1. / tried.order);
  double ratio = std::pow(error, beta_[0]);
  ratio *= std::pow(errors_[0], beta_[1]);
  ratio *= std::pow(errors_[1], beta_[2]);
  ratio *= std::pow(ratios_[0], -alpha_[0]);
  ratio *= std::pow(ratios_[1], -alpha_[1]);
  ratio = 1 + std::atan(ratio - 1);
  const bool at_floor = tried.h < least * (1 + PETSC_SQRT_MACHINE_EPSILON);
  const bool accepted = ratio >= safety * 0.9 || always_accepts_ || at_floor;
  if (accepted) {
    errors_ = {error, errors_[0], errors_[1]};
    ratios_ = {ratio, ratios_[0], ratios_[1]};
  }
  const double h = tried.h * std::max(low, std::min(ratio, tried.steady ? 1. : high));
  return {accepted, std::max(least, std::min(h, most))};
}

// As PETSc says it.
void StepControl::monitor(const Tried& tried, const Choice& choice) const {
  MPI_Comm comm;
  TSType type;
  TSAdaptType kind;
  SS_TRY(PetscObjectGetComm(reinterpret_cast<PetscObject>(ts_), &comm));
  SS_TRY(TSGetType(ts_, &type));
  SS_TRY(TSAdaptGetType(adapt_, &kind));
  SS_TRY(PetscPrintf(comm, "      TSAdapt %s %s 0:%s step %3lld %s t=%-11g+%10.3e dt=%-10.3e", kind, type,
                     tried.subtype, static_cast<long long>(tried.index),
                     choice.accepted ? "accepted" : "rejected", tried.t, tried.h, choice.h));
  if (tried.error >= 0) SS_TRY(PetscPrintf(comm, " wlte=%5.3g  wltea=   -1 wlter=   -1", tried.error));
  SS_TRY(PetscPrintf(comm, "\n"));
}

FusedStepper::FusedStepper(const Model& model, TS ts, const std::string& type, const std::string& subtype,
                           Implicit implicit, bool sticking, Loop loop)
    : model_(model), ts_(ts), type_(type), method_(type, subtype), implicit_(implicit),
      loop_(std::move(loop)), taker_(method_.make(model, implicit, sticking)),
      before_(model.create_vector()) {}

void FusedStepper::set_up(const Method&, bool adaptive, PetscInt most_rejections) {
  adaptive_ = adaptive;
  most_rejections_ = most_rejections;
}

void FusedStepper::make_slopes() {
  const std::size_t count = method_.slopes();
  while (slopes_.size() < count) slopes_.push_back(model_.create_vector());
}

Stepper::Outcome FusedStepper::step(Vec u, const Asked& asked) {
  static const std::vector<VecHandle> none;
  static const LogEvent event("TSStep");
  const LogEvent::Scope counted(event);
  norm_ = {tolerances_, control_->norm()};
  t_ = asked.t;
  dt_ = asked.h;
  SS_TRY(VecCopy(u, before_));
  Outcome::Kind failed = Outcome::rejected;
  int rejections = 0;
  for (;;) {
    slopes_kept_ = loop_.keeps(t_ + dt_ * (1 + 1e-12));
    if (slopes_kept_) make_slopes();
    outcome_ = taker_->take(before_, dt_, norm_, adaptive_, u, slopes_kept_ ? slopes_ : none,
                            slope_at_end_ ? slope_at_end_() : nullptr, t_);
    double next = 0;
    if (adaptive_ && !(outcome_.finite && outcome_.solved)) {
      next = control_->after_failure(dt_);
    } else if (!outcome_.solved) {
      failed = Outcome::not_solved;
      break;
    } else {
      // What made a step of an implicit method fail, a node that begins to slip or falls, is rarely over with
      // the shorter one; steps that grow at once, up to tenfold as the library has it, meet it again
      // (docs/methods.md). Explicit steps, which stability bounds, are the library's own.
      const bool again = rejections > 0;
      const StepControl::Choice choice = control_->choose(
          {type_.c_str(), subtype().c_str(), method_.program().order, t_, dt_, asked.t_end, asked.index,
           outcome_.error, again, again && method_.program().additive(), asked.restarts});
      next = choice.h;
      if (choice.accepted) return {Outcome::taken, t_ + dt_, next, rejections, outcome_.finite};
    }
    if (++rejections > most_rejections_ && most_rejections_ >= 0) break;
    dt_ = next;
    loop_.repeats();
  }
  SS_TRY(VecCopy(before_, u));
  return {failed, t_, dt_, rejections, true};
}

// Where a node stops or starts in a step, which nobody announces, the step is taken once more for its slopes.
void FusedStepper::interpolate(double, double part, Vec into) {
  if (!slopes_kept_) {
    make_slopes();
    taker_->take(before_, dt_, norm_, false, into, slopes_, nullptr, t_);
    slopes_kept_ = true;
  }
  const std::vector<double> weights = method_.weights_at(part, dt_);
  const std::vector<Vec> terms(slopes_.begin(), slopes_.end());
  SS_TRY(VecCopy(before_, into));
  taker_->begin_sum(into);
  SS_TRY(VecMAXPY(into, terms.size(), weights.data(), const_cast<Vec*>(terms.data())));
  taker_->end_sum(into);
}

bool FusedStepper::shorter(double part, Vec into) const {
  const StepTaker::Outcome end = taker_->take(before_, part * dt_, norm_, adaptive_, into, {}, nullptr, t_);
  return end.finite && end.solved;
}

// As TSView does it, which would speak of steps of the TS itself.
void FusedStepper::view(PetscViewer viewer, std::int64_t rejections) const {
  PetscBool ascii;
  SS_TRY(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(viewer), PETSCVIEWERASCII, &ascii));
  if (!ascii) return;
  TSType type;
  TSAdapt adapt;
  PetscInt most_steps;
  PetscReal end;
  SS_TRY(TSGetType(ts_, &type));
  SS_TRY(TSGetAdapt(ts_, &adapt));
  SS_TRY(TSGetMaxSteps(ts_, &most_steps));
  SS_TRY(TSGetMaxTime(ts_, &end));
  const bool in_band = implicit_ == Implicit::wave || implicit_ == Implicit::both;
  const std::string tableau = subtype().empty() ? "" : " type " + subtype();
  const int ranks = ranks_in(model_.comm());
  SS_TRY(PetscViewerASCIIPrintf(viewer, "TS Object: %d MPI process%s\n  type: %s\n    %s%s, %s\n", ranks,
                                ranks > 1 ? "es" : "", type, type_.c_str(), tableau.c_str(),
                                in_band ? "for each stage one banded system in psi, in pieces"
                                        : "all stages of a step tile by tile"));
  SS_TRY(PetscViewerASCIIPrintf(viewer,
                                "  maximum steps=%lld\n  maximum time=%g\n"
                                "  total number of rejected steps=%lld\n"
                                "  using relative error tolerance of %g, "
                                "using absolute error tolerance of %g\n",
                                static_cast<long long>(most_steps), end, static_cast<long long>(rejections),
                                tolerances_.relative[0], tolerances_.absolute[0]));
  SS_TRY(PetscViewerASCIIPushTab(viewer));
  SS_TRY(TSAdaptView(adapt, viewer));
  SS_TRY(PetscViewerASCIIPopTab(viewer));
}

}  // namespace stickslip
