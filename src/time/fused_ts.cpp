#include "time/fused_ts.hpp"

#if __has_include(<petsc/private/tsimpl.h>)
#include <petsc/private/tsimpl.h>  // for writers of TS types
#define STICKSLIP_FUSED_STEP
#endif

#include "stickslip/base/error.hpp"
#include "stickslip/time/methods.hpp"
#include "stickslip/time/time.hpp"
#include "time/added_tableaus.hpp"
#include "time/fused_methods.hpp"

namespace stickslip {

namespace {

constexpr const char *fused_rk = "fusedrk", *fused_arkimex = "fusedarkimex";
struct TypeNames {
  const char *fused, *library;
};
constexpr TypeNames type_names[] = {
    {fused_rk, TSRK}, {fused_arkimex, TSARKIMEX}, {leapfrog_type, leapfrog_type}};

}  // namespace

std::string FusedTs::library_type(const std::string& fused) {
  for (const TypeNames& names : type_names)
    if (fused == names.fused) return names.library;
  return "";
}

void FusedTs::bind(const Model& model, Implicit implicit, bool sticking,
                   std::function<bool(double)> keep_slopes) {
  model_ = &model;
  implicit_ = implicit;
  sticking_ = sticking;
  keep_slopes_ = std::move(keep_slopes);
}

void FusedTs::make_slopes() {
  const std::size_t count = method_->slopes();
  while (slopes_.size() < count) slopes_.push_back(model_->create_vector());
}

// Where a node stops or starts in a step, which nobody announces, the step is taken once more for its slopes.
void FusedTs::interpolate(double s, Vec into) {
  if (!slopes_kept_) {
    make_slopes();
    step_->take(before_, dt_, norm_, false, into, slopes_, nullptr, t_);
    slopes_kept_ = true;
  }
  const std::vector<double> weights = method_->weights_at(s, dt_);
  const std::vector<Vec> terms(slopes_.begin(), slopes_.end());
  SS_TRY(VecCopy(before_, into));
  SS_TRY(VecMAXPY(into, terms.size(), weights.data(), const_cast<Vec*>(terms.data())));
}

bool FusedTs::shorter(double s, Vec into) const {
  const StepTaker::Outcome end = step_->take(before_, s * dt_, norm_, adaptive_, into, {}, nullptr, t_);
  return end.finite && end.solved;
}

#ifdef STICKSLIP_FUSED_STEP

std::string FusedTs::fused_type(const std::string& type) {
  for (const TypeNames& names : type_names)
    if (type == names.library) return names.fused;
  return "";
}

void FusedTs::set_up() {
  if (!model_) throw std::logic_error("a TS of a fused type that is bound to no model");
  step_ = method_->make(*model_, implicit_, sticking_);
  before_ = model_->create_vector();
}

// Through rejections to an accepted step, or to the reason why there is none.
void FusedTs::take(TS ts) {
  SS_TRY(VecCopy(ts->vec_sol, before_));
  for (PetscInt rejected = 0; !ts->reason;) {
    if (attempt(ts, rejected)) return;
    ++ts->reject;
    if (!ts->reason && ++rejected > ts->max_reject && ts->max_reject >= 0)
      ts->reason = TS_DIVERGED_STEP_REJECTED;
  }
  SS_TRY(VecCopy(before_, ts->vec_sol));
}

// While this stands the next step may not be longer than this one. What made a step of an implicit method
// fail, a node that begins to slip or falls, is rarely over with the shorter one; steps that grow at once, up
// to tenfold as the library has it, meet it again (docs/methods.md). Explicit steps, which stability bounds,
// are the library's own.
class SteadyAfterRejection {
 public:
  SteadyAfterRejection(TSAdapt adapt, bool holds) : adapt_(adapt) {
    SS_TRY(TSAdaptGetClip(adapt_, &low_, &high_));
    if (holds) SS_TRY(TSAdaptSetClip(adapt_, low_, 1));
  }
  ~SteadyAfterRejection() { (void)TSAdaptSetClip(adapt_, low_, high_); }
  SteadyAfterRejection(const SteadyAfterRejection&) = delete;
  SteadyAfterRejection& operator=(const SteadyAfterRejection&) = delete;

 private:
  TSAdapt adapt_;
  PetscReal low_, high_;
};

bool FusedTs::attempt(TS ts, PetscInt rejected) {
  static const std::vector<VecHandle> none;
  TSAdapt adapt;
  TSAdaptType kind;
  SS_TRY(TSGetAdapt(ts, &adapt));
  SS_TRY(TSAdaptGetType(adapt, &kind));
  adaptive_ = kind && std::string(kind) != TSADAPTNONE;
  t_ = ts->ptime;
  dt_ = ts->time_step;
  norm_ = {tolerances_, adapt->wnormtype};
  slopes_kept_ = keep_slopes_(ts->ptime + dt_ * (1 + 1e-12));
  if (slopes_kept_) make_slopes();
  outcome_ = step_->take(before_, dt_, norm_, adaptive_, ts->vec_sol, slopes_kept_ ? slopes_ : none,
                         slope_at_end_ ? slope_at_end_() : nullptr, t_);
  if (adaptive_ && !(outcome_.finite && outcome_.solved)) {
    double scale;
    SS_TRY(TSAdaptGetScaleSolveFailed(adapt, &scale));
    ts->time_step = scale * dt_;
    return false;
  }
  if (!outcome_.solved) {
    ts->reason = TS_DIVERGED_NONLINEAR_SOLVE;
    return false;
  }
  PetscBool accept = rejected > 0 ? PETSC_FALSE : PETSC_TRUE;  // read too: a second rejection shortens more
  double next_dt;
  SS_TRY(TSAdaptCandidatesClear(adapt));
  SS_TRY(TSAdaptCandidateAdd(adapt, method_->subtype(), method_->order(), 1, 1, double(step_->stages()),
                             PETSC_TRUE));
  const SteadyAfterRejection steady(adapt, rejected > 0 && method_->type() != std::string(TSRK));
  SS_TRY(TSAdaptChoose(adapt, ts, dt_, nullptr, &next_dt, &accept));
  if (accept) ts->ptime += dt_;
  ts->time_step = next_dt;
  return accept;
}

struct FusedTs::Callbacks {
  static FusedTs& self(TS ts) { return *static_cast<FusedTs*>(ts->data); }

  static PetscErrorCode TSSetUp_Fused(TS ts) {
    return guarded([&] { self(ts).set_up(); });
  }
  static PetscErrorCode TSStep_Fused(TS ts) {
    return guarded([&] { self(ts).take(ts); });
  }
  static PetscErrorCode TSEvaluateWLTE_Fused(TS ts, NormType, PetscInt* order, PetscReal* wlte) {
    *order = self(ts).method_->order();
    *wlte = self(ts).outcome_.error;
    return 0;
  }
  static PetscErrorCode TSInterpolate_Fused(TS ts, PetscReal at, Vec into) {
    return guarded([&] { self(ts).interpolate((at - ts->ptime_prev) / (ts->ptime - ts->ptime_prev), into); });
  }
  static PetscErrorCode TSRollBack_Fused(TS ts) { return VecCopy(self(ts).before_, ts->vec_sol); }

  template <class Items>  // PETSc's, which have been a pointer of themselves since 3.23
  static PetscErrorCode TSSetFromOptions_Fused(TS ts, Items PetscOptionsObject) {
    FusedMethod& method = *self(ts).method_;
    if (subtype_option(method.type()).empty()) return 0;
    std::vector<const char*> names;
    for (const Method& m : methods())
      if (m.type == std::string(method.type())) names.push_back(m.subtype);
    const std::string option = "-" + subtype_option(method.type());
    PetscInt chosen = 0;
    PetscBool set;
    PetscOptionsHeadBegin(PetscOptionsObject, "ODE solver options, stages of a step tile by tile");
    PetscCall(PetscOptionsEList(option.c_str(), "Tableau", "none", names.data(), names.size(),
                                method.subtype(), &chosen, &set));
    PetscOptionsHeadEnd();
    if (set) method.set_subtype(names[chosen]);
    return 0;
  }
  static PetscErrorCode TSView_Fused(TS ts, PetscViewer viewer) {
    const FusedMethod& method = *self(ts).method_;
    const bool in_band = self(ts).implicit_ == Implicit::wave || self(ts).implicit_ == Implicit::both;
    PetscBool ascii;
    PetscCall(PetscObjectTypeCompare((PetscObject)viewer, PETSCVIEWERASCII, &ascii));
    if (ascii && subtype_option(method.type()).empty())
      PetscCall(PetscViewerASCIIPrintf(viewer, "  %s, tile by tile\n", method.type()));
    else if (ascii)
      PetscCall(PetscViewerASCIIPrintf(viewer, "  %s type %s, %s\n", method.type(), method.subtype(),
                                       in_band ? "for each stage one banded system in psi, in pieces"
                                               : "all stages of a step tile by tile"));
    return 0;
  }
  static PetscErrorCode TSDestroy_Fused(TS ts) {
    for (const char* function : {"TSRKSetType_C", "TSRKGetType_C", "TSRKGetTableau_C", "TSARKIMEXSetType_C",
                                 "TSARKIMEXGetType_C", "TSRosWSetType_C", "TSRosWGetType_C"})
      PetscCall(PetscObjectComposeFunction((PetscObject)ts, function, nullptr));
    delete static_cast<FusedTs*>(ts->data);
    ts->data = nullptr;
    return 0;
  }

  // As of the library's own types, which are asked for them by name.
  static PetscErrorCode SetType(TS ts, const char* name) {
    return guarded([&] { self(ts).method_->set_subtype(name); });
  }
  static PetscErrorCode GetType(TS ts, const char** name) {
    return guarded([&] { *name = self(ts).method_->subtype(); });
  }
  static PetscErrorCode GetTableau(TS ts, PetscInt* s, const PetscReal** A, const PetscReal** b,
                                   const PetscReal** c, const PetscReal** embedded, PetscInt* degree,
                                   const PetscReal** interpolating, PetscBool* fsal) {
    return TSRKGetTableau(self(ts).method_->library(), s, A, b, c, embedded, degree, interpolating, fsal);
  }

  static void create(TS ts, const char* library_type) {
    auto self = std::make_unique<FusedTs>(library_type);
    ts->ops->setup = TSSetUp_Fused;
    ts->ops->step = TSStep_Fused;
    ts->ops->evaluatewlte = TSEvaluateWLTE_Fused;
    ts->ops->interpolate = TSInterpolate_Fused;
    ts->ops->rollback = TSRollBack_Fused;
    ts->ops->setfromoptions = TSSetFromOptions_Fused;
    ts->ops->view = TSView_Fused;
    ts->ops->destroy = TSDestroy_Fused;
    ts->default_adapt_type = TSADAPTBASIC;
    ts->usessnes = PETSC_FALSE;
    ts->data = self.release();
  }
  static PetscErrorCode TSCreate_FusedRK(TS ts) {
    return guarded([&] {
      create(ts, TSRK);
      SS_TRY(PetscObjectComposeFunction((PetscObject)ts, "TSRKSetType_C", SetType));
      SS_TRY(PetscObjectComposeFunction((PetscObject)ts, "TSRKGetType_C", GetType));
      SS_TRY(PetscObjectComposeFunction((PetscObject)ts, "TSRKGetTableau_C", GetTableau));
    });
  }
  static PetscErrorCode TSCreate_FusedARKIMEX(TS ts) {
    return guarded([&] {
      create(ts, TSARKIMEX);
      SS_TRY(PetscObjectComposeFunction((PetscObject)ts, "TSARKIMEXSetType_C", SetType));
      SS_TRY(PetscObjectComposeFunction((PetscObject)ts, "TSARKIMEXGetType_C", GetType));
    });
  }
  static PetscErrorCode TSCreate_Leapfrog(TS ts) {
    return guarded([&] { create(ts, leapfrog_type); });
  }
  static void add_types() {
    SS_TRY(TSRegister(fused_rk, TSCreate_FusedRK));
    SS_TRY(TSRegister(fused_arkimex, TSCreate_FusedARKIMEX));
    SS_TRY(TSRegister(leapfrog_type, TSCreate_Leapfrog));
  }
};

void FusedTs::add_types() { Callbacks::add_types(); }

FusedTs* FusedTs::of(TS ts) {
  TSType type;
  SS_TRY(TSGetType(ts, &type));
  return type && !library_type(type).empty() ? static_cast<FusedTs*>(ts->data) : nullptr;
}

#else

std::string FusedTs::fused_type(const std::string&) { return ""; }
void FusedTs::add_types() {}
FusedTs* FusedTs::of(TS) { return nullptr; }

#endif

void register_time_steppers() {
  static bool done = false;
  if (std::exchange(done, true)) return;
  FusedTs::add_types();
  for (const AddedTableau& t : added_tableaus()) {
    const PetscInt stages = t.b.size();
    SS_TRY(TSRKRegister(t.method.subtype, t.method.order, stages, t.A.data(), t.b.data(), nullptr,
                        t.embedded.empty() ? nullptr : t.embedded.data(), 0, nullptr));
  }
  for (const RegisteredMethod& own : registered_methods()) SS_TRY(TSRegister(own.method.type, own.create));
}

}  // namespace stickslip
