// A program with a law, methods and a measure of its own, compiled from an installed copy of the library: the
// cubic law and Heun's method once more, Kutta's method of order 3 and the largest velocity of a run, so that
// what comes out is known.
#include <petsc/private/tsimpl.h>  // for writers of TS types

#include <algorithm>
#include <cmath>

#include "commands/register_law.hpp"
#include "stickslip/commands/program.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/output/observer.hpp"
#include "stickslip/time/methods.hpp"

namespace {

struct MyCubic : stickslip::LawDefaults {
  static constexpr const char* name = "my-cubic";
  static constexpr bool jumps_at_rest = false;
  double scale = 1;
  static std::vector<stickslip::Declared<MyCubic>> parameters() {
    using R = stickslip::Parameter::Range;
    return {{&MyCubic::scale, {"scale", "1", R::positive, "", "my-cubic: multiplies it"}}};
  }

  template <class Real, class Sign>
  stickslip::WithSlopeOf<Real> phi(Real psi, Sign) const {
    return {scale * (psi * (psi * psi * (1. / 3) - 1)), scale * (psi * psi - 1)};
  }
  stickslip::SlopeBounds slope_bounds() const { return {0, 3 * scale}; }
};

// ---- the largest |psi| of any node: `fastest` of the summary, its course is `fastest/psi` of the file ----

class Fastest : public stickslip::Observer {
 public:
  static std::vector<stickslip::SummaryKey> keys() {
    return {{"fastest", "length/time", "the largest abs(psi) that any node has in the run"}};
  }
  explicit Fastest(const stickslip::Model& model) : model_(model) {}

  void plan(stickslip::ObservationPlan& plan) override {
    plan.layout.groups.push_back(
        {"fastest", {"t", "time", "time"}, {{"psi", "length/time", "largest abs(psi) of all nodes"}}});
  }
  void archive(stickslip::Archive& a) override { a("fastest", largest_); }
  void start(stickslip::RunFile* file) override { file_ = file; }
  void step(const stickslip::ObservedStep& step) override {
    const PetscScalar* u;
    double now = 0;
    if (VecGetArrayRead(step.u, &u)) return;
    for (PetscInt i = 0; i < model_.local(); ++i) now = std::max(now, std::abs(u[i * model_.dof()]));
    if (VecRestoreArrayRead(step.u, &u)) return;
    MPI_Allreduce(MPI_IN_PLACE, &now, 1, MPI_DOUBLE, MPI_MAX, model_.comm());
    largest_ = std::max(largest_, now);
    if (file_) file_->row("fastest", step.t, {now});
  }
  void summarise(stickslip::Summary& summary, Vec) override { summary.set("fastest", largest_); }

 private:
  const stickslip::Model& model_;
  stickslip::RunFile* file_ = nullptr;
  double largest_ = 0;
};

// ---- Heun's method as a type of TS ----

struct Heun {
  Vec first, second, ahead;
};

PetscErrorCode TSSetUp_Heun(TS ts) {
  Heun* h = static_cast<Heun*>(ts->data);
  PetscFunctionBegin;
  PetscCall(VecDuplicate(ts->vec_sol, &h->first));
  PetscCall(VecDuplicate(ts->vec_sol, &h->second));
  PetscCall(VecDuplicate(ts->vec_sol, &h->ahead));
  PetscFunctionReturn(0);
}

PetscErrorCode TSReset_Heun(TS ts) {
  Heun* h = static_cast<Heun*>(ts->data);
  PetscFunctionBegin;
  PetscCall(VecDestroy(&h->first));
  PetscCall(VecDestroy(&h->second));
  PetscCall(VecDestroy(&h->ahead));
  PetscFunctionReturn(0);
}

PetscErrorCode TSDestroy_Heun(TS ts) {
  PetscFunctionBegin;
  PetscCall(TSReset_Heun(ts));
  PetscCall(PetscFree(ts->data));
  PetscFunctionReturn(0);
}

PetscErrorCode TSStep_Heun(TS ts) {
  Heun* h = static_cast<Heun*>(ts->data);
  const PetscReal dt = ts->time_step;
  PetscReal next = dt;
  PetscBool accept = PETSC_TRUE;
  PetscFunctionBegin;
  PetscCall(TSComputeRHSFunction(ts, ts->ptime, ts->vec_sol, h->first));
  PetscCall(VecWAXPY(h->ahead, dt, h->first, ts->vec_sol));
  PetscCall(TSComputeRHSFunction(ts, ts->ptime + dt, h->ahead, h->second));
  PetscCall(VecAXPBYPCZ(ts->vec_sol, dt / 2, dt / 2, 1, h->first, h->second));
  PetscCall(TSAdaptChoose(ts->adapt, ts, dt, nullptr, &next, &accept));  // ends at the end
  ts->ptime += dt;
  ts->time_step = next;
  PetscFunctionReturn(0);
}

PetscErrorCode TSCreate_Heun(TS ts) {
  Heun* h;
  PetscFunctionBegin;
  PetscCall(PetscNew(&h));
  ts->data = h;
  ts->ops->setup = TSSetUp_Heun;
  ts->ops->step = TSStep_Heun;
  ts->ops->reset = TSReset_Heun;
  ts->ops->destroy = TSDestroy_Heun;
  ts->usessnes = PETSC_FALSE;
  PetscFunctionReturn(0);
}

}  // namespace

int main(int argc, char** argv) {
  stickslip::register_law<MyCubic, stickslip::NoState>();
  stickslip::register_method(
      {"heun", "", stickslip::MethodKind::explicit_, 2, stickslip::Adaptivity::never, "an example"},
      TSCreate_Heun);
  stickslip::register_tableau(
      {{"rk", "kutta3", stickslip::MethodKind::explicit_, 3, stickslip::Adaptivity::yes, "an example"},
       {0, 0, 0, 0.5, 0, 0, -1, 2, 0},
       {1 / 6., 2 / 3., 1 / 6.},
       {0, 1, 0}});
  stickslip::register_observer<Fastest>();
  return stickslip::main(argc, argv);
}
