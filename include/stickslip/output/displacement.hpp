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
// Between free ends and on a ring of a chain without springs to the plate (k0 = 0) the forces do not tell
// where it is, and what pulls it at the start need not be the springs between its blocks. There chi is
// counted from the start of the run: K1 D2 chi = eta - eta(0), whose mean over the blocks is the integral of
// the mean of psi (mean_travel.hpp). The elastic energy is -sum chi (eta + eta(0))/2 then, 0 at the start,
// and the plate gives nothing.
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
#include <vector>

#include "stickslip/model/plate.hpp"

namespace stickslip {

struct Energy {
  double kinetic, elastic, input, friction, viscous;
};

class Displacement {
 public:
  // Factors the matrix. Throws UsageError where no force ties the blocks to each other or to anything.
  // `plate`: whose clock it keeps; it must outlive this. Collective.
  Displacement(const Model& model, const Plate& plate);
  // Memory of a node, in bytes: the matrix and its factors, about, and vectors.
  static double bytes_a_node(const Scene& scene) { return 96 + 12 * scene.order * (scene.ring() ? 4 : 3); }

  // Where the chain is not known by its forces; then count_from() comes first.
  static bool floats(const Scene& scene) { return scene.averaged().K0() == 0 && !scene.any_held(); }
  // eta of this rank's nodes at the start, and the mean of chi since then at any time that is asked for.
  void count_from(std::vector<double> eta, std::function<double(double t)> mean);

  VecHandle create_vector() const;             // one value a node, distributed as the model's nodes
  void solve(Vec u, double t, Vec chi) const;  // collective

  bool has_energy() const;  // no held end
  // At the time t, which says the velocity of the plate: at a corner of a load (load.hpp) that of the piece
  // that Model::begin_load() has said, in which a step that ends there lies. Collective; only where
  // has_energy().
  Energy energy(Vec u, double t) const;

 private:
  void solve_since_start(Vec u, double t, Vec chi) const;
  void solve_relative(Vec u, double t, double travelled, Vec w) const;
  void make_whole();
  void make_piece(PetscInt margin);
  template <class Place>
  void add_row(PetscInt node, PetscInt row, const Place& place);
  void finish_matrix();
  double damping(PetscInt local_node) const;

  const Model& model_;
  const Plate& plate_;
  bool floats_;
  std::vector<double> eta_at_start_;  // where it floats
  std::function<double(double t)> mean_;
  MatHandle matrix_;
  KspHandle ksp_;
  VecHandle w_, load_;
  PetscInt own_ = 0;                // where this rank's nodes begin in its piece
  VecHandle piece_w_, piece_load_;  // in pieces
  ScatterHandle fetch_;             // the load of a piece; none where the whole is solved
};

}  // namespace stickslip
