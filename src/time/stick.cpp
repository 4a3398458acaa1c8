#include "stickslip/time/stick.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/failure.hpp"
#include "model/stick_rule.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/numerics/roots.hpp"
#include "time/integrator_impl.hpp"

namespace stickslip {

using namespace stick_rule;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

double side_of(double psi) { return psi < 0 ? -1 : 1; }

// A Vec of unknowns, or of a slope, as nodes side by side, while it exists. `total`: its force, see
// Stick::total_force.
class VecNodes {
 public:
  VecNodes(Vec u, Vec total, int dof) : u_(u), total_(total), dof_(dof) {}
  operator StridedNodes() const {
    return {u_, (total_ ? +total_ : +u_) + 1, dof_ == 3 ? u_ + 2 : nullptr, dof_};
  }

 private:
  Reading u_, total_;
  int dof_;
};

}  // namespace

bool Stick::applies_to(const Scene& scene) { return scene.friction.sticks() && !scene.massless(); }

Stick::Stick(const Model& model)
    : model_(model), events_(std::make_unique<StickEvents>(model)), dof_(model.dof()),
      direction_(model.local(), 0.), slope_(model.create_vector()), next_slope_(model.create_vector()),
      candidates_(std::make_unique<Candidates>()), unseen_(unseen_slip(model.wave_frequency())) {
  const std::vector<double>& amplitude = model.amplitude();
  frictionless_ = on_any_rank(model.comm(), std::count(amplitude.begin(), amplitude.end(), 0.) > 0);
  if (dof_ == 2) return;
  limit_.resize(std::size_t(model.local()));
  next_limit_.resize(limit_.size());
}
Stick::~Stick() { model_.set_direction(nullptr); }

Vec Stick::viscous_force(Vec u, std::size_t number) {
  if (!forces_[number]) forces_[number] = model_.create_vector();
  model_.viscous_force(u, forces_[number]);
  return forces_[number];
}

Vec Stick::total_force(Vec u, std::size_t number) {
  if (!model_.viscous()) return nullptr;
  const Vec total = viscous_force(u, number);
  SS_TRY(VecAXPY(total, 1, u));
  return total;
}

void Stick::decide(Vec u, double t) {
  engage();
  const NormalLoad normal = model_.normal_load(t);
  was_ = direction_;
  {
    const Reading a(u);
    for (PetscInt i = 0; i < model_.local(); ++i)
      direction_[i] = events_->never_rests(i) ? side_of(a[i * dof_]) : sign_of(a[i * dof_]);
  }
  model_.rhs(Part::full, u, slope_);

  const VecNodes now(u, total_force(u, 0), dof_), slopes(slope_, total_force(slope_, 1), dof_);
  const StridedNodes nodes = now, rates = slopes;
  changed_.clear();
  long counts[3] = {0, 0, 0};  // moving, begins to slip now, changed
  for (PetscInt i = 0; i < model_.local(); ++i)
    // its state moves
    if (!events_->is_free(i) && dof_ == 3 && direction_[i] != 0) ++counts[0];
  for (PetscInt i = events_->free_begin(); i < events_->free_end(); ++i) {
    double& going = direction_[i];
    if (going == 0) {
      const WithSlope limit = events_->moving_threshold(i, nodes.state_of(i), normal);
      if (dof_ == 3) limit_[i] = limit;
      going = events_->start(nodes.force_of(i), rates.force_of(i), limit);
      if (going != 0) ++counts[1];
    }
    if (going != 0) ++counts[0];
    if (going != was_[i]) changed_.push_back(model_.first() + i);
  }
  counts[2] = long(changed_.size());
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, counts, 3, MPI_LONG, MPI_SUM, model_.comm()));
  all_rest_ = counts[0] == 0;
  changes_ += counts[2];
  if (counts[1] > 0) model_.rhs(Part::full, u, slope_);
}

// Such a node slides through psi = 0 like a node of smooth friction: only what its state sees of psi, the
// magnitude, turns there.
bool Stick::follow_frictionless(Vec u) {
  if (!frictionless_) return false;
  int turned = 0;
  {
    const Reading a(u);
    for (PetscInt i = events_->free_begin(); i < events_->free_end(); ++i) {
      if (!events_->never_rests(i) || direction_[i] == side_of(a[i * dof_])) continue;
      direction_[i] = -direction_[i];
      turned = 1;
    }
  }
  return on_any_rank(model_.comm(), turned != 0);
}

void Stick::renew_slope(Vec u) { model_.rhs(Part::full, u, slope_); }

Stick::Cut Stick::first_change(Vec before, Vec after, double t, double dt,
                               const std::function<void(double part, Vec into)>& at, Vec landed,
                               bool slope_known) {
  engage();
  if (!slope_known) model_.rhs(Part::full, after, next_slope_);
  StepOfNodes step{t, dt, 0, model_.local(), direction_.data()};
  if (dof_ == 3) {
    step.begin_limit = limit_.data();
    step.end_limit = next_limit_.data();
  }
  find_candidates(before, after, step);
  if (candidates_->reached < infinity) {
    const auto furthest_at = [&](double part) {
      if (part > 1 - close)
        SS_TRY(VecCopy(after, landed));  // which the polynomial misses by its error
      else
        at(part, landed);
      return furthest(landed, step, part);
    };
    const Place place = locate(candidates_->estimate, candidates_->reached, unseen_ / dt, furthest_at);
    if (place.found == Found::too_coarse) return {Cut::Kind::too_coarse, 0};
    if (place.found == Found::at) {
      snap(before, landed, step, place.part);
      return {Cut::Kind::at, place.part};
    }
  }
  std::swap(slope_, next_slope_);
  limit_.swap(next_limit_);
  return {Cut::Kind::none, 1};
}

// Those of all ranks for the times.
void Stick::find_candidates(Vec before, Vec after, StepOfNodes step) {
  {
    const VecNodes a(before, total_force(before, 0), dof_), b(after, total_force(after, 1), dof_),
        fa(slope_, total_force(slope_, 2), dof_), fb(next_slope_, total_force(next_slope_, 3), dof_);
    step.begin = a;
    step.end = b;
    step.begin_slope = fa;
    step.end_slope = fb;
    events_->find(step, *candidates_);
  }
  double both[2] = {candidates_->estimate, candidates_->reached};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, both, 2, MPI_DOUBLE, MPI_MIN, model_.comm()));
  candidates_->estimate = both[0];
  candidates_->reached = both[1];
}

// At u, over all candidates of all ranks.
stick_rule::Furthest Stick::furthest(Vec u, const StepOfNodes& step, double part) {
  Furthest most;
  {
    const VecNodes there(u, total_force(u, 0), dof_);
    most = events_->furthest(step, *candidates_, there, part);
  }
  double both[2] = {most.all, most.fresh};
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, both, 2, MPI_DOUBLE, MPI_MAX, model_.comm()));
  return {both[0], both[1]};
}

void Stick::snap(Vec before, Vec landed, StepOfNodes step, double part) {
  std::vector<NodeLimit> limits;
  const Vec total = total_force(landed, 1);
  {
    const VecNodes begin(before, total_force(before, 0), dof_);
    const Reading total_landed(total);
    const Writing b(landed);
    step.begin = begin;
    const StridedNodes there{b, (total ? +total_landed : +b) + 1, dof_ == 3 ? b + 2 : nullptr, dof_};
    limits = events_->snap(step, *candidates_, there, b, dof_ == 3 ? b + 2 : nullptr, part);
  }
  put_at_threshold(landed, limits, model_.normal_load(step.t + part * step.dt));
}

// Makes the force on each of these nodes its threshold, from which decide() lets it go.
void Stick::put_at_threshold(Vec u, const std::vector<NodeLimit>& limits, const NormalLoad& normal) {
  const Vec viscous = model_.viscous() ? viscous_force(u, 0) : nullptr;
  const Reading more(viscous);
  const Writing b(u);
  for (const auto& [node, side] : limits) {
    double* const at = b + node * dof_;
    const double limit = events_->threshold(node, dof_ == 3 ? at[2] : 0, normal);
    at[1] = StickEvents::put_at(limit, side, more ? more[node * dof_ + 1] : 0);
  }
}

double Stick::release_after(Vec u, double t, double longest) {
  const LoadsFrom loads = events_->loads_from(t);
  double first = infinity;
  {
    const VecNodes now(u, total_force(u, 0), dof_), slopes(slope_, total_force(slope_, 1), dof_);
    const StridedNodes nodes = now, rates = slopes;
    for (PetscInt i = events_->free_begin(); i < events_->free_end(); ++i)
      events_->for_each_side([&](double side) {
        const double latest = loads.vary() ? std::min(first, longest) : first;
        const RestingNode node =
            events_->resting(i, side, nodes.force_of(i), rates.force_of(i), nodes.state_of(i), loads);
        first = std::min(first, release(node, loads, latest).wait);
      });
  }
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_DOUBLE, MPI_MIN, model_.comm()));
  return first;
}

double Stick::longest_rest(const Scene& scene) { return 16 * scene.smooth_time(); }

void Stick::rest(Vec u, double t, double wait, Vec into) {
  const Load& load = model_.scene().load;
  const bool loaded = load.varies() && events_->loads_from(t).vary();
  const NormalLoad normal = model_.normal_load(t + wait);
  const double v = model_.plate_velocity(t);
  const auto K0 = [&](PetscInt i) { return loaded ? model_.coefficients(i).K0 : 0; };
  const double way = loaded ? load.integral(t + wait) - load.integral(t) - v * wait : 0;
  const double gain = loaded ? model_.plate_velocity(t + wait) - v : 0;
  SS_TRY(VecWAXPY(into, wait, slope_, u));
  std::vector<NodeLimit> limits;
  {
    const Reading a(u);
    const Writing b(into);
    if (dof_ == 3)
      for (PetscInt i = 0; i < model_.local(); ++i)
        b[i * 3 + 2] = model_.friction_law(i).state_at_rest(a[i * 3 + 2], wait);
    for (PetscInt i = 0; loaded && i < model_.local(); ++i)
      if (model_.scene().form == Form::chain || !model_.held(model_.first() + i))
        b[i * dof_ + 1] += K0(i) * way;
  }
  {
    const VecNodes then(into, total_force(into, 0), dof_), slopes(slope_, total_force(slope_, 1), dof_);
    const StridedNodes nodes = then, rates = slopes;
    for (PetscInt i = events_->free_begin(); i < events_->free_end(); ++i) {
      const WithSlope limit = events_->moving_threshold(i, nodes.state_of(i), normal);
      const double faster = K0(i) * gain;
      events_->for_each_side([&](double side) {
        if (std::abs(side * nodes.force_of(i) - limit.value) <= close * limit.value &&
            side * (rates.force_of(i) + faster) > limit.slope)
          limits.push_back({i, side});
      });
    }
  }
  put_at_threshold(into, limits, normal);
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
  while (stick_.all_rest() && drive_.goes_on() && !drive_.at_corner()) {
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
