// The right-hand side on a range of nodes whose unknowns lie interleaved, with the halo given beside it.
//
// Vector instructions dislike that layout. So a tile of nodes at a time is spread into columns that stay in
// the first-level cache, on which the loops of loops.hpp work. What drives a node is e = eta + N D2 psi:
//     psi_t = A (e - B psi - F),     eta_t = K0 (v - psi) + K1 D2 psi - s delta (e - F)
// With viscosity the pointwise loops, which know nothing of it, are given e, and K1 D2 psi is added to what
// they say of eta.
#pragma once

#include <petscsys.h>

#include <optional>
#include <utility>
#include <vector>

#include "model/loops.hpp"
#include "stickslip/base/node_fetch.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

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

}  // namespace stickslip
