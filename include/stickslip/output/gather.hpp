// Brings an interleaved vector (dof values a node, nodes in order) to rank 0, and back: for files, which rank
// 0 writes.
#pragma once

#include <petscvec.h>

#include <vector>

namespace stickslip {

class Gather {
 public:
  Gather(Vec like, PetscInt dof);
  // The components, each one value a node, on rank 0; empty vectors elsewhere. Valid until the next call.
  // Collective.
  const std::vector<std::vector<double>>& components(Vec v);
  // The whole vector as it stands, on rank 0. Collective.
  std::vector<double> interleaved(Vec v);
  // The inverse of interleaved(): `values` of rank 0 into v. Collective.
  void spread(const std::vector<double>& values, Vec v);

 private:
  MPI_Comm comm_;
  std::vector<int> first_, count_;  // of each rank
  std::size_t size_;                // of all
  std::vector<std::vector<double>> components_;
};

}  // namespace stickslip
