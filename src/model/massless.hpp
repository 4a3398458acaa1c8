// The massless chain (m = 0): inertia is gone, and at every moment
//     r(psi) = B psi + a_i F(psi, state) - eta = 0
// says what psi of a node is, from its own eta and state. What is advanced in time is eta and the state; psi
// stands in its place beside them, where the next solution starts from the last one.
//
// The motion goes on along one branch of r's zeros as long as dr/dpsi = B + a_i F_psi > 0. Where that is lost
// psi would have to jump, over no time: then there is no answer, and the node is named (NaN in psi). Between
// the last psi and a far new one the slope is looked at in steps of at most half of psi.
//
// Friction that is steep at rest (a direct effect, ln or asinh of psi) rises with psi at every state, so that
// r has one zero, over any number of decades of psi: it is solved for in ln |psi|, and lies in what a double
// can hold.
//
// Friction that sticks holds psi = 0 while |eta| is within its threshold and begins to slip without a jump
// where sliding friction begins at the threshold (no fs > fd) and B psi rises faster than friction falls
// (jump_at_rest).
//
// Nothing here communicates. eta and F are numbers, psi a velocity.
#pragma once

#include <petscmat.h>

#include <string>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

// One node.
struct MasslessNode {
  const Friction& law;
  double amplitude, B;
  bool back_slip;

  // The zero of r on the branch of `guess`, a zero at other eta and state; NaN where the branch ends before.
  double velocity(double eta, double state, double guess) const;
  // dpsi/deta (value) and dpsi/dstate (slope) there; both 0 at rest.
  struct Slopes {
    double by_eta, by_state;
  };
  Slopes slopes(double psi, double state) const;

 private:
  Partials force(double psi, double state, double direction) const;
  double zero(double eta, double state, double guess, double direction) const;
  double steep_zero(double eta, double state, double guess) const;
  bool rises_between(double from, double to, double state, double direction) const;
};

// "" where every slip of this node begins without a jump, as far as its law alone says; else why not.
std::string jump_at_rest(const MasslessNode& node);

// The massless equations (massless.hpp) on this rank's nodes of a Model.
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
