#include "stickslip/time.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/error.hpp"

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

bool one_of(const std::string& text, std::initializer_list<const char*> list) {
  return std::any_of(list.begin(), list.end(), [&](const char* item) { return text == item; });
}

bool is_explicit(const std::string& type) { return one_of(type, {TSRK, TSSSP, TSEULER}); }
bool is_imex(const std::string& type) { return one_of(type, {TSARKIMEX}); }

// Local part of "is every entry finite": x - x is 0 for finite x and NaN otherwise, and NaN stays.
bool locally_finite(Vec u) {
  const double* a;
  PetscInt count;
  SS_TRY(VecGetLocalSize(u, &count));
  SS_TRY(VecGetArrayRead(u, &a));
  double sum = 0;
  for (PetscInt i = 0; i < count; ++i) sum += a[i] - a[i];
  SS_TRY(VecRestoreArrayRead(u, &a));
  return sum == 0;
}

}  // namespace

struct Integrator::Impl {
  const Model& model;
  std::string prefix;
  TsHandle ts;
  MatHandle J;
  std::string type, subtype;
  Implicit implicit = Implicit::none;
  Split split{};
  double last_shift = std::numeric_limits<double>::quiet_NaN();
  TimeReport report;
  long evaluations_before = 0;

  // dense output
  std::vector<double> output_times;
  std::size_t next_output = 0;
  bool own_interpolation = false;  // cubic Hermite, where TS interpolates at order 2 only
  VecHandle before, slope_before, slope_after;
  bool kept_before = false, kept_after = false;
  double t_before = 0;
  const Observer* observer = nullptr;
  double t_end = 0;
  bool stop_asked = false;
  bool continued = false;
  PetscInt first_step = 0;
  double saved_dt = 0;

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

  static PetscErrorCode PreStep(TS ts) {
    return guarded([&] {
      void* context;
      SS_TRY(TSGetApplicationContext(ts, &context));
      auto& self = *static_cast<Impl*>(context);
      double dt;
      SS_TRY(TSGetTime(ts, &self.t_before));
      SS_TRY(TSGetTimeStep(ts, &dt));
      self.kept_before = self.kept_after = false;
      // A rejected step is only ever repeated with a smaller dt, so that this tells whether an output may fall in.
      if (self.own_interpolation && self.output_due(self.t_before + dt * (1 + 1e-12))) {
        Vec u;
        SS_TRY(TSGetSolution(ts, &u));
        SS_TRY(VecCopy(u, self.before));
        self.kept_before = true;
      }
    });
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
    } else if (!own_interpolation) {
      SS_TRY(TSInterpolate(ts, at, into));
    } else {
      if (!kept_before) throw std::logic_error("interpolation at a time that was not announced");
      const double h = t - t_before, s = (at - t_before) / h;
      if (!kept_after) {
        model.rhs(Part::full, before, slope_before);
        model.rhs(Part::full, u, slope_after);
        kept_after = true;
        // A run that is about to explode: psi is finite still, its cube is not.
        int finite = locally_finite(slope_after) ? 1 : 0;
        SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &finite, 1, MPI_INT, MPI_MIN, model.comm()));
        if (!finite) throw Failure("the right-hand side is not finite at t = " + std::to_string(t) + ": " + advice(h));
      }
      const double weights[] = {(1 + 2 * s) * (1 - s) * (1 - s), s * s * (3 - 2 * s), h * s * (1 - s) * (1 - s),
                                h * s * s * (s - 1)};
      Vec terms[] = {before, u, slope_before, slope_after};
      SS_TRY(VecZeroEntries(into));
      SS_TRY(VecMAXPY(into, 4, weights, terms));
    }
  }

  void update_report() {
    double t;
    SS_TRY(TSGetTime(ts, &t));
    report.t = t;
    SS_TRY(TSGetStepNumber(ts, &report.steps));
    SS_TRY(TSGetStepRejections(ts, &report.rejections));
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
    const Step step = step_now();
    int finite = locally_finite(step.u) ? 1 : 0;
    SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &finite, 1, MPI_INT, MPI_MIN, model.comm()));
    const double reached = report.t;
    update_report();
    if (!finite) {
      report.t = reached;
      double tried;
      SS_TRY(TSGetPrevTime(ts, &tried));
      throw Failure("the solution is not finite after step " + std::to_string(step.index) + " (t = " +
                    std::to_string(step.t) + "): " + advice(step.t - tried));
    }
    tell(step);
  }

  void tell(const Step& step) {
    if (!*observer) return;
    const Verdict verdict = (*observer)(step);
    if (verdict == Verdict::restart) SS_TRY(TSRestartStep(ts));
    if (verdict == Verdict::stop && step.t < t_end) {
      stop_asked = true;
      SS_TRY(TSSetConvergedReason(ts, TS_CONVERGED_USER));
    }
  }

  std::string advice(double dt) const {
    if (implicit == Implicit::both) return "reduce ts_dt or the tolerances";
    std::string text = "an explicit step of " + std::to_string(dt) + " is too large";
    const double frequency = model.wave_frequency();
    if (implicit != Implicit::wave && dt * frequency > 1)
      text += "; the shortest wave turns at " + std::to_string(frequency) + " per unit time";
    return text + "; reduce ts_dt, or choose an implicit method (ts_type arkimex)";
  }

  // ---- set-up ----
  void choose_default(Vec u) {
    const double wave = model.wave_frequency();
    const double friction = friction_rate_ahead(u);
    // An accurate step of the explicit pair resolves times of order 0.1 in the scene's own unit of time,
    // 1/sqrt(A K0), the period of a free block; it is stable up to about 3 over the fastest frequency.
    const double own = std::sqrt(model.scene().A() * model.scene().K0());
    const double accurate = 40 * (own > 0 ? own : 1);
    stiff_friction = friction > 3 * std::max(wave, accurate);
    // Rate-and-state friction creeps at velocities over many decades, down to where its rate A a/psi has no bound.
    if (model.scene().friction.law == Law::rate_and_state) stiff_friction = true;
    stiff_wave = wave > 10 * std::max(friction, accurate);
    fastest = std::max(wave, friction);
  }
  bool stiff_friction = false, stiff_wave = false;
  double fastest = 1;

  // The rate of friction over the velocities that a run will meet, not at the start alone: at least up to the
  // velocity at which the cubic's limit cycle turns, 2.
  double friction_rate_ahead(Vec u) const {
    double rate = model.friction_rate(u);
    const Scene& s = model.scene();
    if (s.friction.law == Law::cubic) rate = std::max(rate, s.A() * std::abs(s.B() + 3));
    if (model.dof() == 3 && s.v != 0) rate = std::max(rate, -model.state_rate(s.v, model.steady_state(s.v)).g_state);
    if (s.friction.regularised) rate = std::max(rate, s.A() * (s.B() + 1 / s.friction.eps));
    return rate;
  }

  void set_up(const Options& options, Vec u) {
    SS_TRY(TSCreate(model.comm(), ts.out()));
    SS_TRY(TSSetOptionsPrefix(ts, prefix.c_str()));
    SS_TRY(TSSetDM(ts, model.dm()));
    SS_TRY(TSSetApplicationContext(ts, this));
    SS_TRY(TSSetProblemType(ts, TS_NONLINEAR));
    choose_default(u);

    const std::string wish = options.text("imex_implicit");
    Implicit automatic = Implicit::none;
    if (stiff_friction) automatic = stiff_wave ? Implicit::both : Implicit::friction;
    else if (stiff_wave) automatic = Implicit::wave;
    const bool wants_imex = wish != "auto" && wish != "none";

    // The type decides what is implicit, so it is read before the functions are set.
    SS_TRY(TSSetType(ts, automatic != Implicit::none || wants_imex ? TSARKIMEX : TSRK));
    if (automatic == Implicit::none && !wants_imex) SS_TRY(TSRKSetType(ts, TSRK5DP));
    char name[128];
    PetscBool set;
    SS_TRY(PetscOptionsGetString(nullptr, prefix.c_str(), "-ts_type", name, sizeof(name), &set));
    if (set) SS_TRY(TSSetType(ts, name));
    TSType now;
    SS_TRY(TSGetType(ts, &now));
    type = now;

    if (is_explicit(type)) {
      if (wants_imex)
        throw UsageError("imex_implicit " + wish + ": ts_type " + type +
                         " is explicit; use ts_type arkimex, or imex_implicit none");
      implicit = Implicit::none;
    } else if (is_imex(type)) {
      if (wish == "none") implicit = Implicit::none;
      else if (wants_imex)
        implicit = wish == "friction" ? Implicit::friction : wish == "wave" ? Implicit::wave : Implicit::both;
      else if (automatic != Implicit::none) implicit = automatic;
      else implicit = friction_rate_ahead(u) >= model.wave_frequency() ? Implicit::friction : Implicit::wave;
    } else {
      if (wish != "auto" && wish != "both")
        throw UsageError("imex_implicit " + wish + ": ts_type " + type +
                         " does not split; use ts_type arkimex, or imex_implicit both");
      implicit = Implicit::both;
    }
    split = split_of(implicit);
    set_functions();
    set_defaults();
    SS_TRY(TSSetFromOptions(ts));
    SS_TRY(TSSetExactFinalTime(ts, TS_EXACTFINALTIME_MATCHSTEP));
    SS_TRY(TSSetPreStep(ts, PreStep));
    SS_TRY(TSSetPostStep(ts, PostStep));
    SS_TRY(TSSetSolution(ts, u));
    SS_TRY(TSSetUp(ts));
    read_subtype();
    own_interpolation = !((type == TSRK && subtype == TSRK5DP) || type == TSARKIMEX || type == TSBDF);
    if (own_interpolation) {
      before = model.create_vector();
      slope_before = model.create_vector();
      slope_after = model.create_vector();
    }
    report.method = subtype.empty() ? type : type + ":" + subtype;
    report.implicit = implicit;
  }

  void set_functions() {
    if (split.has_explicit) SS_TRY(TSSetRHSFunction(ts, nullptr, RHSFunction, this));
    if (is_explicit(type)) return;
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
      // A step's own error is far above these; the stages' Newton starts from a good guess.
      SS_TRY(SNESSetTolerances(snes, 1e-14, 1e-9, 1e-12, 30, 10000));
      SNESLineSearch search;
      SS_TRY(SNESGetLineSearch(snes, &search));
      SS_TRY(SNESLineSearchSetPreCheck(search, TameStep, this));
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
    SS_TRY(TSSetTolerances(ts, 1e-6, nullptr, 1e-6, nullptr));
    // The start of an adaptive run, and the step of a fixed one: well inside the stability region.
    SS_TRY(TSSetTimeStep(ts, 0.5 / std::max(fastest, 1e-3)));
    SS_TRY(TSSetMaxSNESFailures(ts, -1));
  }

  void read_subtype() {
    const char* name = nullptr;
    if (type == TSRK) SS_TRY(TSRKGetType(ts, &name));
    if (type == TSARKIMEX) SS_TRY(TSARKIMEXGetType(ts, &name));
    if (type == TSROSW) SS_TRY(TSRosWGetType(ts, &name));
    if (type == TSSSP) SS_TRY(TSSSPGetType(ts, &name));
    subtype = name ? name : "";
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
  if (m.stop_asked || t >= t_end) {
    m.report.reason = "end time";
    return m.report;
  }
  SS_TRY(TSSolve(m.ts, u));
  m.update_report();

  TSConvergedReason reason;
  SS_TRY(TSGetConvergedReason(m.ts, &reason));
  if (reason < 0) {
    double dt;
    SS_TRY(TSGetTimeStep(m.ts, &dt));
    const std::string at = " at t = " + std::to_string(m.report.t) + " (step " + std::to_string(m.report.steps) + ")";
    if (reason == TS_DIVERGED_NONLINEAR_SOLVE)
      throw Failure("Newton's method failed in the implicit part" + at + "; reduce ts_dt");
    throw Failure("the time step was rejected too often" + at + "; reduce ts_dt or loosen ts_rtol and ts_atol");
  }
  m.report.reason = reason == TS_CONVERGED_ITS ? "ts_max_steps" : m.stop_asked ? "stopped" : "end time";
  return m.report;
}

const TimeReport& Integrator::report() const { return impl_->report; }
int Integrator::interpolation_order() const {
  if (impl_->type == TSRK && impl_->subtype == TSRK5DP) return 5;
  if (impl_->type == TSARKIMEX) return impl_->subtype == TSARKIMEX3 ? 3 : 4;
  return 3;
}
TS Integrator::ts() const { return impl_->ts; }

}  // namespace stickslip
