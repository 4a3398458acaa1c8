#include "time/step_guard.hpp"

#include <utility>

#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/scales.hpp"

namespace stickslip {

// psi and eta beyond 1e20 and a state beyond 1e42 of what slips are measured by count as not finite: a step
// from there has lost the motion, and the cube in the friction and the square of that in PETSc's estimate of
// the error are still finite. A cube overflows at 1e102.
StepGuard::StepGuard(const Model& model) : model_(model) {
  const Scales slip = scales_of(model.scene()).slip;
  for (int d = 0; d < 3; ++d) overflows_[d] = (d < 2 ? 1e82 : 1e60) / slip.of(d);
}

// x - x is 0 for finite x and NaN otherwise, and NaN stays.
bool StepGuard::all_finite(Vec u) const {
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

void StepGuard::set_up(TS ts, const std::string& type, bool adaptive) {
  adaptive_ = adaptive;
  undoes_ = adaptive && (type == TSRK || type == TSARKIMEX);
  if (type != TSRK) return;
  const PetscReal *A, *b, *c, *embedded, *interpolating;
  PetscInt stages, degree;
  PetscBool fsal;
  SS_TRY(TSRKGetTableau(ts, &stages, &A, &b, &c, &embedded, &degree, &interpolating, &fsal));
  last_stage_ = stages - 1;
  first_same_as_last_ = fsal;
}

void StepGuard::begin_step(TS ts) { SS_TRY(TSGetStepRejections(ts, &rejections_)); }

// PETSc undoes a rejected step of rk and arkimex by subtracting what it added, which after a step far too
// large leaves nothing of u but round-off. So u is put back from a copy before the step is tried again.
bool StepGuard::repeats(TS ts, Vec before) {
  PetscInt rejections;
  SS_TRY(TSGetStepRejections(ts, &rejections));
  if (rejections == rejections_) return false;
  rejections_ = rejections;
  if (undoes_) {
    Vec u;
    SS_TRY(TSGetSolution(ts, &u));
    SS_TRY(VecCopy(before, u));
  }
  return true;
}

Vec StepGuard::work_of(Vec u) {
  if (!work_) SS_TRY(VecDuplicate(u, work_.out()));
  return work_;
}

// Adaptive methods only: a stage that is not finite, or without mass one that says no psi, rejects the step,
// which PETSc would accept, since no comparison with NaN is true. What goes wrong in an early stage of rk
// reaches the last one, so that later steps look at that alone.
bool StepGuard::accepts(Vec u) {
  const bool last = stage_ == last_stage_;
  if (last_stage_ >= 0 && started_ && !last) return true;
  bool accept = all_finite(u);
  if (accept && model_.scene().massless()) {
    SS_TRY(VecCopy(u, work_of(u)));
    model_.solve_velocities(work_);
    accept = all_finite(work_);
  }
  checked_last_ = last;
  return accept;
}

bool StepGuard::knows_solution() {
  started_ = true;
  return std::exchange(checked_last_, false) && adaptive_ && first_same_as_last_;
}

}  // namespace stickslip
