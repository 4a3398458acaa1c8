#include "time/stick_steps.hpp"

#include <algorithm>
#include <limits>

#include "stickslip/model/model.hpp"

namespace stickslip {

namespace {
constexpr double infinity = std::numeric_limits<double>::infinity();
}

using Step = Integrator::Step;

StickSteps::StickSteps(const Model& model, TS ts, FusedTs* fused, Advance& advance)
    : model_(model), halts_(halts(model.scene())), ts_(ts), fused_(fused), advance_(advance), stick_(model),
      landed_(model.create_vector()) {
  if (fused_ && fused_->last_is_solution()) fused_->leave_slope_in([this] { return stick_.slope_at_end(); });
}

void StickSteps::start(Vec u, double fixed_dt) {
  fixed_dt_ = fixed_dt;
  SS_TRY(TSSetConvergedReason(ts_, TS_CONVERGED_ITERATING));
  double t;
  SS_TRY(TSGetTime(ts_, &t));
  decide(u, t);
  pass_rest(u);
}

void StickSteps::decide(Vec u, double t) {
  if (halts_) {
    decide_with_plate(u, t);
  } else {
    model_.set_time(t);
    stick_.decide(u, t);
  }
  if (fused_) fused_->set_direction(stick_.direction());
}

// The plate stands while any node slips. Where none does, it goes on, and what it then lets go at once halts
// it again.
void StickSteps::decide_with_plate(Vec u, double t) {
  Plate& plate = *advance_.plate;
  plate.set(model_, t, plate.at(t), false);
  stick_.decide(u, t);
  if (!stick_.all_rest()) return;
  plate.set(model_, t, plate.time, true);
  stick_.decide(u, t);
  if (stick_.all_rest()) return;
  plate.set(model_, t, plate.time, false);
  stick_.renew_slope(u);
}

void StickSteps::after(Step step, Vec before) {
  const double t_before = advance_.t_before, dt = step.t - t_before;
  Vec u = step.u;
  const auto inside = step.interpolate;
  const auto at = [&](double part, Vec into) { inside(t_before + part * dt, into); };
  model_.set_time(step.t);
  const Stick::Cut cut =
      stick_.first_change(before, u, t_before, dt, at, landed_, fused_ && fused_->last_is_solution());
  if (cut.kind == Stick::Cut::Kind::too_coarse) return take_back(step, before, dt);
  if (cut.kind == Stick::Cut::Kind::none) {
    if (stick_.follow_frictionless(u) && fused_) fused_->set_direction(stick_.direction());
    if (fixed_dt_ > 0 && step.next_dt < fixed_dt_) go_on_from(step.t, fixed_dt_);
    // as a run that goes on from here will
    if (advance_.tell(ts_, step) == Integrator::Verdict::restart) decide(u, step.t);
    return advance_.done(ts_, step);
  }
  step.t = cut.part == 1 ? step.t : t_before + cut.part * dt;
  step.u = landed_;
  step.next_dt = fixed_dt_ > 0 ? fixed_dt_ : std::min(step.next_dt, dt);
  step.interpolate = [&, t = step.t](double when, Vec into) {
    if (when == t)
      SS_TRY(VecCopy(landed_, into));
    else
      inside(when, into);
  };
  advance_.report.t = step.t;
  if (step.t > t_before)
    advance_.tell(ts_, step);
  else
    advance_.begin_count(ts_, step.index - 1);
  SS_TRY(VecCopy(landed_, u));
  decide(u, step.t);
  advance_.done(ts_, step, stick_.changed());
  go_on_from(step.t, step.next_dt);
  pass_rest(u);
}

void StickSteps::take_back(const Step& step, Vec before, double dt) {
  const double t = advance_.t_before;
  SS_TRY(VecCopy(before, step.u));
  ++advance_.report.rejections;  // because a node that began to slip ran backwards
  if (!(t + dt / 8 > t))
    throw Failure("a released node does not begin to slide at t = " + number_text(t) + " (step " +
                  std::to_string(step.index) + ")");
  advance_.begin_count(ts_, step.index - 1);
  go_on_from(t, dt / 8);
  advance_.update_report(ts_, model_);
}

// The next step starts anew, at t and of length dt, unless the run is over: then dt stays for who goes on
// with it.
void StickSteps::go_on_from(double t, double dt) {
  SS_TRY(TSSetTime(ts_, t));
  SS_TRY(TSSetTimeStep(ts_, t < advance_.t_end ? std::min(dt, advance_.t_end - t) : dt));
  SS_TRY(TSRestartStep(ts_));
  SS_TRY(TSSetConvergedReason(ts_, advance_.stop_asked                         ? TS_CONVERGED_USER
                                   : t >= advance_.t_end                       ? TS_CONVERGED_TIME
                                   : advance_.steps(ts_) >= advance_.max_steps ? TS_CONVERGED_ITS
                                                                               : TS_CONVERGED_ITERATING));
}

// While everything rests one step leads to the next release, or to the end.
void StickSteps::pass_rest(Vec u) {
  double t, dt;
  std::int64_t index = advance_.steps(ts_);
  SS_TRY(TSGetTime(ts_, &t));
  SS_TRY(TSGetTimeStep(ts_, &dt));
  const auto goes_on = [&] {
    return t < advance_.t_end && !advance_.stop_asked && index < advance_.max_steps;
  };
  while (stick_.all_rest() && goes_on()) {
    const double shown = advance_.plate->at(t);  // by the plate's clock
    const double plate_end = halts_ ? t + (advance_.plate->end - shown) : infinity;
    const double t_end = std::min({advance_.t_end, t + Stick::longest_rest(model_.scene()), plate_end});
    const double wait = stick_.release_after(u, t, t_end - t), until = t + wait < t_end ? t + wait : t_end;
    const double rested = until == t_end ? t_end - t : wait;
    stick_.rest(u, t, rested, landed_);
    advance_.plate_is_over = until == plate_end;
    if (halts_)
      advance_.plate->set(model_, until, advance_.plate_is_over ? advance_.plate->end : shown + rested, true);
    const auto within = [this, u, t, until](double when, Vec into) {
      if (when == until)
        SS_TRY(VecCopy(landed_, into));
      else
        stick_.rest(u, t, when - t, into);
    };
    if (until > t) {
      advance_.t_before = t;
      advance_.begin_count(ts_, ++index);
      SS_TRY(TSSetTime(ts_, until));
      advance_.update_report(ts_, model_);
      advance_.tell(ts_, {index, t, until, landed_, dt, within});
    }
    SS_TRY(VecCopy(landed_, u));
    t = until;
    if (advance_.plate_is_over) advance_.stop_asked = true;
    decide(u, t);
    advance_.done(ts_, {index, t, t, u, dt, within}, stick_.changed());
    go_on_from(t, dt);
  }
}

}  // namespace stickslip
