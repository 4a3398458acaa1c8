// Which values of a scene's nodes a rank has, and where they stand in a row of a file.
//
// Every rank has the nodes that it owns. Where the model is one of several equal cells of a scene, small
// cells (below a megabyte a field) are brought to rank 0, which repeats them; of large ones each rank gives
// its part once for each cell. So no rank has more than its part, or a megabyte a field.
#pragma once

#include <petscsys.h>
#include <petscvec.h>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "stickslip/model/model.hpp"

namespace stickslip {

class Slab {
 public:
  // Nodes of a scene without a model, dealt out evenly. Not collective.
  static Slab even(MPI_Comm comm, std::int64_t nodes);
  Slab() = default;
  // Of the scene with so many nodes, of which the model may be one of several equal cells. Collective.
  Slab(const Model& model, std::int64_t nodes);

  std::int64_t nodes() const { return nodes_; }  // of the whole scene
  std::size_t kept() const { return kept_; }     // values a field that this rank has

  // Appends what this rank has of a field whose values on its own nodes stand at own[0], own[stride], ...
  // Collective.
  void take(const double* own, int stride, std::vector<double>& to) const;

  // Calls put(first, count, values) for every run of nodes that this rank has, `values` being those.
  using Put = std::function<void(std::int64_t first, std::int64_t count, const double* values)>;
  void place(const double* values, const Put& put) const;

  // The values that this rank has are one run of nodes from here on, and stand in the file once.
  bool is_one_run() const { return cells_ == 1; }
  std::int64_t first() const { return first_; }

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
  std::int64_t nodes_ = 0, cell_ = 0, cells_ = 1;
  std::int64_t first_ = 0;  // of the cell's nodes the first that this rank owns
  std::size_t owned_ = 0, kept_ = 0;
  bool gathered_ = false;              // rank 0 has the cell
  std::vector<int> counts_, offsets_;  // of the ranks, for that
};

// Brings an interleaved vector (dof values a node, nodes in order) to rank 0, and back: for files, which rank
// 0 writes.
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
