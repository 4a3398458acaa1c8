// Numbers of nodes of a grid that is spread over ranks, wherever these nodes lie: the halo of a stencil, the
// places of a probe, a piece of the grid with what lies beside it.
#pragma once

#include <petscvec.h>

#include <vector>

#include "stickslip/base/handle.hpp"

namespace stickslip {

class NodeFetch {
 public:
  // How a vector lies on the ranks: each has `local` nodes of `all`, in order, with `dof` numbers a node.
  struct Layout {
    MPI_Comm comm;
    PetscInt local, all;
    int dof;
  };
  // The first `kept` numbers of each of `nodes`, counted from 0 over all ranks, in any order and as often as
  // each is wanted here. Collective.
  NodeFetch(const Layout& layout, int kept, const std::vector<PetscInt>& nodes);

  bool is_local() const { return !scatter_; }  // one rank has all nodes: nothing is sent
  // The values now, from this rank's part of such a vector; in two steps, the first of which only asks, and
  // `own` is not to change between them. Collective.
  void begin(const double* own) const;
  void end() const;
  void take(const double* own) const {
    begin(own);
    end();
  }
  void take(Vec u) const;

  // As they were taken last, node after node.
  const double* values() const { return values_.data(); }
  Vec vector() const { return fetched_; }  // over the same

 private:
  int dof_, kept_;
  std::vector<PetscInt> nodes_;  // where nothing is sent
  mutable std::vector<double> values_;
  VecHandle own_, fetched_;  // own_: over what is given
  ScatterHandle scatter_;
};

}  // namespace stickslip
