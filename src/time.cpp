#include "stickslip/time.hpp"

#include <algorithm>
#include <cmath>

#if __has_include(<petsc/private/tsimpl.h>)
#include <petsc/private/tsimpl.h>  // for writers of TS types: what a step of one's own needs
#define STICKSLIP_FUSED_STEP
#endif

#include "fused_step.hpp"
#include "step_forecast.hpp"
#include "stickslip/error.hpp"
#include "stickslip/methods.hpp"
#include "stickslip/ode.hpp"
#include "stickslip/stick.hpp"

namespace stickslip {

std::string to_string(Implicit implicit) {
  switch (implicit) {
    case Implicit::friction:
      return "friction";
    case Implicit::wave:
      return "wave";
    case Implicit::both:
      return "both";
    default:
      return "none";
  }
}

namespace {

// The parts of the right-hand side on either side of udot - G(u) = F(u).
struct Split {
  bool has_explicit, has_implicit;
  Part explicit_part, implicit_part;
};

Split split_of(Implicit implicit) {
  switch (implicit) {
    case Implicit::friction:
      return {true, true, Part::stencil, Part::pointwise};
    case Implicit::wave:
      return {true, true, Part::reaction, Part::wave};
    case Implicit::both:
      return {false, true, Part::full, Part::full};
    default:
      return {true, false, Part::full, Part::full};
  }
}

constexpr double default_tolerance = 1e-6;  // relative and absolute, of a step
constexpr PetscInt most_rejections = 60;    // of one step

// Local part of "is every entry finite", and so far from overflow (1e42) that its cube in the friction and the square
// of that in PETSc's estimate of the error are, too: x - x is 0 for finite x and NaN otherwise, and NaN stays.
bool locally_finite(Vec u) {
  const double* a;
  PetscInt count;
  SS_TRY(VecGetLocalSize(u, &count));
  SS_TRY(VecGetArrayRead(u, &a));
  double sum = 0;
  for (PetscInt i = 0; i < count; ++i) {
    const double x = 1e60 * a[i], cube = x * x * x;
    sum += cube - cube;
  }
  SS_TRY(VecRestoreArrayRead(u, &a));
  return sum == 0;
}

// The rate of friction over the velocities that a run will meet, not at the start alone: at least up to the
// velocity at which the cubic's limit cycle turns, 2.
double friction_rate_ahead(const Model& model, Vec u) {
  double rate = model.friction_rate(u);
  const Scene& s = model.scene();
  if (s.friction.law == Law::cubic) rate = std::max(rate, s.A() * std::abs(s.B() + 3));
  if (Stick::applies_to(s) && s.friction.law == Law::carlson_langer)
    rate = std::max(rate, s.A() * (s.B() + 2 * s.friction.alpha));  // at the start of a slip
  if (model.dof() == 3 && s.v != 0) rate = std::max(rate, -model.state_rate(s.v, model.steady_state(s.v)).g_state);
  if (s.friction.regularised) rate = std::max(rate, s.A() * (s.B() + 1 / s.friction.eps));
  return rate;
}

// Weights of slopes at the points i/(count - 1) in the integral of their interpolating polynomial over [0, s].
std::vector<double> integration_weights(int count, double s) {
  const auto n = static_cast<std::size_t>(count);
  std::vector<double> powers(n * n), weights(n);
  double power = s;
  for (std::size_t k = 0; k < n; ++k, power *= s) {
    weights[k] = power / double(k + 1);
    for (std::size_t i = 0; i < n; ++i) powers[k * n + i] = std::pow(double(i) / double(n - 1), double(k));
  }
  solve_dense(count, powers.data(), 1, weights.data());
  return weights;
}

}  // namespace

Rates rates_of(const Model& model, Vec u) {
  const double wave = model.wave_frequency(), friction = friction_rate_ahead(model, u);
  // An accurate step of the explicit pair resolves times of order 0.1 in the scene's own unit of time,
  // 1/sqrt(A K0), the period of a free block; it is stable up to about 3 over the fastest frequency.
  const double own = std::sqrt(model.scene().A() * model.scene().K0());
  const double accurate = 40 * (own > 0 ? own : 1);
  // At equal error a step with implicit friction costs some 30 explicit ones, one with an implicit wave some 60
  // (docs/chart.md; rk takes its stages tile by tile).
  // Rate-and-state friction creeps at velocities over many decades, down to where its rate A a/psi has no bound.
  const bool creeps = model.scene().friction.law == Law::rate_and_state;
  return {wave, friction, creeps || friction > 30 * std::max(wave, accurate), wave > 60 * std::max(friction, accurate)};
}

struct Integrator::Impl {
  const Model& model;
  std::string prefix;
  DmHandle dm;
  TsHandle ts;
  MatHandle J;
  std::string type, subtype;
  const Method* method = nullptr;
  bool adaptive = false;
  bool started = false;        // a step has been accepted
  PetscInt stage = 0;          // the stage that was computed last
  PetscInt last_stage = -1;    // of rk
  bool first_same_as_last = false, checked_last = false;
  Implicit implicit = Implicit::none;
  Split split{};
  double last_shift = std::numeric_limits<double>::quiet_NaN();
  TimeReport report;
  long evaluations_before = 0;

  // dense output: by TS, or by a polynomial of degree own_degree through u and its slopes
  std::vector<double> output_times;
  std::size_t next_output = 0;
  int own_degree = 0;
  VecHandle before;
  std::vector<VecHandle> slopes, better_slopes;  // at equal distances over the step
  int degree_now = 0;                            // of the polynomial that `slopes` stand for; 0: none yet
  bool kept_before = false;
  std::unique_ptr<FusedStep> fused;  // takes the place of PETSc's step of rk
  FusedStep::Outcome fused_outcome{};
  std::vector<VecHandle> fused_slopes;
  bool fused_slopes_kept = false;    // those of the last step
  double fused_dt = 0;
  bool undo_exactly = false;   // see PreStage
  bool keeps_jacobian = false; // one Jacobian for the stages of a step, see ConvergedOrRefresh
  double last_residual = 0;
  PetscInt rejections_seen = 0;
  double t_before = 0;
  const Observer* observer = nullptr;
  double t_end = 0;
  bool stop_asked = false;
  bool continued = false;
  PetscInt first_step = 0;
  double saved_dt = 0;

  // friction that sticks
  std::unique_ptr<Stick> stick;
  VecHandle landed;            // u where the step is cut
  PetscInt max_steps = 0, coarse = 0;
  double own_dt = 0;           // of a method of fixed steps

  Impl(const Model& m, const std::string& p) : model(m), prefix(p) {}

  // ---- callbacks ----
  static PetscErrorCode RHSFunction(TS, PetscReal, Vec u, Vec f, void* context) {
    return guarded([&] {
      auto& self = *static_cast<Impl*>(context);
      self.model.rhs(self.split.explicit_part, u, f);
    });
  }
  // udot - G(u)
  static PetscErrorCode IFunction(TS, PetscReal, Vec u, Vec udot, Vec f, void* context) {
    return guarded([&] {
      auto& self = *static_cast<Impl*>(context);
      if (self.split.has_implicit) {
        self.model.rhs(self.split.implicit_part, u, f);
        SS_TRY(VecAYPX(f, -1, udot));
      } else {
        SS_TRY(VecCopy(udot, f));
      }
    });
  }
  // shift I - dG/du
  static PetscErrorCode IJacobian(TS, PetscReal, Vec u, Vec, PetscReal shift, Mat, Mat P, void* context) {
    return guarded([&] {
      auto& self = *static_cast<Impl*>(context);
      // The wave part is linear: while the shift stands, so do the matrix and its factors.
      const bool constant = self.implicit == Implicit::wave || !self.split.has_implicit;
      if (constant && shift == self.last_shift) return;
      if (self.split.has_implicit) {
        self.model.jacobian(self.split.implicit_part, u, shift, -1, P);
      } else {
        self.model.jacobian(Part::pointwise, u, shift, 0, P);
      }
      self.last_shift = shift;
    });
  }

  // Newton's step, before the line search takes it.
  static PetscErrorCode TameStep(SNESLineSearch, Vec u, Vec minus_step, PetscBool* changed, void* context) {
    return guarded([&] {
      auto& self = *static_cast<Impl*>(context);
      *changed = self.model.tame_newton_step(u, self.last_shift, minus_step) ? PETSC_TRUE : PETSC_FALSE;
    });
  }

  // The stages of a diagonally implicit step share one Jacobian, that of its first round of Newton's method: a round
  // with an old one costs a tenth of a round with a new one. It is made anew where the residual falls so slowly that
  // this pays.
  static PetscErrorCode ConvergedOrRefresh(SNES snes, PetscInt round, PetscReal x, PetscReal step, PetscReal residual,
                                           SNESConvergedReason* reason, void* context) {
    return guarded([&] {
      auto& self = *static_cast<Impl*>(context);
      SS_TRY(SNESConvergedDefault(snes, round, x, step, residual, reason, nullptr));
      const double before = std::exchange(self.last_residual, residual);
      if (*reason || round == 0) return;
      PetscReal target;
      SS_TRY(SNESGetTolerances(snes, &target, nullptr, nullptr, nullptr, nullptr));
      const double rounds = self.implicit == Implicit::both ? 8 : 4;  // with an old one that cost what a new one does
      if (!(residual * std::pow(residual / before, rounds) < target)) SS_TRY(SNESSetLagJacobian(snes, -2));
    });
  }

  // At the next round of Newton's method, which keeps it from then on.
  void refresh_jacobian() {
    SNES snes;
    SS_TRY(TSGetSNES(ts, &snes));
    SS_TRY(SNESSetLagJacobian(snes, -2));
  }

  static PetscErrorCode PreStep(TS ts) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      auto& self = *static_cast<Impl*>(context);
      double dt;
      SS_TRY(TSGetTime(ts, &self.t_before));
      if (self.stick) self.stick->engage();
      SS_TRY(TSGetTimeStep(ts, &dt));
      self.kept_before = false;
      self.degree_now = 0;
      SS_TRY(TSGetStepRejections(ts, &self.rejections_seen));
      if (self.keeps_jacobian) self.refresh_jacobian();
      // A rejected step is only ever repeated with a smaller dt, so that this tells whether an output may fall in.
      if (self.undo_exactly || self.fused || self.stick ||
          (self.own_degree > 0 && self.output_due(self.t_before + dt * (1 + 1e-12)))) {
        Vec u;
        SS_TRY(TSGetSolution(ts, &u));
        SS_TRY(VecCopy(u, self.before));
        self.kept_before = true;
      }
    });
  }

  // PETSc undoes a rejected step of rk and arkimex by subtracting what it added, which after a step far too large
  // leaves nothing of u but round-off. So u is put back from a copy before the step is tried again.
  static PetscErrorCode PreStage(TS ts, PetscReal) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      auto& self = *static_cast<Impl*>(context);
      PetscInt rejections;
      SS_TRY(TSGetStepRejections(ts, &rejections));
      if (rejections == self.rejections_seen) return;
      self.rejections_seen = rejections;
      if (self.keeps_jacobian) self.refresh_jacobian();  // for the shorter step
      if (!self.undo_exactly) return;
      Vec u;
      SS_TRY(TSGetSolution(ts, &u));
      SS_TRY(VecCopy(self.before, u));
    });
  }

  static PetscErrorCode PostStage(TS ts, PetscReal, PetscInt index, Vec*) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      static_cast<Impl*>(context)->stage = index;
    });
  }

  // Adaptive methods only: a stage that is not finite rejects the step, which PETSc would accept, since no
  // comparison with NaN is true. What goes wrong in an early stage of rk reaches the last one, so that later
  // steps look at that alone.
  static PetscErrorCode DomainError(TS ts, PetscReal, Vec u, PetscBool* accept) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      auto& self = *static_cast<Impl*>(context);
      *accept = PETSC_TRUE;
      const bool last = self.stage == self.last_stage;
      if (self.last_stage >= 0 && self.started && !last) return;
      *accept = self.finite(u) ? PETSC_TRUE : PETSC_FALSE;
      self.checked_last = last;
    });
  }

  bool finite(Vec u) const {
    int all = locally_finite(u) ? 1 : 0;
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT, MPI_MIN, model.comm()));
    return all != 0;
  }

  static PetscErrorCode PostStep(TS ts) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      static_cast<Impl*>(context)->after_step();
    });
  }

  bool output_due(double until) {
    while (next_output < output_times.size() && output_times[next_output] <= t_before) ++next_output;
    return next_output < output_times.size() && output_times[next_output] <= until;
  }

  void interpolate(double at, Vec into) {
    double t;
    Vec u;
    SS_TRY(TSGetTime(ts, &t));
    SS_TRY(TSGetSolution(ts, &u));
    if (at == t) {
      SS_TRY(VecCopy(u, into));
    } else if (own_degree == 0 && fused) {
      interpolate_fused((at - t_before) / (t - t_before), into);
    } else if (own_degree == 0) {
      SS_TRY(TSInterpolate(ts, at, into));
    } else {
      if (!kept_before) throw std::logic_error("interpolation at a time that was not announced");
      if (stick) stick->engage();
      refine(u, t - t_before);
      polynomial(degree_now, u, t - t_before, (at - t_before) / (t - t_before), into);
    }
    // About to explode: u is finite still, its cube is not.
    if (at != t && !finite(into))
      throw Failure("the solution is not finite at t = " + number_text(at) + " (step " +
                    std::to_string(report.steps) + "): " + advice(t - t_before));
  }

  // The cubic through u and its slopes at both ends of the step errs by dt^4. Slopes of that cubic inside the step err
  // by as much, times dt in their integral: the quartic through them errs by dt^5, and so on, one order for each round
  // of new slopes. Only for explicit methods, whose steps are short enough for it.
  void refine(Vec u, double dt) {
    if (degree_now == own_degree) return;
    const auto slope_at = [](std::vector<VecHandle>& list, int i) -> VecHandle& {
      return list[static_cast<std::size_t>(i)];
    };
    while (static_cast<int>(slopes.size()) < std::max(2, own_degree)) {
      slopes.push_back(model.create_vector());
      better_slopes.push_back(model.create_vector());
    }
    model.rhs(Part::full, before, slope_at(slopes, 0));
    model.rhs(Part::full, u, slope_at(slopes, 1));
    degree_now = 3;
    for (int degree = 4; degree <= own_degree; ++degree) {
      const int count = degree;  // slopes of a polynomial of this degree
      const int last = degree_now == 3 ? 1 : degree_now - 1;
      for (int i = 1; i + 1 < count; ++i) {
        polynomial(degree_now, u, dt, double(i) / double(count - 1), work);
        model.rhs(Part::full, work, slope_at(better_slopes, i));
      }
      std::swap(slope_at(better_slopes, 0), slope_at(slopes, 0));
      std::swap(slope_at(better_slopes, count - 1), slope_at(slopes, last));
      std::swap(slopes, better_slopes);
      degree_now = degree;
    }
  }
  VecHandle work;

  void polynomial(int degree, Vec u, double dt, double s, Vec into) {
    std::vector<double> weights;
    std::vector<Vec> terms;
    if (degree == 3) {
      weights = {(1 + 2 * s) * (1 - s) * (1 - s), s * s * (3 - 2 * s), dt * s * (1 - s) * (1 - s),
                 dt * s * s * (s - 1)};
      terms = {before, u, slopes[0], slopes[1]};
    } else {
      weights = integration_weights(degree, s);
      for (double& w : weights) w *= dt;
      for (int i = 0; i < degree; ++i) terms.push_back(slopes[static_cast<std::size_t>(i)]);
      weights.push_back(1);
      terms.push_back(before);
    }
    SS_TRY(VecZeroEntries(into));
    SS_TRY(VecMAXPY(into, static_cast<PetscInt>(terms.size()), weights.data(), terms.data()));
  }

  void update_report() {
    double t;
    SS_TRY(TSGetTime(ts, &t));
    report.t = t;
    SS_TRY(TSGetStepNumber(ts, &report.steps));
    SS_TRY(TSGetStepRejections(ts, &report.rejections));
    report.rejections += coarse;
    report.rhs_evaluations = model.rhs_evaluations() - evaluations_before;
  }

  Step step_now() {
    Vec u;
    double t, dt;
    PetscInt index;
    SS_TRY(TSGetSolution(ts, &u));
    SS_TRY(TSGetTime(ts, &t));
    SS_TRY(TSGetTimeStep(ts, &dt));
    SS_TRY(TSGetStepNumber(ts, &index));
    return {index, t_before, t, u, dt, [this](double at, Vec into) { interpolate(at, into); }};
  }

  void after_step() {
    TSConvergedReason reason;
    SS_TRY(TSGetConvergedReason(ts, &reason));
    if (reason < 0) return;  // no step was taken; advance() says why
    const Step step = step_now();
    const double reached = report.t;
    // the last stage is the solution
    const bool known = fused ? fused_outcome.finite : adaptive && first_same_as_last && checked_last;
    checked_last = false;
    update_report();
    if (!known && !finite(step.u)) {
      report.t = reached;
      throw Failure("the solution is not finite after step " + std::to_string(step.index) + " (t = " +
                    number_text(step.t) + "): " + advice(step.t - t_before));
    }
    if (step.t == t_before)
      throw Failure("the step has shrunk to nothing at t = " + number_text(step.t) + " (step " +
                    std::to_string(step.index) + "); loosen ts_rtol and ts_atol, or smooth what is not smooth");
    check_floor(step);
    started = true;
    if (stick) stick_after(step);
    else tell(step);
  }

  // At ts_adapt_dt_min PETSc accepts a step whatever its error. That the next one should be no longer tells that this
  // one's error was at the tolerance or beyond.
  void check_floor(const Step& step) {
    if (!adaptive) return;
    TSAdapt adapt;
    double floor;
    SS_TRY(TSGetAdapt(ts, &adapt));
    SS_TRY(TSAdaptGetStepLimits(adapt, &floor, nullptr));
    const double reach = floor * (1 + 1e-7);
    // close to the end steps are cut to hit it
    if (step.t - step.t_before > reach || step.next_dt > reach || step.t + 2 * reach >= t_end) return;
    report.t = t_before;
    throw Failure("the step fell to its floor ts_adapt_dt_min " + number_text(floor) + " at t = " +
                  number_text(step.t) + " (step " + std::to_string(step.index) +
                  ") with an error above the tolerance; lower ts_adapt_dt_min, or loosen ts_rtol and ts_atol");
  }

  void decide(Vec u) {
    stick->decide(u);
    if (fused) fused->set_direction(stick->direction());
  }

  // Cuts the step at the first change between rest and sliding, and passes over times when everything rests.
  void stick_after(Step step) {
    const double dt = step.t - t_before;
    Vec u = step.u;
    const auto at = [&](double part, Vec into) { interpolate(t_before + part * dt, into); };
    const Stick::Change change =
        stick->first_change(before, u, dt, at, landed, fused && fused->last_is_solution());
    if (change.kind == Stick::Change::Kind::too_coarse) {
      SS_TRY(VecCopy(before, u));
      ++coarse;
      if (!(t_before + dt / 8 > t_before))
        throw Failure("a node that lets go does not begin to slide at t = " + number_text(t_before) + " (step " +
                      std::to_string(step.index) + ")");
      SS_TRY(TSSetStepNumber(ts, step.index - 1));
      go_on_from(t_before, dt / 8);
      update_report();
      return;
    }
    if (change.kind == Stick::Change::Kind::none) {
      if (own_dt > 0 && step.next_dt < own_dt) go_on_from(step.t, own_dt);
      if (tell(step) == Verdict::restart) decide(u);  // as a run that goes on from here will
      return;
    }
    step.t = change.part == 1 ? step.t : t_before + change.part * dt;
    step.u = landed;
    step.next_dt = own_dt > 0 ? own_dt : std::min(step.next_dt, dt);
    step.interpolate = [this, t = step.t](double when, Vec into) {
      if (when == t) SS_TRY(VecCopy(landed, into));
      else interpolate(when, into);
    };
    report.t = step.t;
    if (step.t > t_before) tell(step);
    else SS_TRY(TSSetStepNumber(ts, step.index - 1));
    SS_TRY(VecCopy(landed, u));
    decide(u);
    go_on_from(step.t, step.next_dt);
    pass_rest(u);
  }

  // The next step starts anew, at t and of length dt, unless the run is over.
  void go_on_from(double t, double dt) {
    SS_TRY(TSSetTime(ts, t));
    SS_TRY(TSSetTimeStep(ts, std::min(dt, t_end - t)));
    SS_TRY(TSRestartStep(ts));
    PetscInt index;
    SS_TRY(TSGetStepNumber(ts, &index));
    SS_TRY(TSSetConvergedReason(ts, stop_asked           ? TS_CONVERGED_USER
                                    : t >= t_end         ? TS_CONVERGED_TIME
                                    : index >= max_steps ? TS_CONVERGED_ITS
                                                         : TS_CONVERGED_ITERATING));
  }

  // While everything rests one step leads to the next release, or to the end.
  void pass_rest(Vec u) {
    double t, dt;
    PetscInt index;
    SS_TRY(TSGetTime(ts, &t));
    SS_TRY(TSGetTimeStep(ts, &dt));
    SS_TRY(TSGetStepNumber(ts, &index));
    for (int without_time = 0; stick->all_rest() && t < t_end && !stop_asked && index < max_steps;) {
      const double wait = stick->release_after(u), until = t + wait < t_end ? t + wait : t_end;
      stick->rest(u, until == t_end ? t_end - t : wait, landed);
      if (until > t) {
        t_before = t;
        SS_TRY(TSSetStepNumber(ts, ++index));
        SS_TRY(TSSetTime(ts, until));
        update_report();
        tell({index, t, until, landed, dt, [this, u, t, until](double when, Vec into) {
                if (when == until) SS_TRY(VecCopy(landed, into));
                else stick->rest(u, when - t, into);
              }});
        without_time = 0;
      } else if (++without_time > 100) {
        throw Failure("nodes let go and rest again without end at t = " + number_text(t));
      }
      SS_TRY(VecCopy(landed, u));
      t = until;
      decide(u);
      go_on_from(t, dt);
    }
  }

  Verdict tell(const Step& step) {
    if (!*observer) return Verdict::go_on;
    const Verdict verdict = (*observer)(step);
    if (verdict == Verdict::restart) SS_TRY(TSRestartStep(ts));
    if (verdict == Verdict::stop && step.t < t_end) {
      stop_asked = true;
      SS_TRY(TSSetConvergedReason(ts, TS_CONVERGED_USER));
    }
    return verdict;
  }

  std::string advice(double dt) const {
    if (implicit == Implicit::both) return "reduce ts_dt or the tolerances";
    std::string text = "an explicit step of " + number_text(dt) + " is too large";
    const double frequency = model.wave_frequency();
    if (implicit != Implicit::wave && dt * frequency > 1)
      text += "; the shortest wave turns at " + number_text(frequency) + " per unit time";
    return text + "; reduce ts_dt, or choose an implicit method (ts_type arkimex)";
  }

  // ---- rk with all its stages tile by tile (fused_step.hpp); everything else of PETSc's rk stays in use ----
#ifdef STICKSLIP_FUSED_STEP
  void fuse() {
    const PetscReal *A, *b, *c, *embedded, *interpolating;
    PetscInt stages, degree;
    PetscBool fsal, multirate;
    SS_TRY(TSRKGetMultirate(ts, &multirate));
    SS_TRY(TSRKGetTableau(ts, &stages, &A, &b, &c, &embedded, &degree, &interpolating, &fsal));
    RungeKutta tableau{stages, {A, A + stages * stages}, {b, b + stages}, {}};
    if (embedded) tableau.embedded.assign(embedded, embedded + stages);
    if (multirate || ts.get()->adapt->ignore_max >= 0 || stages > FusedStep::most_stages) return;
    fused = std::make_unique<FusedStep>(model, tableau, stick != nullptr);
    ts.get()->ops->setup = nullptr;  // would make a vector and a slope for every stage
    ts.get()->ops->step = FusedTSStep;
    ts.get()->ops->evaluatewlte = FusedWLTE;
    ts.get()->ops->evaluatestep = nullptr;
    ts.get()->ops->interpolate = nullptr;
    ts.get()->ops->rollback = nullptr;
  }

  static PetscErrorCode FusedWLTE(TS ts, NormType, PetscInt* order, PetscReal* wlte) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      const auto& self = *static_cast<Impl*>(context);
      *order = self.method->order;
      *wlte = self.fused_outcome.error;
    });
  }

  static PetscErrorCode FusedTSStep(TS ts) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      static_cast<Impl*>(context)->fused_step();
    });
  }

  void fused_step() {
    TSAdapt adapt;
    double ccfl = 1;
    SS_TRY(TSGetAdapt(ts, &adapt));
    static const std::vector<VecHandle> none;
    for (PetscInt rejected = 0; !ts.get()->reason;) {
      const double dt = ts.get()->time_step;
      fused_dt = dt;
      fused_slopes_kept = own_degree == 0 && output_due(t_before + dt * (1 + 1e-12));
      if (fused_slopes_kept) make_fused_slopes();
      fused_outcome = fused->take(before, dt, ts.get()->atol, ts.get()->rtol, adapt->wnormtype, adaptive,
                                  ts.get()->vec_sol, fused_slopes_kept ? fused_slopes : none,
                                  stick && fused->last_is_solution() ? stick->slope_at_end() : nullptr);
      PetscBool accept = rejected > 0 ? PETSC_FALSE : PETSC_TRUE;  // read too: a second rejection shortens more
      if (adaptive && !fused_outcome.finite) {
        double scale;
        SS_TRY(TSAdaptGetScaleSolveFailed(adapt, &scale));
        ts.get()->time_step = scale * dt;
      } else {
        double next_dt;
        SS_TRY(TSAdaptCandidatesClear(adapt));
        SS_TRY(TSAdaptCandidateAdd(adapt, subtype.c_str(), method->order, 1, ccfl, double(last_stage + 1), PETSC_TRUE));
        SS_TRY(TSAdaptChoose(adapt, ts, dt, nullptr, &next_dt, &accept));
        if (accept) ts.get()->ptime += dt;
        ts.get()->time_step = next_dt;
        if (accept) return;
      }
      ++ts.get()->reject;
      if (!ts.get()->reason && ++rejected > ts.get()->max_reject && ts.get()->max_reject >= 0)
        ts.get()->reason = TS_DIVERGED_STEP_REJECTED;
    }
    SS_TRY(VecCopy(before, ts.get()->vec_sol));
  }
#else
  void fuse() {}
#endif

  void make_fused_slopes() {
    while (static_cast<int>(fused_slopes.size()) <= last_stage) fused_slopes.push_back(model.create_vector());
  }

  // u at the part s of the step, by the method's own polynomial. Where a node stops or starts in a step, which nobody
  // announces, the step is taken once more for its slopes.
  void interpolate_fused(double s, Vec into) {
    if (!fused_slopes_kept) {
      make_fused_slopes();
      fused->take(before, fused_dt, 1, 0, NORM_2, false, into, fused_slopes);
      fused_slopes_kept = true;
    }
    const PetscReal *A, *b, *c, *embedded, *interpolating;
    PetscInt stages, degree;
    PetscBool fsal;
    SS_TRY(TSRKGetTableau(ts, &stages, &A, &b, &c, &embedded, &degree, &interpolating, &fsal));
    std::vector<double> weights(static_cast<std::size_t>(stages));
    std::vector<Vec> terms(fused_slopes.begin(), fused_slopes.end());
    for (PetscInt i = 0; i < stages; ++i) {
      double power = fused_dt;
      for (PetscInt j = 0; j < degree; ++j) {
        power *= s;
        weights[static_cast<std::size_t>(i)] += power * interpolating[i * degree + j];
      }
    }
    SS_TRY(VecCopy(before, into));
    SS_TRY(VecMAXPY(into, stages, weights.data(), terms.data()));
  }

  // ---- set-up ----
  Rates rates{};

  void set_up(const Options& options, Vec u) {
    if (Stick::applies_to(model.scene())) {
      stick = std::make_unique<Stick>(model);
      landed = model.create_vector();
    }
    SS_TRY(TSCreate(model.comm(), ts.out()));
    SS_TRY(TSSetOptionsPrefix(ts, prefix.c_str()));
    // PETSc keeps the callbacks of a TS on its DM, where those of an earlier Integrator would stay and be called.
    SS_TRY(DMClone(model.dm(), dm.out()));
    SS_TRY(TSSetDM(ts, dm));
    SS_TRY(TSSetApplicationContext(ts, this));
    SS_TRY(TSSetProblemType(ts, TS_NONLINEAR));
    rates = rates_of(model, u);

    const std::string wish = options.text("imex_implicit");
    Implicit automatic = Implicit::none;
    if (rates.stiff_friction) automatic = rates.stiff_wave ? Implicit::both : Implicit::friction;
    else if (rates.stiff_wave) automatic = stick ? Implicit::both : Implicit::wave;
    const bool wants_imex = wish != "auto" && wish != "none";

    // The type decides what is implicit, so it is read before the functions are set.
    // A smoothed threshold is so steep that Newton's method takes many rounds a stage: the Rosenbrock method, which
    // takes one, costs a third at the same error (docs/chart.md).
    const FrictionParameters& law = model.scene().friction;
    const bool threshold = rates.stiff_friction && has_threshold(law.law) && law.regularised;
    SS_TRY(TSSetType(ts, wants_imex                        ? TSARKIMEX
                         : automatic == Implicit::none ? TSRK
                         : threshold                   ? TSROSW
                                                       : TSARKIMEX));
    if (automatic == Implicit::none && !wants_imex) SS_TRY(TSRKSetType(ts, TSRK5DP));
    char name[128];
    PetscBool set;
    SS_TRY(PetscOptionsGetString(nullptr, prefix.c_str(), "-ts_type", name, sizeof(name), &set));
    if (set) check_type_offered(name);
    if (set) SS_TRY(TSSetType(ts, name));
    TSType now;
    SS_TRY(TSGetType(ts, &now));
    type = now;

    // 4 is cheaper than 3, which PETSc would take; but a block that rate-and-state friction has brought to a creep of
    // 1e-15 keeps its velocity's digits from step to step with 3 alone (measured: 4 stands still there).
    const bool creeps = model.scene().friction.law == Law::rate_and_state;
    if (type == TSARKIMEX) SS_TRY(TSARKIMEXSetType(ts, creeps ? TSARKIMEX3 : TSARKIMEX4));
    const MethodKind kind = kind_of(type);
    if (kind == MethodKind::explicit_) {
      if (wants_imex)
        throw UsageError("imex_implicit " + wish + ": ts_type " + type +
                         " is explicit; use ts_type arkimex, or imex_implicit none");
      implicit = Implicit::none;
    } else if (kind == MethodKind::imex) {
      if (wish == "none") implicit = Implicit::none;
      else if (wants_imex)
        implicit = wish == "friction" ? Implicit::friction : wish == "wave" ? Implicit::wave : Implicit::both;
      else if (automatic != Implicit::none) implicit = automatic;
      else implicit = stick || rates.friction >= rates.wave ? Implicit::friction : Implicit::wave;
    } else {
      if (wish != "auto" && wish != "both")
        throw UsageError("imex_implicit " + wish + ": ts_type " + type +
                         " does not split; use ts_type arkimex, or imex_implicit both");
      implicit = Implicit::both;
    }
    if (stick && implicit == Implicit::wave)
      throw UsageError("imex_implicit wave: with friction_stick exact a node at rest is held by friction against eta, "
                       "which this split takes apart; use friction or both, or ts_type rk");
    split = split_of(implicit);
    set_functions();
    set_defaults();
    SS_TRY(TSSetFromOptions(ts));
    SS_TRY(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_MATCHSTEP));
    SS_TRY(TSSetPreStep(ts, PreStep));
    SS_TRY(TSSetPostStep(ts, PostStep));
    SS_TRY(TSSetSolution(ts, u));
    if (type == TSRK && options.boolean("rk_fused")) fuse();
    SS_TRY(TSSetUp(ts));
    read_subtype();
    method = &offered_method(type, subtype);
    read_adaptivity();
    if (adaptive) refuse_below_round_off(u);
    set_dense_output();
    if (stick && (type == TSBDF || type == TSALPHA))
      throw UsageError("ts_type " + type + ": it remembers earlier steps and would have to forget them wherever a node "
                       "starts or stops (friction_stick exact); use rk, arkimex or another one-step method");
    if (undo_exactly || fused || own_degree > 0 || stick) before = model.create_vector();
    report.method = method->name();
    report.implicit = implicit;
  }

  void set_functions() {
    if (split.has_explicit) SS_TRY(TSSetRHSFunction(ts, nullptr, RHSFunction, this));
    if (kind_of(type) == MethodKind::explicit_) return;
    SS_TRY(TSSetIFunction(ts, nullptr, IFunction, this));
    J = model.create_jacobian(split.has_implicit ? split.implicit_part : Part::pointwise);
    SS_TRY(TSSetIJacobian(ts, J, J, IJacobian, this));
    SNES snes;
    KSP ksp;
    PC pc;
    SS_TRY(TSGetSNES(ts, &snes));
    SS_TRY(SNESGetKSP(snes, &ksp));
    SS_TRY(KSPGetPC(ksp, &pc));
    SS_TRY(KSPSetType(ksp, KSPPREONLY));
    if (implicit == Implicit::wave || implicit == Implicit::none) {
      SS_TRY(SNESSetType(snes, SNESKSPONLY));
    } else {
      // Well below the error allowed a step, whose size the first residual has; Newton's last round squares it.
      double tolerance = default_tolerance;
      for (const char* option : {"-ts_rtol", "-ts_atol"}) {
        PetscReal value;
        PetscBool set;
        SS_TRY(PetscOptionsGetReal(nullptr, prefix.c_str(), option, &value, &set));
        if (set) tolerance = std::min(tolerance, double(value));
      }
      SS_TRY(SNESSetTolerances(snes, 1e-14, std::clamp(1e-3 * tolerance, 1e-13, 1e-9), 1e-13, 30, 10000));
      SNESLineSearch search;
      SS_TRY(SNESGetLineSearch(snes, &search));
      SS_TRY(SNESLineSearchSetPreCheck(search, TameStep, this));
      keeps_jacobian = type == TSARKIMEX && !user_set("snes_lag_jacobian");
      if (keeps_jacobian) {
        SS_TRY(SNESSetConvergenceTest(snes, ConvergedOrRefresh, this, nullptr));
        SS_TRY(TSSetPreStage(ts, PreStage));
      }
    }
    if (implicit == Implicit::friction || implicit == Implicit::none) {
      SS_TRY(PCSetType(pc, PCPBJACOBI));
      return;
    }
    int ranks;
    MPI_Comm_size(model.comm(), &ranks);
    // Banded: LU in natural order costs O(n); on several ranks each factors the whole, which is still the fastest.
    if (ranks == 1) {
      SS_TRY(PCSetType(pc, PCLU));
      SS_TRY(PCFactorSetMatOrderingType(pc, MATORDERINGNATURAL));
    } else {
      SS_TRY(PCSetType(pc, PCREDUNDANT));
      KSP inner;
      PC inner_pc;
      SS_TRY(PCRedundantGetKSP(pc, &inner));
      SS_TRY(KSPGetPC(inner, &inner_pc));
      SS_TRY(PCSetType(inner_pc, PCLU));
      SS_TRY(PCFactorSetMatOrderingType(inner_pc, MATORDERINGNATURAL));
    }
  }

  void set_defaults() {
    SS_TRY(TSSetTolerances(ts, default_tolerance, nullptr, default_tolerance, nullptr));
    // The start of an adaptive run, and the step of a fixed one: well inside the stability region.
    SS_TRY(TSSetTimeStep(ts, rates.first_step()));
  }

  static MethodKind kind_of(const std::string& type) {
    for (const Method& m : methods())
      if (type == m.type) return m.kind;
    return MethodKind::implicit;
  }

  void read_subtype() {
    const char* name = nullptr;
    if (type == TSRK) SS_TRY(TSRKGetType(ts, &name));
    if (type == TSARKIMEX) SS_TRY(TSARKIMEXGetType(ts, &name));
    if (type == TSROSW) SS_TRY(TSRosWGetType(ts, &name));
    if (type == TSSSP) SS_TRY(TSSSPGetType(ts, &name));
    subtype = name ? name : "";
    if (type == TSBDF) {
      PetscInt order;
      SS_TRY(TSBDFGetOrder(ts, &order));
      subtype = std::to_string(order);
    }
    if (type == TSRK) {
      const PetscReal *A, *b, *c, *embedded, *interpolating;
      PetscInt stages, p;
      PetscBool fsal;
      SS_TRY(TSRKGetTableau(ts, &stages, &A, &b, &c, &embedded, &p, &interpolating, &fsal));
      last_stage = stages - 1;
      first_same_as_last = fsal;
    }
  }

  bool user_set(const char* option) const {
    PetscBool set;
    SS_TRY(PetscOptionsHasName(nullptr, prefix.c_str(), (std::string("-") + option).c_str(), &set));
    return set;
  }

  // What the user may rely on and would not get.
  void read_adaptivity() {
    TSAdapt adapt;
    TSAdaptType kind;
    SS_TRY(TSGetAdapt(ts, &adapt));
    SS_TRY(TSAdaptGetType(adapt, &kind));
    const std::string chosen = kind ? kind : TSADAPTNONE;
    if (chosen != TSADAPTNONE && chosen != TSADAPTBASIC && chosen != TSADAPTDSP)
      throw UsageError("ts_adapt_type " + chosen + ": it needs what this program does not have; use basic, " +
                       "dsp or none");
    const std::string name = method->name();
    if (method->adaptivity == Adaptivity::never) {
      if (user_set("ts_adapt_type") && chosen != TSADAPTNONE)
        throw UsageError("ts_adapt_type " + chosen + ": " + name +
                         " has no error estimate; use none, or an adaptive method");
      SS_TRY(TSAdaptSetType(adapt, TSADAPTNONE));
    }
    adaptive = method->adaptivity != Adaptivity::never && chosen != TSADAPTNONE;
    if (adaptive) {
      SS_TRY(TSSetFunctionDomainError(ts, DomainError));
      SS_TRY(TSSetPostStage(ts, PostStage));
      undo_exactly = type == TSRK || type == TSARKIMEX;
      if (undo_exactly) SS_TRY(TSSetPreStage(ts, PreStage));
      // A failure of Newton's method rejects the step; a start 1e20 times too large is found out.
      if (!user_set("ts_max_snes_failures")) SS_TRY(TSSetMaxSNESFailures(ts, -1));
      if (!user_set("ts_max_reject")) SS_TRY(TSSetMaxStepRejections(ts, most_rejections));
      if (user_set("ts_adapt_always_accept"))
        warn("ts_adapt_always_accept: steps are taken whatever their error; ts_rtol and ts_atol do not hold");
    } else {
      double dt;
      SS_TRY(TSGetTimeStep(ts, &dt));
      const std::string how = method->adaptivity == Adaptivity::on_request
                                  ? " has a fixed step unless ts_adapt_type is basic"
                              : method->adaptivity == Adaptivity::never ? " has no error estimate and a fixed step"
                                                                        : " has a fixed step with ts_adapt_type none";
      for (const char* tolerance : {"ts_rtol", "ts_atol"})
        if (user_set(tolerance))
          warn(std::string(tolerance) + " has no effect: " + name + how + "; every step is " + number_text(dt));
      if (!user_set("ts_dt"))
        warn(name + how + ": every step is " + number_text(dt) +
             ", chosen for stability and not for accuracy; set ts_dt, or use an adaptive method such as " +
             (method->kind == MethodKind::explicit_ ? "rk:5dp" : method->kind == MethodKind::imex ? "arkimex:4"
                                                                                             : "rosw:ra34pw2"));
      if (type == TSBDF && subtype > "2")
        warn("ts_bdf_order " + subtype + ": with fixed steps the order is 2 (its first steps are); use " +
             "ts_adapt_type basic");
    }
    SS_TRY(TSSetErrorIfStepFails(ts, PETSC_FALSE));  // advance() says what failed
  }

  // Steps would shrink until time stands still.
  void refuse_below_round_off(Vec u) {
    constexpr double least = 1e-17;
    PetscReal atol, rtol, size;
    SS_TRY(TSGetTolerances(ts, &atol, nullptr, &rtol, nullptr));
    SS_TRY(VecNorm(u, NORM_INFINITY, &size));
    size = std::max(size, std::abs(model.scene().v));
    if (rtol < least && atol < least * size)
      throw UsageError("ts_rtol " + number_text(rtol) + " with ts_atol " + number_text(atol) +
                       ": below round-off, which is 1e-16 of values as large as " + number_text(size) +
                       "; a tolerance of 1e-14 is the least that makes sense");
  }

  void set_dense_output() {
    const bool by_ts = method->name() == "rk:5dp" || method->name() == "arkimex:4" || method->name() == "arkimex:5" ||
                       type == TSBDF;
    if (by_ts) return;
    own_degree = method->kind == MethodKind::explicit_ ? std::max(3, method->order - 1) : 3;
    work = model.create_vector();
  }

  // Tells before it happens that a fixed step will explode.
  void foresee(Vec u, double t) {
    if (adaptive) return;
    double dt;
    SS_TRY(TSGetTimeStep(ts, &dt));
    StepForecast forecast(model, u, implicit, ts);
    foresee_several_solutions(dt, t_end - t, forecast);
    foresee_order_reduction(dt, t_end - t, u);
    if (!forecast.explodes(dt, t_end - t)) return;
    warn("ts_dt " + number_text(dt) + " is beyond the stability limit of " + method->name() + ", which is about " +
         rounded(forecast.limit(dt, t_end - t)) + " here (the shortest wave turns at " +
         rounded(model.wave_frequency()) + " per unit time, friction acts at up to " +
         rounded(friction_rate_ahead(model, u)) + "): the solution will grow without bound");
  }

  // At shift r = 1/(a dt) the implicit equations of uniform motion have the determinant r^2 + C r + A K0,
  // C = A (B + F') + s delta. Where it is negative at the least slope F', it changes sign along psi, and the equations
  // have several solutions.
  void foresee_several_solutions(double dt, double duration, StepForecast& forecast) {
    if (dt >= duration || type == TSROSW || (implicit != Implicit::friction && implicit != Implicit::both)) return;
    const Scene& s = model.scene();
    const auto damping = [&](double slope) { return s.A() * (s.B() + slope) + s.s_delta(); };
    // the motion stays clear of weakening friction
    if (damping(forecast.least_slope()) >= 0 && !(forecast.sliding_growth(false) > 0)) return;
    const double C = damping(least_slope()), product = s.A() * s.K0();
    if (C >= 0 || C * C <= 4 * product) return;
    const double r = forecast.shift(dt), root = std::sqrt(C * C / 4 - product), high = -C / 2 + root;
    if (r <= 0 || r >= high || r <= -C / 2 - root) return;
    warn("ts_dt " + number_text(dt) + " is so long that the implicit equations of " + method->name() +
         " have several solutions (friction falls with velocity; one alone up to about " + rounded(dt * r / high) +
         "): Newton's method may find one that the motion does not lead to");
  }

  // Where a step is long against the time in which friction acts, the stages of Runge-Kutta and Rosenbrock methods err
  // by more than the step should (docs/limits.md has the orders measured); bdf and arkimex l2 keep theirs.
  void foresee_order_reduction(double dt, double duration, Vec u) const {
    const bool solves_friction = implicit == Implicit::friction || implicit == Implicit::both;
    if (dt >= duration || !solves_friction || method->order < 2 || type == TSBDF || subtype == "l2") return;
    const double rate = model.friction_rate(u);
    if (dt * rate > stiff)
      warn("friction acts at up to " + rounded(rate) + " per unit time, " + rounded(dt * rate) +
           " times in a ts_dt of " + number_text(dt) + ": in so stiff a scene the order of " + method->name() +
           " falls from " + std::to_string(method->order) + " to 2, 1 or less; use error control, bdf:2 or arkimex:l2");
  }
  static constexpr double stiff = 30;  // dt times the rate of friction, from where on orders fall

  // Least slope of friction over the velocities, at steady state.
  double least_slope() const {
    double least = 0;
    for (double psi = 1e-6; psi < 100; psi *= 1.2)
      for (const double sign : {-1., 1.}) {
        const double state = model.dof() == 3 ? model.steady_state(sign * psi) : 0;
        least = std::min(least, model.friction(0, sign * psi, state).F_psi / model.amplitude()[0]);
      }
    return least;
  }

  static std::string rounded(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    return text;
  }
};

Integrator::Integrator(const Model& model, const Options& options, Vec u, const std::string& prefix)
    : impl_(std::make_unique<Impl>(model, prefix)) {
  impl_->set_up(options, u);
}
Integrator::~Integrator() = default;

void Integrator::set_output_times(std::vector<double> times) {
  impl_->output_times = std::move(times);
  impl_->next_output = 0;
}

void Integrator::continue_from(PetscInt step, double dt) {
  impl_->continued = true;
  impl_->first_step = step;
  impl_->saved_dt = dt;
}

TimeReport Integrator::advance(Vec u, double t, double t_end, const Observer& observer, PetscInt max_steps) {
  Impl& m = *impl_;
  m.observer = &observer;
  m.t_end = t_end;
  m.t_before = t;
  m.stop_asked = false;
  m.max_steps = max_steps;
  m.evaluations_before = m.model.rhs_evaluations();
  SS_TRY(TSSetTime(m.ts, t));
  SS_TRY(TSSetMaxTime(m.ts, t_end));
  SS_TRY(TSSetMaxSteps(m.ts, max_steps));
  if (m.continued) {
    SS_TRY(TSSetStepNumber(m.ts, m.first_step));
    SS_TRY(TSSetTimeStep(m.ts, m.saved_dt));
  }
  SS_TRY(TSRestartStep(m.ts));
  SS_TRY(TSSetSolution(m.ts, u));
  m.report.t = t;
  m.update_report();
  if (!m.continued) m.tell(m.step_now());
  m.continued = false;
  m.started = false;
  m.foresee(u, t);
  if (m.stop_asked || t >= t_end) {
    m.report.reason = "end time";
    return m.report;
  }
  TSConvergedReason reason = TS_CONVERGED_ITERATING;
  if (m.stick) {
    if (!m.adaptive) SS_TRY(TSGetTimeStep(m.ts, &m.own_dt));
    SS_TRY(TSSetConvergedReason(m.ts, TS_CONVERGED_ITERATING));
    m.decide(u);
    m.pass_rest(u);
    SS_TRY(TSGetConvergedReason(m.ts, &reason));
  }
  if (reason == TS_CONVERGED_ITERATING) SS_TRY(TSSolve(m.ts, u));
  m.update_report();

  SS_TRY(TSGetConvergedReason(m.ts, &reason));
  if (reason < 0) {
    const std::string at = " at t = " + number_text(m.report.t) + " (step " + std::to_string(m.report.steps) + ")";
    if (reason == TS_DIVERGED_NONLINEAR_SOLVE)
      throw Failure("Newton's method failed in the implicit part" + at + "; reduce ts_dt");
    SNESConvergedReason newton = SNES_CONVERGED_ITERATING;
    if (m.split.has_implicit) {
      SNES snes;
      SS_TRY(TSGetSNES(m.ts, &snes));
      SS_TRY(SNESGetConvergedReason(snes, &newton));
    }
    PetscInt most = most_rejections;
    SS_TRY(PetscOptionsGetInt(nullptr, m.prefix.c_str(), "-ts_max_reject", &most, nullptr));
    throw Failure("the time step was rejected more than " + std::to_string(most) + " times (ts_max_reject)" + at +
                  (newton < 0 ? ": Newton's method fails in the implicit part" : "") +
                  "; reduce ts_dt or loosen ts_rtol and ts_atol");
  }
  m.report.reason = reason == TS_CONVERGED_ITS ? "ts_max_steps" : m.stop_asked ? "stopped" : "end time";
  return m.report;
}

const TimeReport& Integrator::report() const { return impl_->report; }
int Integrator::interpolation_order() const {
  if (impl_->own_degree > 0) return impl_->own_degree;
  return impl_->type == TSBDF ? impl_->method->order : 4;
}
std::string Integrator::interpolation_caveat() const {
  const int order = interpolation_order();
  if (impl_->method->order <= order + 1 && impl_->method->name() != "arkimex:5") return "";
  return impl_->method->name() + " has order " + std::to_string(impl_->method->order) +
         ", but values between its steps (frames, measurements) have order 4; steps and the end are not affected";
}
bool Integrator::adaptive() const { return impl_->adaptive; }
TS Integrator::ts() const { return impl_->ts; }

}  // namespace stickslip
