#include "model/massless_chain.hpp"

#include <fmt/format.h>
#include <cmath>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/handle.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

MasslessChain::MasslessChain(MPI_Comm comm, const Scene& scene, const Frictions& law,
                             const std::vector<double>& amplitude, PetscInt first)
    : comm_(comm), scene_(scene), law_(law), amplitude_(amplitude), first_(first),
      local_(PetscInt(amplitude.size())), dof_(scene.friction.has_state() ? 3 : 2),
      velocity_(scales_of(scene).velocity) {
  check();
}

bool MasslessChain::held(PetscInt i) const { return scene_.held(first_ + i); }

void MasslessChain::check() const {
  std::string why;
  for (PetscInt i = 0; i < local_ && why.empty(); ++i)
    if (!held(i)) why = jump_at_rest(node(i));
  int jumps = why.empty() ? 0 : 1;
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &jumps, 1, MPI_INT, MPI_MAX, comm_));
  if (!jumps) return;
  if (why.empty()) why = "the velocity of a block would jump as it begins to slip";  // of another rank
  throw UsageError("-model_m 0: " + why + ", which takes no time without mass; take model_m > 0");
}

void MasslessChain::solve_velocities(Vec u) const {
  const Writing a(u);
  lost_at_ = -1;
  for (PetscInt i = 0; i < local_; ++i) {
    if (held(i)) continue;
    double* const at = a + i * dof_;
    const double psi = node(i).velocity(at[1], dof_ == 3 ? at[2] : 0, at[0]);
    if (std::isnan(psi) && lost_at_ < 0) {
      lost_at_ = scene_.x(first_ + i);
      lost_from_ = at[0];
      lost_is_overflow_ = node(i).law.steep;
    }
    at[0] = psi;
  }
}

// At the end of a branch psi moves like the square root of the force that is left, and steps shrink to
// nothing.
void MasslessChain::find_edge(Vec u) const {
  constexpr double close = 1e-3;  // of the slopes that cancel
  const Reading a(u);
  for (PetscInt i = 0; i < local_ && lost_at_ < 0; ++i) {
    const double* const at = a + i * dof_;
    if (held(i) || !std::isfinite(at[0])) continue;
    const double slope = 1 / node(i).slopes(at[0], dof_ == 3 ? at[2] : 0).by_eta, B = scene_.B();
    if (!(slope < close * (B + std::abs(slope - B)))) continue;
    lost_at_ = scene_.x(first_ + i);
    lost_from_ = at[0];
    lost_is_overflow_ = false;
  }
}

std::string MasslessChain::velocity_jump(Vec u) const {
  if (lost_at_ < 0) find_edge(u);
  struct {
    double at;
    int rank;
  } largest{lost_at_, 0};
  double lost[3] = {lost_at_, lost_from_, double(lost_is_overflow_)};
  SS_TRY(MPI_Comm_rank(comm_, &largest.rank));
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &largest, 1, MPI_DOUBLE_INT, MPI_MAXLOC, comm_));
  SS_TRY(MPI_Bcast(lost, 3, MPI_DOUBLE, largest.rank, comm_));
  if (lost[0] < 0) return runaway(u);
  if (lost[2] != 0)  // friction that is steep at rest rises with psi, so that there is a velocity
    return fmt::format(
        "the block at x = {:.6g} runs away from psi = {:.6g}: the velocity that goes with its force is "
        "beyond all numbers, and without mass or viscosity nothing holds it back; take model_zeta > 0, or "
        "model_m > 0",
        lost[0], lost[1]);
  return fmt::format(
      "the force on the block at x = {:.6g} does not say what psi is: from psi = {:.6g} on friction falls "
      "faster than zeta psi rises (zeta/f0 + F_psi <= 0), and without mass psi would jump; take model_m > 0",
      lost[0], lost[1]);
}

// Without zeta nothing bounds psi: where friction falls for good a block goes ever faster within a finite
// time.
std::string MasslessChain::runaway(Vec u) const {
  if (scene_.B() > 0) return "";
  constexpr double far = 1e6;
  const Reading a(u);
  double fastest = 0;
  for (PetscInt i = 0; i < local_; ++i) fastest = std::max(fastest, std::abs(a[i * dof_]));
  fastest = largest_over(comm_, fastest);
  if (!(fastest > far * velocity_)) return "";
  return fmt::format(
      "a block runs away, at psi = {:.3g} by now: without mass or viscosity nothing holds it back; take "
      "model_zeta > 0, or model_m > 0",
      fastest);
}

// psi_j acts on eta of its neighbours, and follows from its own eta and state: what it does stands in their
// columns, times dpsi/deta and dpsi/dstate.
void MasslessChain::jacobian(Vec u, double alpha, double beta, Mat J) const {
  VecHandle columns;
  SS_TRY(VecDuplicate(u, columns.out()));
  const Reading a(u);
  {
    const Writing c(columns);
    for (PetscInt i = 0; i < local_; ++i) {
      const double* const at = a + i * dof_;
      MasslessNode::Slopes s{0, 0};
      if (!held(i)) s = node(i).slopes(at[0], dof_ == 3 ? at[2] : 0);
      double* const factor = c + i * dof_;
      factor[0] = 0;
      factor[1] = s.by_eta;
      if (dof_ == 3) factor[2] = s.by_state;
    }
  }
  SS_TRY(MatZeroEntries(J));
  if (beta != 0) add_coupling(beta, columns, J);
  add_own(a, Reading(columns), alpha, beta, J);
}

// factor (K1 D2 - K0) in the columns of eta and of the state alike, times the slopes.
void MasslessChain::add_coupling(double factor, Vec slopes, Mat J) const {
  std::vector<double> block(dof_ * dof_);
  for (PetscInt i = 0; i < local_; ++i) {
    const PetscInt row = first_ + i;
    Combination terms = second_difference_row(scene_, row);
    for (auto& term : terms) term.second *= scene_.K1();
    terms.emplace_back(row, -scene_.K0());
    for (const auto& [column, value] : terms) {
      for (int d = 1; d < dof_; ++d) block[dof_ + d] = factor * value;
      SS_TRY(MatSetValuesBlocked(J, 1, &row, 1, &column, block.data(), ADD_VALUES));
    }
  }
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatDiagonalScale(J, nullptr, slopes));
}

// alpha I, and beta d(rate of the state) by eta and the state.
void MasslessChain::add_own(const double* u, const double* slopes, double alpha, double beta, Mat J) const {
  std::vector<double> block(dof_ * dof_);
  for (PetscInt i = 0; i < local_; ++i) {
    const PetscInt row = first_ + i;
    for (int d = 0; d < dof_; ++d) block[d * dof_ + d] = alpha;
    if (dof_ == 3) {
      const double *at = u + i * dof_, *by = slopes + i * dof_;
      const RatePartials g = law_[i].rate_partials(at[0], at[2]);
      block[7] = beta * g.g_psi * by[1];
      block[8] = alpha + beta * (g.g_state + g.g_psi * by[2]);
    }
    SS_TRY(MatSetValuesBlocked(J, 1, &row, 1, &row, block.data(), ADD_VALUES));
  }
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
}

}  // namespace stickslip
