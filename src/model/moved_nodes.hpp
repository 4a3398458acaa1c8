// Nodes as those see them who watch a run.
#pragma once

#include <petscsystypes.h>

#include <cstdint>
#include <limits>

#include "stickslip/model/scene.hpp"

namespace stickslip {

// Nodes that are advanced by themselves while others rest (time/clusters.hpp), as what watches them sees it.

// A step of nodes first, first + 1, ... (round a ring): their unknowns (the state where there is one) and the
// right-hand side at its beginning and end; where neighbours have viscosity also N D2 psi and N D2 psi_t,
// else nullptr. direction: 1 or -1 while the node slides in the step, 0 while it rests.
struct MovedNodes {
  double t0, t1;
  PetscInt first, count;
  struct End {
    const double *psi, *eta, *psi_rate, *eta_rate, *viscous = nullptr, *viscous_rate = nullptr,
                                                   *state = nullptr;
  } begin, end;
  const double* direction;

  // The place of a node among them, -1 where it is none; all: nodes of the whole.
  PetscInt place(PetscInt node, PetscInt all) const {
    const PetscInt k = node >= first ? node - first : node + all - first;
    return k < count ? k : -1;
  }
};

// The whole medium at a time to which all that happens is done.
class MediumNow {
 public:
  struct Totals {  // over all nodes
    double psi_min = std::numeric_limits<double>::infinity(), psi_max = -psi_min, psi_sum = 0, eta_sum = 0;
  };
  virtual ~MediumNow() = default;
  virtual Totals totals(double t) const = 0;
  virtual void node(PetscInt i, double t, double* u) const = 0;  // its unknowns
  virtual bool is_advanced(PetscInt i) const = 0;                // or rests in closed form
  virtual PetscInt advanced() const = 0;                         // how many are
  virtual std::int64_t steps() const = 0;                        // so far, of clusters
  virtual std::int64_t rejections() const = 0;
};

// What a node counts in a sum over the system.

// 1 in the chain; in the continuum h, and half of it at an end of the line (the trapezoidal rule, in whose
// inner product D2 is symmetric between free ends: stencil.hpp).
inline bool counts_half(const Scene& s, PetscInt node) {
  return s.form == Form::continuum && !s.ring() && (node == 0 || node == s.n - 1);
}
inline double node_weight(const Scene& s, PetscInt node) {
  return (s.form == Form::chain ? 1 : s.h()) * (counts_half(s, node) ? 0.5 : 1);
}

}  // namespace stickslip
