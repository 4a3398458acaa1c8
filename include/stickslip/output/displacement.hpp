// The displacement chi and the energy of a motion, from psi and eta.
//
// chi is not an unknown of the model; with w = chi - v t it follows from the elastic force by one banded
// solve,
//     (K0 - K1 D2) w = -(eta + (s delta/A) psi),      w = (psi_e - v) t at a held end
// (continuum: gamma eta = c^2 chi_xx - (chi - v t) - s delta psi; chain: f0 eta = k0 (V0 t - chi) + k1 D2
// chi). On several ranks with 50000 nodes and more each solves for its own nodes and for those beside them
// that they feel (a force falls by exp(-45) over them), wherever these are few enough; the results are the
// same to round-off.
//
// An error e of eta is one of up to S e in chi, S the largest row sum of (K0 - K1 D2)^-1, 1/K0 without held
// ends: on weak springs more than chi itself is. An error e of psi over its size is one of e times the way
// that is gone. So where S is more than ten times that way, chi is counted: that of the forces at the start,
// and the integral of psi since then, node by node (output/series.hpp). By count_is_better() a run decides it
// at its start, from the way that the plate goes in it, or the nodes would at their first psi.
//
// Between free ends and on a ring of a chain without springs to the plate (k0 = 0) the forces do not tell
// where it is, and what pulls it at the start need not be the springs between its blocks. There chi is always
// counted, from 0 at the start. The elastic energy is -sum chi (eta + eta(0))/2 then, 0 at the start, and the
// plate gives nothing.
//
// Energy and powers are in units of the friction amplitude (gamma or f0); sums are over the blocks of a
// chain, and h times the sum over nodes in the continuum, where a free end has the weight 1/2. With z = eta +
// (s delta/A) psi
//     kinetic  sum psi^2/(2 A)               elastic   sum w (K0 - K1 D2) w/2 = -sum w z/2
//     input    v(t) sum z                    by the driving plate
//     friction sum psi F                     lost in friction
//     viscous  sum (B + s delta/A) psi^2 - N psi D2 psi     lost in damping and in viscosity between
//                                                           neighbours; the
//                                            first part is negative with the printed sign, which drives
//     d(kinetic + elastic)/dt = input - friction - viscous
// exactly, for the semi-discrete system, on a ring and between free ends, where D2 is symmetric in these
// sums. A held end works on the system too, and with order 4 and 6 its D2 is not symmetric: no energy is
// given there.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

struct Energy {
  double kinetic, elastic, input, friction, viscous;
};

class Displacement {
 public:
  // Factors the matrix, but where the chain floats. `plate`: whose clock it keeps; it must outlive this.
  // Collective.
  Displacement(const Model& model, const Plate& plate);

  // Where no force says where the chain is; then count() comes first.
  static bool floats(const Scene& scene) { return springless(scene) && !scene.any_held(); }
  // See above; u: at the start of a run until t_end. Collective.
  bool count_is_better(Vec u, double t_end) const;
  // From now on chi is counted: chi and eta of this rank's nodes at the start, and how far they have gone
  // since then at any time that is asked for.
  using Slip = std::function<const std::vector<double>&(double t)>;
  void count(std::vector<double> chi, std::vector<double> eta, Slip slip);

  VecHandle create_vector() const;  // one value a node, distributed as the model's nodes
  void solve(Vec u, double t, Vec chi) const;     // collective
  void solve_at_start(Vec u, Vec chi) const;      // from which chi is counted; collective

  bool has_energy() const;  // no held end
  // At the time t, which says the velocity of the plate: at a corner of a load (load.hpp) that of the piece
  // that Model::begin_load() has said, in which a step that ends there lies. Collective; only where
  // has_energy().
  Energy energy(Vec u, double t) const;

 private:
  void solve_counted(double t, Vec chi) const;
  void solve_relative(Vec u, double t, double travelled, Vec w) const;
  void solve_loaded(Vec w) const;  // with what stands in load_
  double end_velocity(PetscInt held) const;
  void make_whole();
  void make_piece(PetscInt margin);
  template <class Place>
  void add_row(PetscInt node, PetscInt row, const Place& place);
  void finish_matrix();
  double damping(PetscInt local_node) const;

  const Model& model_;
  const Plate& plate_;
  bool floats_;
  std::vector<double> chi_at_start_, eta_at_start_;  // where it is counted
  Slip slip_;
  MatHandle matrix_;
  KspHandle ksp_;
  mutable VecHandle w_, load_;
  PetscInt own_ = 0;                // where this rank's nodes begin in its piece
  VecHandle piece_w_;               // in pieces
  std::optional<NodeFetch> fetch_;  // the load of a piece; none where the whole is solved
};

}  // namespace stickslip
