#include "stickslip/output/displacement.hpp"

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/banded_ksp.hpp"

namespace stickslip {

Displacement::Displacement(const Model& model) : model_(model) {
  const Scene& s = model.scene();
  const bool held = s.left == End::velocity || s.right == End::velocity;
  if (s.K0() == 0 && !held)
    throw UsageError("out_displacement: with model_k0 0 and no held end the forces do not tell where the chain is; set "
                     "model_k0, or leave it out");
  SS_TRY(MatCreateAIJ(model.comm(), model.local(), model.local(), s.n, s.n, 2 * s.order + 1, nullptr, s.order + 1,
                      nullptr, matrix_.out()));
  for (PetscInt i = model.first(); i < model.first() + model.local(); ++i) {
    SS_TRY(MatSetValue(matrix_, i, i, model.held(i) ? 1 : s.K0(), ADD_VALUES));
    if (model.held(i)) continue;
    for (const auto& [node, weight] : second_difference_row(s, i))
      SS_TRY(MatSetValue(matrix_, i, node, -s.K1() * weight, ADD_VALUES));
  }
  SS_TRY(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatCreateVecs(matrix_, w_.out(), load_.out()));

  SS_TRY(KSPCreate(model.comm(), ksp_.out()));
  SS_TRY(KSPSetOperators(ksp_, matrix_, matrix_));
  solve_by_banded_lu(ksp_);
  SS_TRY(KSPSetUp(ksp_));
}

VecHandle Displacement::create_vector() const {
  VecHandle chi;
  SS_TRY(VecDuplicate(w_, chi.out()));
  return chi;
}

void Displacement::solve(Vec u, double t, Vec chi) const {
  const Scene& s = model_.scene();
  const bool loaded = s.load.varies();
  const double damping = s.s_delta() / s.A(), travelled = loaded ? s.load.integral(t) : s.v * t;
  const double* a;
  double* b;
  SS_TRY(VecGetArrayRead(u, &a));
  SS_TRY(VecGetArrayWrite(load_, &b));
  for (PetscInt i = 0; i < model_.local(); ++i) {
    const double *at = a + i * model_.dof(), end = model_.first() + i == 0 ? s.left_value : s.right_value;
    b[i] = model_.held(model_.first() + i) ? (loaded ? end * t - travelled : (end - s.v) * t) : -(at[1] + damping * at[0]);
  }
  SS_TRY(VecRestoreArrayWrite(load_, &b));
  SS_TRY(VecRestoreArrayRead(u, &a));
  SS_TRY(KSPSolve(ksp_, load_, chi));
  SS_TRY(VecShift(chi, travelled));
}

bool Displacement::has_energy() const {
  const Scene& s = model_.scene();
  return s.left != End::velocity && s.right != End::velocity;
}

Energy Displacement::energy(Vec u) const {
  const Scene& s = model_.scene();
  const double damping = s.s_delta() / s.A();
  solve(u, 0, w_);  // chi at time 0 is w
  VecHandle viscous;
  if (model_.viscous()) {
    viscous = model_.create_vector();
    model_.viscous_force(u, viscous);
  }
  const double *a, *w, *e = nullptr;
  SS_TRY(VecGetArrayRead(u, &a));
  SS_TRY(VecGetArrayRead(w_, &w));
  if (viscous) SS_TRY(VecGetArrayRead(viscous, &e));
  double sums[5] = {0, 0, 0, 0, 0};
  for (PetscInt i = 0; i < model_.local(); ++i) {
    const PetscInt node = model_.first() + i;
    const bool end = s.form == Form::continuum && !s.ring() && (node == 0 || node == s.n - 1);
    const double weight = (s.form == Form::continuum ? s.h() : 1) * (end ? 0.5 : 1);
    const double *at = a + i * model_.dof(), psi = at[0], z = at[1] + damping * psi;
    const double F = model_.friction(i, psi, model_.dof() == 3 ? at[2] : 0).F;
    sums[0] += weight * psi * psi / (2 * s.A());
    sums[1] -= weight * w[i] * z / 2;
    sums[2] += weight * model_.plate_velocity() * z;
    sums[3] += weight * psi * F;
    sums[4] += weight * (s.B() + damping) * psi * psi;
    if (e) sums[4] -= weight * psi * e[i * model_.dof() + 1];
  }
  if (viscous) SS_TRY(VecRestoreArrayRead(viscous, &e));
  SS_TRY(VecRestoreArrayRead(w_, &w));
  SS_TRY(VecRestoreArrayRead(u, &a));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, sums, 5, MPI_DOUBLE, MPI_SUM, model_.comm()));
  return {sums[0], sums[1], sums[2], sums[3], sums[4]};
}

}  // namespace stickslip
