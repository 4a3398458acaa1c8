#include "stickslip/time/time.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "base/failure.hpp"
#include "model/right_hand_side.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "time/integrator_impl.hpp"

namespace stickslip {

// ---- a run

void Integrator::Impl::start(Vec u, double t, double t_end, const Observer& observer,
                             std::int64_t max_steps) {
  drive.observer = &observer;
  drive.u = u;
  drive.t = drive.t_before = t;
  drive.t_end = drive.run_end = t_end;
  drive.stop_asked = drive.plate_is_over = false;
  drive.restarts = drive.first = true;
  drive.idling.restart();
  drive.max_steps = max_steps;
  drive.evaluations_before = model.rhs_evaluations();
  SS_TRY(TSSetSolution(ts, u));
  SS_TRY(TSSetMaxTime(ts, t_end));
  constexpr std::int64_t most = std::numeric_limits<PetscInt>::max();
  SS_TRY(TSSetMaxSteps(ts, PetscInt(std::min(max_steps, most))));
  drive.update_report(model);
  if (from_checkpoint) pass_corner(u, t);
  model.begin_load(t);
  if (!from_checkpoint) {
    drive.plate->set(model, t, t, true);
    drive.tell(step_now());
  }
  from_checkpoint = false;
}

// From step to step, and from one corner of the loads to the next.
void Integrator::Impl::solve(Vec u) {
  for (begin_piece(u); drive.goes_on();) {
    if (drive.at_corner()) {
      pass_corner(u, drive.t);
      if (!adaptive) drive.h = fixed_dt;
      begin_piece(u);
      continue;
    }
    begin_step();
    after_step(stepper->step(u, {drive.t, drive.h, drive.t_end, drive.steps, drive.restarts, drive.first}));
  }
  monitor();
}

// Steps meet the next corner, or the end.
void Integrator::Impl::begin_piece(Vec u) {
  if (model.scene().forced()) {
    drive.t_end = std::min(drive.run_end, model.scene().next_corner(drive.t));
    model.begin_load(drive.t);
    drive.h = std::min(drive.h, drive.t_end - drive.t);
  }
  drive.restarts = true;
  if (stick) stick->start(u, adaptive ? 0 : model.scene().forced() ? fixed_dt : drive.h);
  const double left = drive.t_end - drive.t;
  if (left <= 0) return;  // it rested to its end
  if (drive.h >= left || std::abs(drive.h - left) <= 10 * PETSC_MACHINE_EPSILON * left) drive.h = left;
}

// At a corner of the loads steps end, and checkpoints hold what was before it.
void Integrator::Impl::pass_corner(Vec u, double t) const {
  model.begin_load(std::nextafter(t, -1.));
  model.pass_corner(u, t);
}

// The TS is told where the run stands, for PETSc's own steps and for its monitors. It counts steps in a
// PetscInt: from 1 on again where it has come to 2^30.
void Integrator::Impl::monitor() const {
  constexpr std::int64_t most_counted = std::int64_t(1) << 30;
  const std::int64_t counted = drive.steps > 0 ? (drive.steps - 1) % most_counted + 1 : 0;
  SS_TRY(TSSetTime(ts, drive.t));
  SS_TRY(TSSetTimeStep(ts, drive.h));
  SS_TRY(TSSetStepNumber(ts, PetscInt(counted)));
  SS_TRY(TSMonitor(ts, PetscInt(counted), drive.t, drive.u));
}

void Integrator::Impl::view(const char* option) const {
  PetscViewer viewer;
  PetscViewerFormat format;
  PetscBool asked;
#if PETSC_VERSION_LT(3, 22, 0)
  constexpr auto create = PetscOptionsGetViewer;
#else
  constexpr auto create = PetscOptionsCreateViewer;
#endif
  SS_TRY(create(model.comm(), nullptr, prefix.c_str(), option, &viewer, &format, &asked));
  if (!asked) return;
  SS_TRY(PetscViewerPushFormat(viewer, format));
  stepper->view(viewer, drive.report.rejections);
  SS_TRY(PetscViewerPopFormat(viewer));
  SS_TRY(PetscViewerDestroy(&viewer));
}

// ---- one step

void Integrator::Impl::begin_step() {
  drive.t_before = drive.t;
  if (stick) stick->engage();
  if (dense) dense->forget();
  shorter.forget();
  if (clock_limits) set_floor();
  monitor();
}

namespace {
constexpr double clock = 16 * std::numeric_limits<double>::epsilon();  // of a time, what it is rounded by
}

// A shorter step than the round-off of the time says no more of when: where ln psi falls by decades at once,
// as a slip comes to rest, errors ask for it. At its floor a step is taken whatever its error.
void Integrator::Impl::set_floor() const {
  TSAdapt adapt;
  double longest;
  SS_TRY(TSGetAdapt(ts, &adapt));
  SS_TRY(TSAdaptGetStepLimits(adapt, nullptr, &longest));
  SS_TRY(TSAdaptSetStepLimits(adapt, std::min(std::max(floor, clock * std::abs(drive.t_before)), longest),
                              longest));
}

void Integrator::Impl::after_step(const Stepper::Outcome& outcome) {
  drive.report.rejections += outcome.rejections;
  if (outcome.kind != Stepper::Outcome::taken) fail(outcome);
  drive.t = outcome.t;
  drive.h = outcome.next_h;
  drive.first = false;
  drive.restarts = model.scene().massless();  // its psi is put in behind the step
  ++drive.steps;
  drive.update_report(model);
  const Step step = step_now();
  const double dt = step.t - drive.t_before;
  if (!stepper->puts_psi()) model.solve_velocities(step.u);
  if (!outcome.finite && !all_finite(step.u)) {
    drive.report.t = drive.t_before;
    throw NotFinite(fmt::format("the solution is not finite after step {} (t = {}): {}", step.index,
                                number_text(step.t), advice(dt)));
  }
  if (dt == 0) {
    const std::string lost = model.velocity_jump(step.u);
    throw failure("the step has shrunk to nothing at t = {} (step {}); {}", number_text(step.t), step.index,
                  lost.empty() ? "loosen ts_rtol and ts_atol, or remove jumps from the scene" : lost);
  }
  check_floor(step);
  if (reaches_balance(step, outcome.rejections > 0)) drive.restarts = true;
  if (stick) return stick->after(step);
  drive.tell(step);
  drive.done(step);
}

namespace {

// Nodes that come into balance in no time, with mass and friction that goes by ln psi (`steep` laws).
//
// Where the force lies below friction by d, psi falls at A d, and friction that goes by a ln psi follows only
// when psi is d/a factors of e lower, so 60 or 260 decades for ordinary d: within the round-off of the time,
// as soon as psi is small. Steps show nothing of that way. One that ends upon it has a psi whose error is
// beyond all smallness and whose force is off by as much as before; the first stage of the next one, which is
// explicit, mirrors this, and the psi that goes with it is no number any more. So psi is put where
//     eta + N D2 psi - B psi - F(psi, state) = 0
// when it gets there within a moment.
//
// Does so at every node of u whose force is off by more than `tolerances` allow and whose way there at the
// rate psi_t takes less than `moment`, a time. Returns whether there was one on any rank. Collective.
bool balance_at_once(const Model& model, const Tolerances& tolerances, double moment, Vec u) {
  const Scene& s = model.scene();
  if (s.massless() || !model.friction_law(0).steep) return false;
  VecHandle viscous;
  if (model.viscous()) {
    viscous = model.create_vector();
    model.viscous_force(u, viscous);
  }
  const std::vector<double> from_neighbours = viscous ? local_values(viscous) : std::vector<double>();
  const int dof = model.dof();
  const double normal = model.normal_load(model.time()).N;
  bool any = false;
  {
    const Writing a(u);
    for (PetscInt i = 0; i < model.local(); ++i) {
      if (s.held(model.first() + i)) continue;
      double* const at = a + i * dof;
      const double psi = at[0], state = dof == 3 ? at[2] : 0;
      const double eta = at[1] + (viscous ? from_neighbours[std::size_t(i * dof + 1)] : 0);
      const NodeCoefficients c = model.coefficients(i);
      const double off = eta - c.B * psi - model.friction(i, psi, state).F;
      if (std::abs(off) <= allowed_error(tolerances, 1, eta)) continue;
      const MasslessNode node{model.friction_law(i), normal * model.amplitude()[i], c.B, true};
      const double balanced = node.velocity(eta, state, psi);
      // psi beyond 0, where a law of psi > 0 says no force, has come from there
      if (std::isnan(balanced) || std::abs(balanced - psi) > moment * c.A * std::abs(off)) continue;
      at[0] = balanced;
      any = true;
    }
  }
  return on_any_rank(model.comm(), any);
}

}  // namespace

// Steps meet what falls at once by being rejected, or end at their floor. What bdf remembers of earlier steps
// does not go with a psi that was put in.
bool Integrator::Impl::reaches_balance(const Step& step, bool was_rejected) const {
  return adaptive && !can.multistep && (was_rejected || steps_at_floor > 0) &&
         balance_at_once(model, tolerances, std::max(drive.same_time, clock * std::abs(step.t)), step.u);
}

std::string Integrator::Impl::instead() const {
  if (!can.multistep || !model.friction_law(0).steep) return "";
  return ", or take ts_type arkimex or rosw, by which psi may fall by decades at once";
}

// At ts_adapt_dt_min PETSc accepts a step whatever its error. That the next one should be no longer tells
// that this one's error was at the tolerance or beyond. At the floor that the clock sets this is so while a
// slip comes to rest, but not for long.
void Integrator::Impl::check_floor(const Step& step) {
  if (!adaptive) return;
  constexpr int most = 1000;
  TSAdapt adapt;
  double least;
  SS_TRY(TSGetAdapt(ts, &adapt));
  SS_TRY(TSAdaptGetStepLimits(adapt, &least, nullptr));
  // the ends of a step are rounded
  const double reach = least * (1 + 1e-7) + 2 * std::numeric_limits<double>::epsilon() * std::abs(step.t);
  // close to the end steps are cut to hit it
  const bool at_floor = !(step.t - step.t_before > reach || step.next_dt > reach ||
                          step.t + 2 * reach >= drive.t_end);
  steps_at_floor = at_floor ? steps_at_floor + 1 : 0;
  if (!at_floor) return;
  if (const std::string lost = model.velocity_jump(step.u); !lost.empty()) {
    drive.report.t = drive.t_before;
    throw failure("the step has shrunk to nothing at t = {} (step {}); {}", number_text(step.t), step.index,
                  lost);
  }
  if (least > floor && steps_at_floor < most) return;
  drive.report.t = drive.t_before;
  if (least > floor)
    throw failure(
        "the step has shrunk to nothing at t = {} (step {}): {} in a row are as short as the digits of the "
        "time allow, and err by more than the tolerance; loosen ts_rtol and ts_atol, or go on from a frame "
        "as a run of its own (init_file), whose time begins at 0",
        number_text(step.t), step.index, most);
  throw Failure("the step fell to its floor ts_adapt_dt_min " + number_text(floor) +
                " at t = " + number_text(step.t) + " (step " + std::to_string(step.index) +
                ") with an error above the tolerance; lower ts_adapt_dt_min, or loosen ts_rtol and ts_atol" +
                instead());
}

Integrator::Step Integrator::Impl::step_now() {
  // this one was cut short to end at a corner
  const bool cut = !adaptive && drive.t == drive.t_end && drive.t < drive.run_end;
  return {drive.steps, drive.t_before, drive.t, drive.u, cut ? fixed_dt : drive.h,
          [this](double at, Vec into) { interpolate(at, into); }};
}

std::string Integrator::Impl::advice(double dt) const {
  if (const std::string lost = model.velocity_jump(drive.u); !lost.empty()) return lost;
  const Law law = model.scene().friction.law;
  if (!law->only_for.empty())
    return fmt::format("friction_law {} holds for {} alone, and a step may have led beyond", to_string(law),
                       law->only_for);
  if (implicit == Implicit::both) return "reduce ts_dt or the tolerances";
  std::string text = fmt::format("an explicit step of {} is too large", number_text(dt));
  const double frequency = model.wave_frequency();
  if (implicit != Implicit::wave && dt * frequency > 1)
    text +=
        fmt::format("; the shortest {} at {} per unit time",
                    model.scene().massless() ? "deviation dies away" : "wave turns", number_text(frequency));
  const double viscous = viscous_rate(model.scene());
  if (implicit != Implicit::wave && dt * viscous > 1)
    text += fmt::format("; viscosity damps it at {} per unit time", number_text(viscous));
  return text + "; reduce ts_dt, or choose an implicit method (ts_type arkimex)";
}

void Integrator::Impl::fail(const Stepper::Outcome& outcome) const {
  const std::string at =
      fmt::format(" at t = {} (step {})", number_text(drive.report.t), drive.report.steps);
  if (outcome.kind == Stepper::Outcome::not_finite)
    throw NotFinite(fmt::format("the solution is not finite behind t = {} (step {}): {}",
                                number_text(drive.report.t), drive.report.steps, advice(outcome.next_h)));
  if (outcome.kind == Stepper::Outcome::not_solved)
    throw NotSolved("Newton's method failed in the implicit part" + at + "; reduce ts_dt");
  if (const std::string lost = model.velocity_jump(drive.u); !lost.empty()) throw Failure(lost + at);
  const std::string times = fmt::format("the time step was rejected more than {} times (ts_max_reject){}",
                                        most_rejections(), at),
                    advice = "; reduce ts_dt or loosen ts_rtol and ts_atol" + instead();
  if (stepper->solved()) throw Failure(times + advice);
  throw NotSolved(times + ": Newton's method fails in the implicit part" + advice);
}

// ---- between steps

bool Integrator::Impl::output_due(double until) {
  return next_output_time && next_output_time(drive.t_before) <= until;
}

void Integrator::Impl::interpolate(double at, Vec into) {
  const double t = drive.t;
  const Vec u = drive.u, before = stepper->before();
  // The end of a step may miss the time that it was to meet by round-off; a polynomial through slopes misses
  // u by its error.
  if (std::abs(at - t) <= 4 * std::numeric_limits<double>::epsilon() * std::abs(t)) {
    SS_TRY(VecCopy(u, into));
    return;
  }
  const double dt = t - drive.t_before, part = (at - drive.t_before) / dt;
  if (dense && !before) throw std::logic_error("interpolation at a time that was not announced");
  const bool by_step = before && shorter.is_needed(before, u, dt);
  if (stick && (by_step || dense)) stick->engage();
  if (by_step)
    shorter.take(before, u, drive.t_before, dt, part, tolerances, into);
  else if (dense)
    dense->interpolate(before, u, drive.t_before, dt, part, into);
  else
    stepper->interpolate(at, part, into);
  if (dense || by_step || !stepper->puts_psi()) model.solve_velocities(into);
  // About to explode: u is finite still, its cube is not.
  if (!all_finite(into))
    throw NotFinite(fmt::format("the solution is not finite at t = {} (step {}): {}", number_text(at),
                                drive.report.steps, advice(dt)));
}

// ---- what others see

Integrator::Integrator(const Model& model, const MethodSpec& method, Vec u, const std::string& prefix)
    : impl_(std::make_unique<Impl>(model, prefix)) {
  impl_->set_up(method, u);
}
Integrator::~Integrator() = default;

void Integrator::set_output_times(std::function<double(double)> next_time) {
  impl_->next_output_time = std::move(next_time);
}

void Integrator::drive_by(Plate& plate) { impl_->drive.plate = &plate; }

void Integrator::continue_from(std::int64_t step, double dt) {
  impl_->from_checkpoint = true;
  impl_->drive.steps = step;
  impl_->drive.h = dt;
}

TimeReport Integrator::advance(Vec u, double t, double t_end, const Observer& observer,
                               std::int64_t max_steps) {
  Drive& drive = impl_->drive;
  impl_->start(u, t, t_end, observer, max_steps);
  if (!drive.stop_asked && t < t_end) {
    impl_->view("-ts_view_pre");
    impl_->solve(u);
    SS_TRY(VecViewFromOptions(u, reinterpret_cast<PetscObject>(impl_->ts.get()), "-ts_view_solution"));
    impl_->view("-ts_view");
  }
  drive.update_report(impl_->model);
  drive.report.stop = drive.plate_is_over        ? Stop::max_plate
                      : drive.t >= drive.run_end ? Stop::end_time
                      : drive.stop_asked         ? Stop::asked
                                                 : Stop::max_steps;
  return drive.report;
}

const TimeReport& Integrator::report() const { return impl_->drive.report; }
const Model& Integrator::model() const { return impl_->model; }
double Integrator::next_step() const { return impl_->drive.h; }
void Integrator::set_next_step(double dt) { impl_->drive.h = dt; }
void Integrator::count_from(std::int64_t steps) { impl_->drive.steps = steps; }
const Tolerances& Integrator::tolerances() const { return impl_->tolerances; }
void Integrator::set_tolerances(const Tolerances& tolerances) { impl_->set_tolerances(tolerances); }
bool Integrator::adaptive() const { return impl_->adaptive; }
const Method& Integrator::method() const { return *impl_->method; }
TS Integrator::ts() const { return impl_->ts; }

}  // namespace stickslip
