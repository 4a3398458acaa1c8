// Tangent vectors of a motion: small deviations y of the unknowns, which obey
//     y_t = J(u(t)) y,     J = d(right-hand side)/du,
// between the moments at which a node starts or stops, and jump there with the directions of motion.
//
// Between such moments the pair of Dormand and Prince, of order 5, takes them along values of u inside the
// step, which the caller gives, in as many parts as the fastest rate of J asks for: no wave and no stiff
// friction is damped falsely, and stiff friction makes it slow. J is never assembled: it is a block for each
// node and the coupling of neighbours.
//
// Where a node starts, stops or turns, a deviation of that node passes a jump matrix (model/jump_matrix.hpp).
// A node that stops loses a direction, and while m nodes rest no more than all unknowns less m are left, then
// and ever after.
//
// psi and eta of held nodes are no unknowns: their deviations are 0.
//
// Collective over the model's ranks unless said otherwise; the same on any number of them but for round-off.
//
// Source: G. Benettin, L. Galgani, A. Giorgilli and J.-M. Strelcyn, Meccanica 15 (1980) 9; P. C. Mueller,
// Chaos, Solitons and Fractals 5 (1995) 1671 (jumps).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "stickslip/model/model.hpp"

namespace stickslip {

class Tangents {
 public:
  // `count` random vectors, at most as many as there are unknowns. No step has been taken.
  Tangents(const Model& model, int count);
  // Memory of a node with `dof` unknowns, in bytes: blocks of four linearisations; of each vector itself and
  // its slopes.
  static double bytes_a_node(double dof, double count) { return 32 * dof * dof + (3 + 7 * count) * 8 * dof; }

  // u at the part [0, 1] of a step.
  using Inside = std::function<void(double part, Vec into)>;
  // Over a step of length dt with the directions of motion of the model. Where a node started or stopped
  // since the last step, the jump comes first. Throws Failure where the step would take more than a million
  // parts.
  void advance(double dt, const Inside& inside);

  // ln of what the volume of the first k vectors has grown by since the last call, less that of the first k -
  // 1; then they are orthonormal. -infinity for one that stands for no direction any more.
  std::vector<double> growth();
  // Integral of the trace of J over the last step.
  double divergence() const { return divergence_; }
  // Whether a node has rested in a step since the beginning, or renew().
  bool has_rested() const { return most_resting_ > 0; }
  // New random vectors for those that stood for none any more.
  void renew();

  const std::vector<VecHandle>& vectors() const { return y_; }
  // What a later object needs to go on alike (output/archive.hpp): the vectors, the directions of the last
  // step in the place of psi, and what has been counted.
  template <class Archive>
  void archive(Archive& a) {
    for (std::size_t k = 0; k < y_.size(); ++k) a("lyapunov.vector_" + std::to_string(k), y_[k]);
    a("lyapunov.directions", was_);
    a("lyapunov.vectors", draws_, most_resting_, rank_deficient_, growth_);
    begun_ = begun_ || a.restores();
  }

 private:
  struct Linearisation {
    std::vector<NodeBlock> blocks;  // of this rank's nodes
    double trace = 0, rate = 0;     // of this rank
  };
  void draw(std::size_t k);
  void begin(Vec u);
  bool directions_changed() const;
  void jump(Vec u);
  bool jump_at(PetscInt i, const double* u, const double* f, const double* g, double from, double to);
  void find_neighbour_forces(Vec f);
  void check_order(const std::vector<double>& was, const double* f, const double* g) const;
  void count_resting();
  double own_viscous_slope(PetscInt local_node) const;
  void linearise(Vec u, Linearisation& at) const;
  void rates(const Linearisation& at, Vec y, Vec into) const;
  void take_part(double begin, double length, double dt, const Inside& inside);
  void move(double dt, const Inside& inside);
  void rest(double dt, Vec u);
  void orthonormalise(bool after_jump);
  bool by_cholesky(std::vector<double>& lengths);
  void one_by_one(std::vector<double>& lengths, bool after_jump);
  void clear_held(double* y) const;

  const Model& model_;
  int dof_;
  std::vector<VecHandle> y_;
  std::vector<char> rank_deficient_;  // stands for no direction any more
  std::vector<double> growth_;
  std::vector<std::vector<VecHandle>> slope_;  // of each vector, stage by stage
  VecHandle u_, stage_, was_;
  std::vector<std::vector<double>> neighbour_forces_;  // N D2 psi at the nodes, see find_neighbour_forces
  Linearisation start_, inside_;
  bool begun_ = false, start_known_ = false, any_moves_ = true;
  long draws_ = 0;
  double divergence_ = 0;
  long most_resting_ = 0;
};

}  // namespace stickslip
