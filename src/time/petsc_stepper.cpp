#include "time/integrator_impl.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/implicit_kernel.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/time/time.hpp"
#include "time/methods.hpp"
#include "time/tiles.hpp"

namespace stickslip {

PetscErrorCode Equations::RHSFunction(TS, PetscReal t, Vec u, Vec f, void* context) {
  return guarded([&] {
    const auto& self = *static_cast<Equations*>(context);
    if (!self.parts_.of_explicit) {
      SS_TRY(VecZeroEntries(f));
      return;
    }
    self.model_.set_time(t);
    self.model_.rhs(*self.parts_.of_explicit, u, f);
  });
}

// udot - G(u)
PetscErrorCode Equations::IFunction(TS, PetscReal t, Vec u, Vec udot, Vec f, void* context) {
  return guarded([&] {
    const auto& self = *static_cast<Equations*>(context);
    self.model_.set_time(t);
    if (self.has_implicit()) {
      self.model_.rhs(*self.parts_.of_implicit, u, f);
      SS_TRY(VecAYPX(f, -1, udot));
    } else {
      SS_TRY(VecCopy(udot, f));
    }
  });
}

// shift I - dG/du
PetscErrorCode Equations::IJacobian(TS, PetscReal, Vec u, Vec, PetscReal shift, Mat, Mat P, void* context) {
  return guarded([&] {
    auto& self = *static_cast<Equations*>(context);
    // The wave part is linear: while the shift stands, so do the matrix and its factors.
    const bool constant = self.implicit_ == Implicit::wave || !self.has_implicit();
    if (constant && shift == self.last_shift_) return;
    self.model_.jacobian(self.jacobian_part(), u, shift, self.has_implicit() ? -1 : 0, P);
    self.last_shift_ = shift;
  });
}

// Newton's step, before a line search takes it.
PetscErrorCode Equations::TameStep(SNESLineSearch, Vec u, Vec minus_step, PetscBool* changed, void* context) {
  return guarded([&] {
    const auto& self = *static_cast<Equations*>(context);
    *changed = self.model_.safeguard_newton_step(u, self.last_shift_, minus_step) ? PETSC_TRUE : PETSC_FALSE;
  });
}

PetscErrorCode Equations::Search(SNESLineSearch search, void* context) {
  return guarded([&] { static_cast<Equations*>(context)->search(search); });
}

// Halves Newton's step until it makes the residual less, as PETSc's own search does, whose norm adds what has
// different units: either each row as it is, or as the change of its unknown that it stands for. Of the
// former a stiff psi that is in balance already is nearly all, of the latter one that friction no longer
// holds.
void Equations::search(SNESLineSearch search) const {
  constexpr int most_halvings = 40;
  SNES snes;
  Vec u, residual, minus_step, next, residual_there;
  SS_TRY(SNESLineSearchGetSNES(search, &snes));
  SS_TRY(SNESLineSearchGetVecs(search, &u, &residual, &minus_step, &next, &residual_there));
  PetscBool changed;
  SS_TRY(SNESLineSearchPreCheck(search, u, minus_step, &changed));
  const Sizes before = sizes_of(u, residual);
  SNESLineSearchReason reason = SNES_LINESEARCH_FAILED_REDUCT;
  for (int k = 0; k <= most_halvings && reason != SNES_LINESEARCH_SUCCEEDED; ++k) {
    SS_TRY(VecWAXPY(next, -std::ldexp(1., -k), minus_step, u));
    SS_TRY(SNESComputeFunction(snes, next, residual_there));
    const Sizes there = sizes_of(u, residual_there);
    if (there.rows < before.rows || there.changes < before.changes) reason = SNES_LINESEARCH_SUCCEEDED;
  }
  SS_TRY(VecCopy(next, u));
  SS_TRY(VecCopy(residual_there, residual));
  SS_TRY(SNESLineSearchComputeNorms(search));
  SS_TRY(SNESLineSearchSetReason(search, reason));
}

// Sums of squares, each row in parts of the scale of its unknown: as it is, and over its slope at u.
// Collective.
Equations::Sizes Equations::sizes_of(Vec u, Vec residual) const {
  const int dof = model_.dof();
  const double shift = std::abs(last_shift_);
  Sizes sums;
  {
    const Reading values(u), rows(residual);
    for (PetscInt i = 0; i < model_.local() * dof; ++i) {
      const double stiffer = i % dof == 0 ? 1 + slope_of_friction(i / dof, values + i) / shift : 1;
      const double off = rows[i] / tolerances_.scales.of(int(i % dof));
      sums.rows += off * off;
      sums.changes += off * off / (stiffer * stiffer);
    }
  }
  return {sum_over(model_.comm(), sums.rows), sum_over(model_.comm(), sums.changes)};
}

// A F_psi where friction goes by ln psi, 0 elsewhere and where no friction acts on psi_t.
double Equations::slope_of_friction(PetscInt i, const double* at) const {
  if (!model_.friction_law(i).steep || model_.scene().massless() || model_.held(model_.first() + i)) return 0;
  const double state = model_.dof() == 3 ? at[2] : 0;
  return model_.coefficients(i).A * std::max(model_.friction(i, at[0], state).F_psi, 0.);
}

// What an equation is off by, over what it may be off by: the largest of all nodes. A residual, in psi's row
// shift psi - A (eta - B psi - F) and more, is counted by the change of its unknown that it stands for,
// against scale and size of that; where friction goes by ln psi also by what this change makes of F, since
// there a psi far below its scale is as much as any. What a residual is rounded by is no error. Collective.
double Equations::largest_miss(Vec u, Vec residual) const {
  const Scales& scales = tolerances_.scales;
  const double target = target_, shift = std::abs(last_shift_);
  const int dof = model_.dof();
  const bool massless = model_.scene().massless();
  double largest = 0;
  {
    const Reading values(u), rows(residual);
    for (PetscInt i = 0; i < model_.local(); ++i) {
      const double *const at = values + i * dof, *const r = rows + i * dof;
      const double psi = std::abs(at[0]), off = std::abs(r[0]);
      const double A = massless ? 0 : model_.coefficients(i).A;
      double slope = shift, of_force = 0, size = shift * psi + A * std::abs(at[1]);
      if (model_.friction_law(i).steep && !massless && !model_.held(model_.first() + i)) {
        const Partials p = model_.friction(i, at[0], dof == 3 ? at[2] : 0);
        slope += A * std::max(p.F_psi, 0.);
        size += A * std::abs(p.F);
        of_force = off * std::abs(p.F_psi) /
                   (slope * target * (scales.eta + std::abs(p.F)) + 1e-15 * size * std::abs(p.F_psi));
      }
      const double of_psi = off / (slope * target * (scales.psi + psi) + 1e-15 * size);
      const double of_eta = std::abs(r[1]) / (shift * target * (scales.eta + std::abs(at[1])));
      const double of_state =
          dof < 3 ? 0 : std::abs(r[2]) / (shift * kernel::allowed_of_state(target, scales, at[2]));
      for (const double miss : {of_psi, of_force, of_eta, of_state})
        if (!(miss <= largest)) largest = miss;  // NaN stays
      if (std::isnan(largest)) break;
    }
  }
  return largest_over(model_.comm(), std::isnan(largest) ? HUGE_VAL : largest);
}

// The stages of a diagonally implicit step share one Jacobian, that of its first round of Newton's method: a
// round with an old one costs a tenth of a round with a new one. It is made anew where the residual falls so
// slowly that this pays.
PetscErrorCode Equations::Converged(SNES snes, PetscInt round, PetscReal x, PetscReal step,
                                    PetscReal residual, SNESConvergedReason* reason, void* context) {
  return guarded([&] {
    auto& self = *static_cast<Equations*>(context);
    double miss;
    if (self.as_user_has_it_) {
      PetscReal target;
      SS_TRY(SNESConvergedDefault(snes, round, x, step, residual, reason, nullptr));
      SS_TRY(SNESGetTolerances(snes, &target, nullptr, nullptr, nullptr, nullptr));
      miss = residual / target;
      if (*reason || round == 0) return;
    } else {
      *reason = std::isfinite(residual) ? SNES_CONVERGED_ITERATING : SNES_DIVERGED_FUNCTION_DOMAIN;
      if (*reason || round == 0) return;  // the shift comes with the Jacobian
      Vec u, f;
      SS_TRY(SNESGetSolution(snes, &u));
      SS_TRY(SNESGetFunction(snes, &f, nullptr, nullptr));
      miss = self.largest_miss(u, f);
      if (miss <= 1) *reason = SNES_CONVERGED_FNORM_ABS;
    }
    const double before = std::exchange(self.last_miss_, miss);
    if (*reason || round == 1 || !self.shares_jacobian_) return;
    // with an old one that cost what a new one does
    const double rounds = self.implicit_ == Implicit::both ? 8 : 4;
    if (!(miss * std::pow(miss / before, rounds) < 1)) SS_TRY(SNESSetLagJacobian(snes, -2));
  });
}

void Equations::begin_step(TS ts) {
  if (!shares_jacobian_) return;
  SNES snes;
  SS_TRY(TSGetSNES(ts, &snes));
  SS_TRY(SNESSetLagJacobian(snes, -2));  // at the next round of Newton's method, which keeps it from then on
}

void Equations::attach(TS ts, const Capabilities& can, const std::string& prefix) {
  // PETSc from 3.20 on takes an IMEX method without explicit part for one of equations with algebraic ones,
  // and solves at each restart for a slope, with this SNES, its step and its Jacobian: so there is one, of
  // zeros.
  if (implicit_ != Implicit::both || can.splits)
    SS_TRY(TSSetRHSFunction(ts, nullptr, RHSFunction, this));
  if (can.is_explicit) return;
  SS_TRY(TSSetIFunction(ts, nullptr, IFunction, this));
  J_ = model_.create_jacobian(jacobian_part());
  SS_TRY(TSSetIJacobian(ts, J_, J_, IJacobian, this));
  SNES snes;
  KSP ksp;
  SS_TRY(TSGetSNES(ts, &snes));
  if (implicit_ == Implicit::wave || implicit_ == Implicit::none) {
    SS_TRY(SNESSetType(snes, SNESKSPONLY));
  } else {
    shares_jacobian_ = shares_jacobian(can, prefix);
    set_newton(snes, prefix);
  }
  SS_TRY(SNESGetKSP(snes, &ksp));
  set_linear_solver(ksp);
}

// Of a Rosenbrock method too, which has PETSc hold on to it over a step that is tried again, with the shift
// of the length that failed.
bool Equations::shares_jacobian(const Capabilities& can, const std::string& prefix) {
  if (can.linearises) return !user_set(prefix, "ts_rosw_recompute_jacobian");
  return can.splits && !user_set(prefix, "snes_lag_jacobian");
}

void Equations::set_newton(SNES snes, const std::string& prefix) {
  const PetscInt most_rounds = model_.friction_law(0).steep ? 100 : 30;  // over hundreds of decades of psi
  SS_TRY(SNESSetTolerances(snes, 1e-14, 1e-13, 1e-13, most_rounds, 10000));
  SNESLineSearch search;
  SS_TRY(SNESGetLineSearch(snes, &search));
  SS_TRY(SNESLineSearchSetPreCheck(search, TameStep, this));
  SS_TRY(SNESLineSearchSetType(search, SNESLINESEARCHSHELL));
#if PETSC_VERSION_LT(3, 21, 0)
  SS_TRY(SNESLineSearchShellSetUserFunc(search, Search, this));
#else
  SS_TRY(SNESLineSearchShellSetApply(search, Search, this));
#endif
  for (const char* own : {"snes_rtol", "snes_atol", "snes_stol"})
    as_user_has_it_ = as_user_has_it_ || user_set(prefix, own);
  SS_TRY(SNESSetConvergenceTest(snes, Converged, this, nullptr));
}

void Equations::set_linear_solver(KSP ksp) const {
  if (implicit_ == Implicit::wave || implicit_ == Implicit::both) return solve_by_banded_lu(ksp);
  solve_by_blocks(ksp);
}

// psi and eta beyond 1e20 and a state beyond 1e42 of what slips are measured by count as not finite: a step
// from there has lost the motion, and the cube in the friction and the square of that in PETSc's estimate of
// the error are still finite. A cube overflows at 1e102.
FiniteTest::FiniteTest(const Model& model) : model_(model) {
  const Scales slip = scales_of(model.scene()).slip;
  for (int d = 0; d < 3; ++d) overflows_[d] = (d < 2 ? 1e82 : 1e60) / slip.of(d);
}

// x - x is 0 for finite x and NaN otherwise, and NaN stays.
bool FiniteTest::operator()(Vec u) const {
  PetscInt count;
  SS_TRY(VecGetLocalSize(u, &count));
  const Reading a(u);
  const PetscInt dof = model_.dof();
  double sum = 0;
  for (PetscInt i = 0; i < count; i += dof)
    for (PetscInt d = 0; d < dof; ++d) {
      const double x = overflows_[d] * a[i + d], cube = x * x * x;
      sum += cube - cube;
    }
  int all = sum == 0 ? 1 : 0;
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT, MPI_MIN, model_.comm()));
  return all != 0;
}

// ---- set-up

PetscStepper::PetscStepper(const Model& model, TS ts, Implicit implicit, const Capabilities& can,
                           const std::string& prefix, Loop loop)
    : model_(model), ts_(ts), prefix_(prefix), loop_(std::move(loop)), equations_(model, implicit),
      all_finite_(model) {
  SS_TRY(TSSetApplicationContext(ts, this));
  equations_.attach(ts, can, prefix);
}

// A library's type weighs by vectors what differs from unknown to unknown.
void PetscStepper::set_tolerances(const Tolerances& given) {
  tolerances_ = given;
  equations_.solve_to(given, given.solver_target());
  const bool alike = given.absolute[1] == given.absolute[0] && given.relative[2] == given.relative[0] &&
                     given.absolute[2] == given.absolute[0];
  if (alike) return;
  const VecHandle absolute = model_.create_vector(), relative = model_.create_vector();
  {
    const Writing a(absolute), r(relative);
    for (PetscInt i = 0; i < model_.local() * model_.dof(); ++i) {
      a[i] = given.absolute[i % model_.dof()];
      r[i] = given.relative[i % model_.dof()];
    }
  }
  SS_TRY(TSSetTolerances(ts_, PETSC_DECIDE, absolute, PETSC_DECIDE, relative));
}

void PetscStepper::set_up(const Method& method, bool adaptive, PetscInt most_rejections) {
  const std::string type = method.type;
  adaptive_ = adaptive;
  undoes_ = adaptive && (type == TSRK || type == TSARKIMEX);
  narrows_ = adaptive && model_.friction_law(0).steep &&
             (model_.scene().massless() || capabilities(method).linearises);
  if (type == TSRK) {
    const PetscReal *A, *b, *c, *embedded, *interpolating;
    PetscInt stages, degree;
    PetscBool fsal;
    SS_TRY(TSRKGetTableau(ts_, &stages, &A, &b, &c, &embedded, &degree, &interpolating, &fsal));
    last_stage_ = stages - 1;
    first_same_as_last_ = fsal;
  }
  if (!adaptive) return equations_.solve_to(tolerances_, 1e-11);  // what the steps err by is all theirs
  SS_TRY(TSSetFunctionDomainError(ts_, DomainError));
  SS_TRY(TSSetPostStage(ts_, PostStage));
  SS_TRY(TSSetPreStage(ts_, PreStage));
  // A failure of Newton's method rejects the step; a start 1e20 times too large is found out.
  if (!user_set(prefix_, "ts_max_snes_failures")) SS_TRY(TSSetMaxSNESFailures(ts_, -1));
  SS_TRY(TSSetMaxStepRejections(ts_, most_rejections));
}

// ---- a step

namespace {

constexpr int most_shortened = 20;  // times that a step is made a quarter as long: 1e12

PetscStepper& stepper_of(TS ts) {
  void* context;
  SS_TRY(TSGetApplicationContext(ts, &context));
  return *static_cast<PetscStepper*>(context);
}
}  // namespace

PetscErrorCode PetscStepper::PreStage(TS ts, PetscReal) {
  return guarded([&] { stepper_of(ts).repeat(); });
}
PetscErrorCode PetscStepper::PostStage(TS ts, PetscReal, PetscInt index, Vec*) {
  return guarded([&] { stepper_of(ts).stage_ = index; });
}
PetscErrorCode PetscStepper::DomainError(TS ts, PetscReal, Vec u, PetscBool* accept) {
  return guarded([&] { *accept = stepper_of(ts).accepts(u) ? PETSC_TRUE : PETSC_FALSE; });
}

int PetscStepper::new_rejections() {
  PetscInt rejections;
  SS_TRY(TSGetStepRejections(ts_, &rejections));
  return int(rejections - std::exchange(rejections_, rejections));
}

// Where friction is steep it goes by ln psi, and psi far below its scale may be off by decades. What errors
// may be is said anew for each step there:
// - Without mass psi follows from eta and the state, d ln psi = (d eta - F_s ds)/(psi (B + F_psi)): errors of
//   both are judged by what they make of ln psi, of which each may be rtol. psi F_psi of a logarithm is the
//   same at every psi; where it bends at rest, below the plate's velocity, that is what is taken.
// - A Rosenbrock method solves linear equations alone, and psi that rises by e-folds within a step falls
//   behind its force, which nothing shows but what its error makes of the force.
void PetscStepper::narrow_errors(Vec u) {
  const Scene& s = model_.scene();
  if (!allowed_) {
    allowed_ = model_.create_vector();
    no_part_ = model_.create_vector();
  }
  const double usual = scales_of(s).velocity;
  const int dof = model_.dof();
  {
    const Reading a(u);
    const Writing into(allowed_);
    for (PetscInt i = 0; i < model_.local(); ++i) {
      const double *const at = a + i * dof, state = dof == 3 ? at[2] : 0;
      double* const of = into + i * dof;
      for (int d = 0; d < dof; ++d) of[d] = allowed_error(tolerances_, d, at[d]);
      if (s.massless()) of[0] = 0;  // psi is no unknown
      if (s.held(model_.first() + i)) continue;
      if (!s.massless()) {
        of[0] = std::min(of[0], of[1] / model_.friction(i, at[0], state).F_psi);
        continue;
      }
      const double size = std::abs(at[0]), from = std::max(size, usual);
      const Partials p = model_.friction(i, from, state);
      const double eta = tolerances_.relative[0] * (s.B() * size + from * p.F_psi);
      of[1] = std::min(of[1], eta);
      if (dof == 3) of[2] = std::min(of[2], eta / std::abs(p.F_state));
    }
  }
  SS_TRY(TSSetTolerances(ts_, PETSC_DECIDE, allowed_, PETSC_DECIDE, no_part_));
}

void PetscStepper::begin(Vec u, const Asked& asked) {
  (void)new_rejections();
  if (asked.first) started_ = false;
  equations_.begin_step(ts_);
  if (narrows_) narrow_errors(u);
  // A rejected step is only ever repeated with a smaller dt, so that this tells whether a value may be asked
  // for.
  // Exponentials lead beyond all numbers within one step that is too long.
  const bool may_overflow = adaptive_ && model_.friction_law(0).steep;
  has_kept_ = undoes_ || may_overflow || loop_.keeps(asked.t + asked.h * (1 + 1e-12));
  if (!has_kept_) return;
  if (!kept_) kept_ = model_.create_vector();
  SS_TRY(VecCopy(u, kept_));
}

// False where the end of the step is not finite: PETSc refuses norms of that, on every rank alike.
bool PetscStepper::attempt() {
  try {
    SS_TRY(TSStep(ts_));
    return true;
  } catch (const RankFailure& e) {
    if (std::string(e.what()).find("not-a-number") == std::string::npos) throw;
    return false;
  }
}

Stepper::Outcome PetscStepper::step(Vec u, const Asked& asked) {
  begin(u, asked);
  if (asked.restarts) SS_TRY(TSRestartStep(ts_));
  SS_TRY(TSSetMaxTime(ts_, asked.t_end));
  PetscInt before, after;
  Outcome outcome{Outcome::taken, asked.t, asked.h, 0, false};
  SS_TRY(TSGetStepRejections(ts_, &before));
  int shortened = 0;
  while (!attempt()) {  // the step's end is not finite: a shorter one, as for any other that is rejected
    if (!adaptive_ || !has_kept_ || shortened == most_shortened) {
      outcome.kind = Outcome::not_finite;
      break;
    }
    PetscReal h;
    SS_TRY(TSGetTimeStep(ts_, &h));
    SS_TRY(VecCopy(kept_, u));
    SS_TRY(TSSetTimeStep(ts_, h / 4));
    SS_TRY(TSRestartStep(ts_));
    ++shortened;
  }
  TSConvergedReason reason;
  SS_TRY(TSGetConvergedReason(ts_, &reason));
  SS_TRY(TSGetStepRejections(ts_, &after));
  SS_TRY(TSGetTime(ts_, &outcome.t));
  SS_TRY(TSGetTimeStep(ts_, &outcome.next_h));
  outcome.rejections = int(after - before) + shortened;
  if (outcome.kind == Outcome::not_finite) return outcome;
  if (reason < 0)
    outcome.kind = reason == TS_DIVERGED_NONLINEAR_SOLVE ? Outcome::not_solved : Outcome::rejected;
  else
    started_ = true;
  // psi of a massless node is put in only now
  outcome.finite = std::exchange(checked_last_, false) && adaptive_ && first_same_as_last_ &&
                   !model_.scene().massless();
  return outcome;
}

// PETSc undoes a rejected step of rk and arkimex by subtracting what it added, which after a step far too
// large leaves nothing of u but round-off. So u is put back from a copy before the step is tried again.
void PetscStepper::repeat() {
  if (new_rejections() == 0) return;
  Vec u;
  SS_TRY(TSGetSolution(ts_, &u));
  if (undoes_) SS_TRY(VecCopy(kept_, u));
  loop_.repeats();
  equations_.begin_step(ts_);
}

// Adaptive methods only: a stage that is not finite, or without mass one that says no psi, rejects the step,
// which PETSc would accept, since no comparison with NaN is true. What goes wrong in an early stage of rk
// reaches the last one, so that later steps look at that alone.
bool PetscStepper::accepts(Vec u) {
  const bool last = stage_ == last_stage_;
  if (last_stage_ >= 0 && started_ && !last) return true;
  bool accept = all_finite_(u);
  if (accept && model_.scene().massless()) {
    if (!work_) work_ = model_.create_vector();
    SS_TRY(VecCopy(u, work_));
    model_.solve_velocities(work_);
    accept = all_finite_(work_);
  }
  checked_last_ = last;
  return accept;
}

bool PetscStepper::solved() const {
  if (!equations_.has_implicit()) return true;
  SNES snes;
  SNESConvergedReason newton;
  SS_TRY(TSGetSNES(ts_, &snes));
  SS_TRY(SNESGetConvergedReason(snes, &newton));
  return newton >= 0;
}

void PetscStepper::interpolate(double at, double, Vec into) { SS_TRY(TSInterpolate(ts_, at, into)); }

void PetscStepper::view(PetscViewer viewer, std::int64_t) const { SS_TRY(TSView(ts_, viewer)); }

}  // namespace stickslip
