// Tangent vectors of a motion: small deviations y of the unknowns, which obey
//     y_t = J(u(t)) y,     J = d(right-hand side)/du,
// between the moments at which a node starts or stops, and jump there with the directions of motion.
//
// Between such moments they are taken along values of u inside the step, which the caller gives: by an
// explicit method in as many parts as the fastest rate of J asks for, so that no wave is damped falsely;
// where a node's friction asks for far more parts than its neighbours do, by an implicit-explicit one whose
// parts are as long as an estimate of their error allows (stability/tangent_parts.hpp).
//
// Where a node starts, stops or turns, a deviation of that node passes a jump matrix (model/stick_rule.hpp).
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
#include <memory>
#include <string>
#include <vector>

#include "stickslip/model/model.hpp"

namespace stickslip {

class TangentParts;

class Tangents {
 public:
  // `count` random vectors, at most as many as there are unknowns. No step has been taken.
  Tangents(const Model& model, int count);
  ~Tangents();

  // u at the part [0, 1] of a step.
  using Inside = std::function<void(double part, Vec into)>;
  // Over a step of length dt with the directions of motion of the model. Where a node started or stopped
  // since the last step, the jump comes first. Throws Failure where the step would take more than a million
  // parts: with a vector more than there are directions that friction does not damp at once, say.
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
  // What a later object needs to go on alike (output/checkpoint.hpp): the vectors, the directions of the last
  // step in the place of psi, and what has been counted.
  template <class Archive>
  void archive(Archive& a) {
    for (std::size_t k = 0; k < y_.size(); ++k) a("lyapunov.vector_" + std::to_string(k), y_[k]);
    a("lyapunov.directions", was_);
    a("lyapunov.vectors", draws_, most_resting_, rank_deficient_, growth_, stiff_part_);
    begun_ = begun_ || a.restores();
  }

 private:
  void draw(std::size_t k);
  void begin(Vec u);
  bool directions_changed() const;
  void jump(Vec u);
  bool jump_at(PetscInt i, const double* u, const double* f, const double* g, double from, double to);
  void find_neighbour_forces(Vec f);
  void check_order(const std::vector<double>& was, const double* f, const double* g) const;
  void count_resting();
  void move(double dt, const Inside& inside);
  void move_explicitly(double from, double dt, const Inside& inside, double parts);
  double move_stiff(double dt, const Inside& inside, double most);
  std::vector<Vec> living(const std::vector<VecHandle>& vectors) const;
  void rest(double dt, Vec u);
  void orthonormalise(bool after_jump);
  void count_growth(const std::vector<double>& lengths);
  bool by_cholesky(std::vector<double>& lengths, double shortest = 0);
  void one_by_one(std::vector<double>& lengths, bool after_jump);

  const Model& model_;
  int dof_;
  std::vector<VecHandle> y_;
  std::vector<char> rank_deficient_;  // stands for no direction any more
  std::vector<double> growth_;
  std::vector<VecHandle> next_;  // at the end of a part that is tried
  VecHandle u_, was_;
  std::vector<std::vector<double>> neighbour_forces_;  // N D2 psi at the nodes, see find_neighbour_forces
  std::unique_ptr<TangentParts> parts_;
  double stiff_part_;  // length of the next part of move_stiff(), in time: any to begin with
  bool begun_ = false, start_known_ = false, any_moves_ = true;
  long draws_ = 0;
  double divergence_ = 0;
  long most_resting_ = 0;
};

}  // namespace stickslip
