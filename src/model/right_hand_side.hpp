// The right-hand side on a range of nodes whose unknowns lie interleaved, with the halo given beside it.
//
// Vector instructions dislike that layout. So a tile of nodes at a time is spread into columns that stay in
// the first-level cache, on which the loops of loops.hpp work. What drives a node is e = eta + N D2 psi:
//     psi_t = A (e - B psi - F),     eta_t = K0 (v - psi) + K1 D2 psi - s delta (e - F)
// With viscosity the pointwise loops, which know nothing of it, are given e, and K1 D2 psi is added to what
// they say of eta.
#pragma once

#include <petscmat.h>
#include <petscsys.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/loops.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/frictions.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

class Model;

// Floating-point operations of so many evaluations on this rank's nodes, for -log_view: those of the stencil
// and of the sums; friction counts as ten whatever the law, a state with its rate as ten more.
void log_flops(const Model& model, long evaluations);

// psi of the nodes on either side of a rank's own, which its stencil reaches: other ranks' nodes, and beyond
// the ends of the scene what these make of nodes inside (stencil.hpp).
class PsiHalo {
 public:
  // Of the nodes first .. first + layout.local - 1. Collective.
  PsiHalo(const Scene& scene, const NodeFetch::Layout& layout, PetscInt first);

  const NodeFetch& fetch() const { return *fetch_; }  // to be taken from the unknowns

  // psi of node i of this rank, or of its halo as it was taken last: -half_width .. local + half_width - 1.
  double psi_at(const double* u, PetscInt i) const {
    if (i >= 0 && i < local_) return u[i * dof_];
    double psi = 0;
    for (const auto& [index, weight] : halo_[i < 0 ? i + half_width_ : half_width_ + i - local_])
      psi += weight * fetch_->values()[index];
    return psi;
  }

 private:
  // One value as a combination of fetched ones: indices into the list of fetched nodes, and weights.
  using Value = std::vector<std::pair<std::size_t, double>>;

  int dof_, half_width_;
  PetscInt local_;
  std::vector<Value> halo_;  // half_width values left (from -half_width to -1), then as many right
  std::optional<NodeFetch> fetch_;
};

struct InterleavedRange {
  const double* u;          // unknowns of the first node
  const double* amplitude;  // a_i of the first node; nullptr: all are 1
  double* f;                // right-hand side of the first node; does not overlap u
  PetscInt count;
  const double *before, *behind;      // psi of the half_width nodes before and behind the range, in order
  const double* direction = nullptr;  // of motion, with friction that sticks: 1, -1, 0 at rest
  PetscInt node = 0;                  // number of the first node, of those that the constructor was given
};

class RightHandSide {
 public:
  // Of the nodes first .. first + count - 1.
  RightHandSide(const Scene& scene, PetscInt first, PetscInt count);

  // f = the terms `part`, at the plate's velocity v. Of a massless chain psi has the rate 0.
  void take(Part part, double v, const InterleavedRange& range) const;
  // f = N D2 psi in the place of eta, 0 elsewhere; of a viscous scene.
  void viscous_force(const InterleavedRange& range) const;

 private:
  struct Tile;
  template <class Body>
  void over_tiles(const InterleavedRange& range, bool coupled, const Body& body) const;

  int dof_, half_width_;
  bool massless_;
  double K1_, N_;
  kernel::Coefficients coefficients_;  // its weights: of K1 D2, or of D2 where neighbours have viscosity
  kernel::Copy to_columns_;
  StencilLoop stencil_;
  PointwiseLoop sliding_, sticking_, frictionless_;
};

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

// The massless equations on this rank's nodes of a Model.
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
