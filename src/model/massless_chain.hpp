// The massless equations (massless.hpp) on this rank's nodes of a Model.
#pragma once

#include <petscmat.h>

#include <string>
#include <vector>

#include "model/massless.hpp"
#include "stickslip/model/frictions.hpp"

namespace stickslip {

class MasslessChain {
 public:
  // Throws UsageError, on every rank, where some block cannot begin to slip
  // without a jump. Collective.
  MasslessChain(MPI_Comm comm, const Scene& scene, const Frictions& law, const std::vector<double>& amplitude,
                PetscInt first);

  // psi of u from its eta and state, from the psi that stands there; NaN where it is lost. Not collective.
  void solve_velocities(Vec u) const;
  // Where the last solve_velocities() found none, or at the psi in u friction falls all but as fast as B psi
  // rises, or psi has grown without bound, in words; "" where nothing is so on any rank. Collective.
  std::string velocity_jump(Vec u) const;
  // J = alpha I + beta d(rates of eta and state)/du at u, which is settled. Collective.
  void jacobian(Vec u, double alpha, double beta, Mat J) const;

 private:
  std::string runaway(Vec u) const;
  bool held(PetscInt i) const;  // local numbers
  MasslessNode node(PetscInt i) const {
    return {law_[i], amplitude_[i], scene_.B(), scene_.friction.back_slip};
  }
  void check() const;
  void find_edge(Vec u) const;
  void add_coupling(double factor, Vec slopes, Mat J) const;
  void add_own(const double* u, const double* slopes, double alpha, double beta, Mat J) const;

  MPI_Comm comm_;
  Scene scene_;
  Frictions law_;
  std::vector<double> amplitude_;
  PetscInt first_, local_;
  int dof_;
  double velocity_;  // of the scene's scales
  mutable double lost_at_ = -1, lost_from_ = 0;  // x of a node without psi, and the psi that it came from
  mutable bool lost_is_overflow_ = false;        // it has one, beyond all numbers
};

}  // namespace stickslip
