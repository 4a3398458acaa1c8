#include "stickslip/time/time.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "base/failure.hpp"
#include "base/local_values.hpp"
#include "time/allowed_error.hpp"
#include "time/at_once.hpp"
#include "time/integrator_impl.hpp"

namespace stickslip {

// ---- what the TS calls
// ------------------------------------------------------------------------------------------

Integrator::Impl& Integrator::Impl::of(TS ts) {
  void* context;
  SS_TRY(TSGetApplicationContext(ts, &context));
  return *static_cast<Impl*>(context);
}

PetscErrorCode Integrator::Impl::PreStep(TS ts) {
  return guarded([&] { of(ts).begin_step(); });
}
PetscErrorCode Integrator::Impl::PreStage(TS ts, PetscReal) {
  return guarded([&] {
    Impl& self = of(ts);
    if (!self.guard.repeats(ts, self.kept)) return;
    self.advance.idling.at(self.advance.t_before, {}, self.advance.same_time);
    self.equations->begin_step(ts);  // for the shorter step
  });
}
PetscErrorCode Integrator::Impl::PostStage(TS ts, PetscReal, PetscInt index, Vec*) {
  return guarded([&] {
    of(ts).guard.after_stage(index);
  });
}
PetscErrorCode Integrator::Impl::DomainError(TS ts, PetscReal, Vec u, PetscBool* accept) {
  return guarded([&] { *accept = of(ts).guard.accepts(u) ? PETSC_TRUE : PETSC_FALSE; });
}
PetscErrorCode Integrator::Impl::PostStep(TS ts) {
  return guarded([&] { of(ts).after_step(); });
}

// ---- one step
// ---------------------------------------------------------------------------------------------------

// Where friction is steep it goes by ln psi, and psi far below its scale may be off by decades. What errors
// may be is said anew for each step there:
// - Without mass psi follows from eta and the state, d ln psi = (d eta - F_s ds)/(psi (B + F_psi)): errors of
//   both are judged by what they make of ln psi, of which each may be rtol. psi F_psi of a logarithm is the
//   same at every psi; where it bends at rest, below the plate's velocity, that is what is taken.
// - A Rosenbrock method solves linear equations alone, and psi that rises by e-folds within a step falls
//   behind its force, which nothing shows but what its error makes of the force.
void Integrator::Impl::narrow_errors() {
  const Scene& s = model.scene();
  const bool linear = method->type == std::string(TSROSW);
  if (!adaptive || !model.friction_law(0).steep || !(s.massless() || linear)) return;
  if (!allowed) {
    allowed = model.create_vector();
    no_part = model.create_vector();
  }
  Vec u;
  SS_TRY(TSGetSolution(ts, &u));
  const double usual = scales_of(s).velocity;
  const int dof = model.dof();
  {
    const Reading a(u);
    const Writing into(allowed);
    for (PetscInt i = 0; i < model.local(); ++i) {
      const double *const at = a + i * dof, state = dof == 3 ? at[2] : 0;
      double* const of = into + i * dof;
      for (int d = 0; d < dof; ++d) of[d] = allowed_error(tolerances, d, at[d]);
      if (s.massless()) of[0] = 0;  // psi is no unknown
      if (s.held(model.first() + i)) continue;
      if (!s.massless()) {
        of[0] = std::min(of[0], of[1] / model.friction(i, at[0], state).F_psi);
        continue;
      }
      const double size = std::abs(at[0]), from = std::max(size, usual);
      const Partials p = model.friction(i, from, state);
      const double eta = tolerances.relative[0] * (s.B() * size + from * p.F_psi);
      of[1] = std::min(of[1], eta);
      if (dof == 3) of[2] = std::min(of[2], eta / std::abs(p.F_state));
    }
  }
  SS_TRY(TSSetTolerances(ts, PETSC_DECIDE, allowed, PETSC_DECIDE, no_part));
}

void Integrator::Impl::begin_step() {
  double dt;
  SS_TRY(TSGetTime(ts, &advance.t_before));
  SS_TRY(TSGetTimeStep(ts, &dt));
  SS_TRY(TSGetStepRejections(ts, &advance.rejections_seen));
  rejections_before = advance.report.rejections;
  if (stick) stick->engage();
  if (dense) dense->forget();
  shorter.forget();
  guard.begin_step(ts);
  equations->begin_step(ts);
  narrow_errors();
  if (clock_limits) set_floor();
  // A rejected step is only ever repeated with a smaller dt, so that this tells whether an output may fall
  // in.
  const bool may_need_it = dense || shorter.may_be_asked();
  has_kept =
      !fused && (guard.undoes() || stick || (may_need_it && output_due(advance.t_before + dt * (1 + 1e-12))));
  if (!has_kept) return;
  Vec u;
  SS_TRY(TSGetSolution(ts, &u));
  SS_TRY(VecCopy(u, kept));
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
  SS_TRY(TSAdaptSetStepLimits(adapt, std::min(std::max(floor, clock * std::abs(advance.t_before)), longest),
                              longest));
}

void Integrator::Impl::after_step() {
  TSConvergedReason reason;
  SS_TRY(TSGetConvergedReason(ts, &reason));
  if (reason < 0) return;  // no step was taken; advance() says why
  const Step step = step_now();
  const double reached = advance.report.t, dt = step.t - advance.t_before;
  const bool seen = guard.knows_solution() && !model.scene().massless();  // psi was put in just now
  const bool known = seen || (fused && fused->finite());
  advance.update_report(ts, model);
  model.solve_velocities(step.u);
  if (!known && !guard.all_finite(step.u)) {
    advance.report.t = reached;
    throw failure("the solution is not finite after step {} (t = {}): {}", step.index, number_text(step.t),
                  advice(dt));
  }
  if (dt == 0) {
    const std::string lost = model.velocity_jump(step.u);
    throw failure("the step has shrunk to nothing at t = {} (step {}); {}", number_text(step.t), step.index,
                  lost.empty() ? "loosen ts_rtol and ts_atol, or remove jumps from the scene" : lost);
  }
  check_floor(step);
  if (reaches_balance(step)) SS_TRY(TSRestartStep(ts));
  if (stick) return stick->after(step, before());
  advance.tell(ts, step);
  advance.done(ts, step);
}

// Steps meet what falls at once by being rejected, or end at their floor. What bdf remembers of earlier steps
// does not go with a psi that was put in.
bool Integrator::Impl::reaches_balance(const Step& step) const {
  const bool was_rejected = advance.report.rejections > rejections_before;
  return adaptive && method->type != std::string(TSBDF) && (was_rejected || steps_at_floor > 0) &&
         balance_at_once(model, tolerances, std::max(advance.same_time, clock * std::abs(step.t)), step.u);
}

std::string Integrator::Impl::instead() const {
  const bool remembers = method->type == std::string(TSBDF) && model.friction_law(0).steep;
  return remembers ? ", or take ts_type arkimex or rosw, by which psi may fall by decades at once" : "";
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
                          step.t + 2 * reach >= advance.t_end);
  steps_at_floor = at_floor ? steps_at_floor + 1 : 0;
  if (!at_floor || (least > floor && steps_at_floor < most)) return;
  advance.report.t = advance.t_before;
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
  Vec u;
  double t, dt;
  SS_TRY(TSGetSolution(ts, &u));
  SS_TRY(TSGetTime(ts, &t));
  SS_TRY(TSGetTimeStep(ts, &dt));
  // this one was cut short to end at a corner
  if (!adaptive && t == advance.t_end && t < advance.run_end) dt = fixed_dt;
  return {
      advance.steps(ts), advance.t_before, t, u, dt, [this](double at, Vec into) { interpolate(at, into); }};
}

std::string Integrator::Impl::advice(double dt) const {
  Vec u;
  SS_TRY(TSGetSolution(ts, &u));
  if (const std::string lost = model.velocity_jump(u); !lost.empty()) return lost;
  const Law law = model.scene().friction.law;
  if (!law->only_for.empty())
    return fmt::format("friction_law {} holds for {} alone, and a step may have led beyond", to_string(law),
                       law->only_for);
  const Implicit implicit = equations->implicit();
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

// ---- between steps
// ----------------------------------------------------------------------------------------------

bool Integrator::Impl::output_due(double until) {
  return next_output_time && next_output_time(advance.t_before) <= until;
}

void Integrator::Impl::interpolate(double at, Vec into) {
  double t;
  Vec u;
  SS_TRY(TSGetTime(ts, &t));
  SS_TRY(TSGetSolution(ts, &u));
  // The end of a step may miss the time that it was to meet by round-off; a polynomial through slopes misses
  // u by its error.
  if (std::abs(at - t) <= 4 * std::numeric_limits<double>::epsilon() * std::abs(t)) {
    SS_TRY(VecCopy(u, into));
    return;
  }
  const double dt = t - advance.t_before, part = (at - advance.t_before) / dt;
  const bool has_begin = fused || has_kept;
  if (dense && !has_begin) throw std::logic_error("interpolation at a time that was not announced");
  if (has_begin && shorter.is_needed(before(), u, dt)) {
    if (stick) stick->engage();
    shorter.take(before(), u, advance.t_before, dt, part, tolerances, into);
  } else if (dense) {
    if (stick) stick->engage();
    dense->interpolate(before(), u, advance.t_before, dt, part, into);
  } else if (fused) {
    fused->interpolate(part, into);
  } else {
    SS_TRY(TSInterpolate(ts, at, into));
  }
  model.solve_velocities(into);
  // About to explode: u is finite still, its cube is not.
  if (!guard.all_finite(into))
    throw failure("the solution is not finite at t = {} (step {}): {}", number_text(at), advance.report.steps,
                  advice(dt));
}

// ---- a run
// ------------------------------------------------------------------------------------------------------

void Integrator::Impl::start(Vec u, double t, double t_end, const Observer& observer,
                             std::int64_t max_steps) {
  advance.observer = &observer;
  advance.t_end = advance.run_end = t_end;
  advance.t_before = t;
  advance.stop_asked = advance.plate_is_over = false;
  advance.idling.restart();
  advance.max_steps = max_steps;
  advance.evaluations_before = model.rhs_evaluations();
  SS_TRY(TSSetTime(ts, t));
  SS_TRY(TSSetMaxTime(ts, t_end));
  if (checkpoint) SS_TRY(TSSetTimeStep(ts, checkpoint->dt));
  advance.begin_count(ts, checkpoint ? checkpoint->step : advance.steps(ts));
  SS_TRY(TSRestartStep(ts));
  SS_TRY(TSSetSolution(ts, u));
  advance.update_report(ts, model);
  if (checkpoint) pass_corner(u, t);
  model.begin_load(t);
  if (!checkpoint) advance.plate->set(model, t, t, true);
  if (!checkpoint) advance.tell(ts, step_now());
  checkpoint.reset();
  guard.start();
}

// At a corner of the loads steps end, and checkpoints hold what was before it.
void Integrator::Impl::pass_corner(Vec u, double t) const {
  model.begin_load(std::nextafter(t, -1.));
  model.pass_corner(u, t);
}

// From one corner of the loads to the next.
TSConvergedReason Integrator::Impl::solve(Vec u) {
  if (!model.scene().forced()) return solve_piece(u);
  for (;;) {
    double t, dt;
    SS_TRY(TSGetTime(ts, &t));
    SS_TRY(TSGetTimeStep(ts, &dt));
    advance.t_end = std::min(advance.run_end, model.scene().next_corner(t));
    model.begin_load(t);
    SS_TRY(TSSetMaxTime(ts, advance.t_end));
    SS_TRY(TSSetTimeStep(ts, std::min(dt, advance.t_end - t)));
    const TSConvergedReason reason = solve_piece(u);
    advance.update_report(ts, model);
    if (reason < 0 || advance.stop_asked || advance.report.t >= advance.run_end || reason == TS_CONVERGED_ITS)
      return reason;
    pass_corner(u, advance.report.t);
    SS_TRY(TSSetTimeStep(ts, adaptive ? advance.next_dt : fixed_dt));
    SS_TRY(TSRestartStep(ts));
  }
}

// PETSc refuses norms of what is not finite, on every rank alike.
void Integrator::Impl::solve_finite(Vec u) {
  try {
    SS_TRY(TSSolve(ts, u));
  } catch (const RankFailure& e) {
    if (std::string(e.what()).find("not-a-number") == std::string::npos) throw;
    double dt;
    SS_TRY(TSGetTimeStep(ts, &dt));
    throw failure("the solution is not finite behind t = {} (step {}): {}", number_text(advance.report.t),
                  advance.report.steps, advice(dt));
  }
}

TSConvergedReason Integrator::Impl::solve_piece(Vec u) {
  TSConvergedReason reason = TS_CONVERGED_ITERATING;
  if (stick) {
    double dt = 0;
    if (!adaptive) SS_TRY(TSGetTimeStep(ts, &dt));
    if (!adaptive && model.scene().forced()) dt = fixed_dt;
    stick->start(u, dt);
    SS_TRY(TSGetConvergedReason(ts, &reason));
  }
  if (reason == TS_CONVERGED_ITERATING) solve_finite(u);
  SS_TRY(TSGetConvergedReason(ts, &reason));
  return reason;
}

void Integrator::Impl::fail(TSConvergedReason reason) const {
  const std::string at =
      fmt::format(" at t = {} (step {})", number_text(advance.report.t), advance.report.steps);
  if (reason == TS_DIVERGED_NONLINEAR_SOLVE)
    throw Failure("Newton's method failed in the implicit part" + at + "; reduce ts_dt");
  bool unsolved = fused && !fused->solved();
  if (!fused && equations->has_implicit()) {
    SNES snes;
    SNESConvergedReason newton;
    SS_TRY(TSGetSNES(ts, &snes));
    SS_TRY(SNESGetConvergedReason(snes, &newton));
    unsolved = newton < 0;
  }
  Vec u;
  SS_TRY(TSGetSolution(ts, &u));
  if (const std::string lost = model.velocity_jump(u); !lost.empty()) throw Failure(lost + at);
  throw Failure("the time step was rejected more than " + std::to_string(most_rejections()) +
                " times (ts_max_reject)" + at +
                (unsolved ? ": Newton's method fails in the implicit part" : "") +
                "; reduce ts_dt or loosen ts_rtol and ts_atol" + instead());
}

Integrator::Integrator(const Model& model, const MethodSpec& method, Vec u, const std::string& prefix)
    : impl_(std::make_unique<Impl>(model, prefix)) {
  impl_->set_up(method, u);
}
Integrator::~Integrator() = default;

void Integrator::set_output_times(std::function<double(double)> next_time) {
  impl_->next_output_time = std::move(next_time);
}

void Integrator::drive_by(Plate& plate) { impl_->advance.plate = &plate; }

void Integrator::continue_from(std::int64_t step, double dt) {
  impl_->checkpoint = {step, dt};
  SS_TRY(TSSetTimeStep(impl_->ts, dt));
}

TimeReport Integrator::advance(Vec u, double t, double t_end, const Observer& observer,
                               std::int64_t max_steps) {
  Impl& m = *impl_;
  m.start(u, t, t_end, observer, max_steps);
  TimeReport& report = m.advance.report;
  report.reason = "end time";
  if (m.advance.stop_asked || t >= t_end) return report;
  const TSConvergedReason reason = m.solve(u);
  m.advance.update_report(m.ts, m.model);
  if (reason < 0) m.fail(reason);
  report.reason = reason == TS_CONVERGED_ITS ? "ts_max_steps"
                  : m.advance.plate_is_over  ? "ts_max_plate"
                  : m.advance.stop_asked     ? "stopped"
                                             : "end time";
  return report;
}

const TimeReport& Integrator::report() const { return impl_->advance.report; }
const Tolerances& Integrator::tolerances() const { return impl_->tolerances; }
void Integrator::set_tolerances(const Tolerances& tolerances) { impl_->set_tolerances(tolerances); }
bool Integrator::adaptive() const { return impl_->adaptive; }
const Method& Integrator::method() const { return *impl_->method; }
TS Integrator::ts() const { return impl_->ts; }

}  // namespace stickslip
