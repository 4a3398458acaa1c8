#include "time/stick_steps.hpp"

#include <algorithm>
#include <limits>

#include "base/failure.hpp"
#include "stickslip/model/model.hpp"

namespace stickslip {

namespace {
constexpr double infinity = std::numeric_limits<double>::infinity();
}

using Step = Integrator::Step;

StickSteps::StickSteps(const Model& model, const Stepper& stepper, FusedStepper* fused, Drive& drive)
    : model_(model), halts_(halts(model.scene())), stepper_(stepper), fused_(fused), drive_(drive),
      stick_(model), landed_(model.create_vector()) {
  if (fused_ && fused_->last_is_solution()) fused_->leave_slope_in([this] { return stick_.slope_at_end(); });
}

void StickSteps::start(Vec u, double fixed_dt) {
  fixed_dt_ = fixed_dt;
  decide(u, drive_.t);
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
  Plate& plate = *drive_.plate;
  plate.set(model_, t, plate.at(t), false);
  stick_.decide(u, t);
  if (!stick_.all_rest()) return;
  plate.set(model_, t, plate.time, true);
  stick_.decide(u, t);
  if (stick_.all_rest()) return;
  plate.set(model_, t, plate.time, false);
  stick_.renew_slope(u);
}

void StickSteps::after(Step step) {
  const double t_before = drive_.t_before, dt = step.t - t_before;
  Vec u = step.u;
  const auto inside = step.interpolate;
  const auto at = [&](double part, Vec into) { inside(t_before + part * dt, into); };
  model_.set_time(step.t);
  const Stick::Cut cut = stick_.first_change(stepper_.before(), u, t_before, dt, at, landed_,
                                             fused_ && fused_->last_is_solution());
  if (cut.kind == Stick::Cut::Kind::too_coarse) return take_back(step, dt);
  if (cut.kind == Stick::Cut::Kind::none) {
    if (stick_.follow_frictionless(u) && fused_) fused_->set_direction(stick_.direction());
    if (fixed_dt_ > 0 && step.next_dt < fixed_dt_) drive_.go_on_from(step.t, fixed_dt_);
    // as a run that goes on from here will
    if (drive_.tell(step) == Integrator::Verdict::restart) decide(u, step.t);
    return drive_.done(step);
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
  drive_.report.t = step.t;
  if (step.t > t_before)
    drive_.tell(step);
  else
    --drive_.steps;
  SS_TRY(VecCopy(landed_, u));
  decide(u, step.t);
  drive_.done(step, stick_.changed());
  drive_.go_on_from(step.t, step.next_dt);
  pass_rest(u);
}

void StickSteps::take_back(const Step& step, double dt) {
  const double t = drive_.t_before;
  SS_TRY(VecCopy(stepper_.before(), step.u));
  ++drive_.report.rejections;  // because a node that began to slip ran backwards
  if (!(t + dt / 8 > t))
    throw Failure("a released node does not begin to slide at t = " + number_text(t) + " (step " +
                  std::to_string(step.index) + ")");
  --drive_.steps;
  drive_.go_on_from(t, dt / 8);
  drive_.update_report(model_);
}

// While everything rests one step leads to the next release, or to the end.
void StickSteps::pass_rest(Vec u) {
  const double dt = drive_.h;
  while (stick_.all_rest() && drive_.goes_on()) {
    const double t = drive_.t;
    const double shown = drive_.plate->at(t);  // by the plate's clock
    const double plate_end = halts_ ? t + (drive_.plate->end - shown) : infinity;
    const double t_end = std::min({drive_.t_end, t + Stick::longest_rest(model_.scene()), plate_end});
    const double wait = stick_.release_after(u, t, t_end - t), until = t + wait < t_end ? t + wait : t_end;
    const double rested = until == t_end ? t_end - t : wait;
    stick_.rest(u, t, rested, landed_);
    drive_.plate_is_over = until == plate_end;
    if (halts_)
      drive_.plate->set(model_, until, drive_.plate_is_over ? drive_.plate->end : shown + rested, true);
    const auto within = [this, u, t, until](double when, Vec into) {
      if (when == until)
        SS_TRY(VecCopy(landed_, into));
      else
        stick_.rest(u, t, when - t, into);
    };
    if (until > t) {
      drive_.t_before = t;
      ++drive_.steps;
      drive_.t = until;
      drive_.update_report(model_);
      drive_.tell({drive_.steps, t, until, landed_, dt, within});
    }
    SS_TRY(VecCopy(landed_, u));
    if (drive_.plate_is_over) drive_.stop_asked = true;
    decide(u, until);
    drive_.done({drive_.steps, until, until, u, dt, within}, stick_.changed());
    drive_.go_on_from(until, dt);
  }
}

}  // namespace stickslip
