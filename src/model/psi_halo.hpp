// psi of the nodes on either side of a rank's own, which its stencil reaches: other ranks' nodes, and beyond
// the ends of the scene what these make of nodes inside (stencil.hpp).
#pragma once

#include <petscsys.h>

#include <utility>
#include <vector>

#include "stickslip/base/handle.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

class PsiHalo {
 public:
  // Of the nodes first .. first + local - 1; `pattern`: a Vec of the unknowns, dof a node. Collective.
  PsiHalo(const Scene& scene, int dof, PetscInt first, PetscInt local, Vec pattern);

  bool is_local() const { return is_local_; }  // one rank has all nodes: nothing is sent
  // Takes the values from u; with several ranks in two steps, of which the first only asks. Collective.
  void read(const double* u) const;
  void begin(Vec u) const;
  void end(Vec u) const;

  // psi of node i of this rank, or of its halo as it was taken last: -half_width .. local + half_width - 1.
  double psi_at(const double* u, PetscInt i) const {
    if (i >= 0 && i < local_) return u[i * dof_];
    double psi = 0;
    for (const auto& [index, weight] : halo_[i < 0 ? i + half_width_ : half_width_ + i - local_])
      psi += weight * values_[index];
    return psi;
  }

 private:
  // One value as a combination of fetched ones: indices into the list of fetched nodes, and weights.
  using Value = std::vector<std::pair<std::size_t, double>>;

  int dof_, half_width_;
  PetscInt local_;
  std::vector<PetscInt> fetched_;  // global numbers, each once; they feed 2 half_width values
  std::vector<Value> halo_;        // half_width values left (from -half_width to -1), then as many right
  bool is_local_ = true;
  ScatterHandle scatter_;
  VecHandle fetched_psi_;
  mutable std::vector<double> values_;
};

}  // namespace stickslip
