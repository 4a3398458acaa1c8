#include <utility>

#include "base/broadcast.hpp"
#include "base/log_event.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/time/methods.hpp"
#include "time/stepper.hpp"

namespace stickslip {

FusedStepper::FusedStepper(const Model& model, TS ts, std::unique_ptr<FusedMethod> method, Implicit implicit,
                           bool sticking, Loop loop)
    : model_(model), ts_(ts), method_(std::move(method)), implicit_(implicit), loop_(std::move(loop)),
      taker_(method_->make(model, implicit, sticking)), before_(model.create_vector()) {}

void FusedStepper::set_up(const Method&, bool adaptive, PetscInt most_rejections) {
  adaptive_ = adaptive;
  most_rejections_ = most_rejections;
}

void FusedStepper::make_slopes() {
  const std::size_t count = method_->slopes();
  while (slopes_.size() < count) slopes_.push_back(model_.create_vector());
}

Stepper::Outcome FusedStepper::step(Vec u, const Asked& asked) {
  static const std::vector<VecHandle> none;
  static const LogEvent event("TSStep");
  const LogEvent::Scope counted(event);
  const bool is_rk = method_->type() == std::string(TSRK);
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
          {method_->type(), method_->subtype(), method_->order(), t_, dt_, asked.t_end, asked.index,
           outcome_.error, again, again && !is_rk, asked.restarts});
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
  const std::vector<double> weights = method_->weights_at(part, dt_);
  const std::vector<Vec> terms(slopes_.begin(), slopes_.end());
  SS_TRY(VecCopy(before_, into));
  SS_TRY(VecMAXPY(into, terms.size(), weights.data(), const_cast<Vec*>(terms.data())));
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
  const std::string tableau = *subtype() ? std::string(" type ") + subtype() : "";
  const int ranks = ranks_in(model_.comm());
  SS_TRY(PetscViewerASCIIPrintf(viewer, "TS Object: %d MPI process%s\n  type: %s\n    %s%s, %s\n", ranks,
                                ranks > 1 ? "es" : "", type, method_->type(), tableau.c_str(),
                                in_band ? "for each stage one banded system in psi, in pieces"
                                        : "all stages of a step tile by tile"));
  SS_TRY(PetscViewerASCIIPrintf(viewer,
                                "  maximum steps=%lld\n  maximum time=%g\n"
                                "  total number of rejected steps=%lld\n"
                                "  using relative error tolerance of %g, using absolute error tolerance of %g\n",
                                static_cast<long long>(most_steps), end, static_cast<long long>(rejections),
                                tolerances_.relative[0], tolerances_.absolute[0]));
  SS_TRY(PetscViewerASCIIPushTab(viewer));
  SS_TRY(TSAdaptView(adapt, viewer));
  SS_TRY(PetscViewerASCIIPopTab(viewer));
}

}  // namespace stickslip
