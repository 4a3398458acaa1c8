#include <algorithm>
#include <cmath>
#include <utility>

#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "time/allowed_error.hpp"
#include "time/choice.hpp"
#include "time/stepper.hpp"

namespace stickslip {

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
// ----------------------------------------------------------------------------------------------------

PetscStepper::PetscStepper(const Model& model, TS ts, Implicit implicit, MethodKind kind,
                           const std::string& prefix, Loop loop)
    : model_(model), ts_(ts), prefix_(prefix), loop_(std::move(loop)), equations_(model, implicit),
      all_finite_(model) {
  SS_TRY(TSSetApplicationContext(ts, this));
  equations_.attach(ts, kind, prefix);
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
  narrows_ = adaptive && model_.friction_law(0).steep && (model_.scene().massless() || type == TSROSW);
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
// -----------------------------------------------------------------------------------------------------

namespace {
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
  has_kept_ = undoes_ || loop_.keeps(asked.t + asked.h * (1 + 1e-12));
  if (!has_kept_) return;
  if (!kept_) kept_ = model_.create_vector();
  SS_TRY(VecCopy(u, kept_));
}

Stepper::Outcome PetscStepper::step(Vec u, const Asked& asked) {
  begin(u, asked);
  if (asked.restarts) SS_TRY(TSRestartStep(ts_));
  SS_TRY(TSSetMaxTime(ts_, asked.t_end));
  PetscInt before, after;
  Outcome outcome{Outcome::taken, asked.t, asked.h, 0, false};
  SS_TRY(TSGetStepRejections(ts_, &before));
  try {
    SS_TRY(TSStep(ts_));
  } catch (const RankFailure& e) {  // PETSc refuses norms of what is not finite, on every rank alike
    if (std::string(e.what()).find("not-a-number") == std::string::npos) throw;
    outcome.kind = Outcome::not_finite;
  }
  TSConvergedReason reason;
  SS_TRY(TSGetConvergedReason(ts_, &reason));
  SS_TRY(TSGetStepRejections(ts_, &after));
  SS_TRY(TSGetTime(ts_, &outcome.t));
  SS_TRY(TSGetTimeStep(ts_, &outcome.next_h));
  outcome.rejections = int(after - before);
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
