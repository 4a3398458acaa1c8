// Which values of a scene's nodes a rank has, and where it writes them in files.
//
// Every rank writes the nodes that it owns. Where the model is one of several equal cells of a scene, large
// cells (from a megabyte a field on) are written once for each cell by the ranks that own their nodes; small
// ones every rank has whole and writes for an equal part of the scene's nodes. No rank ever has more than its
// part, or a megabyte a field.
#pragma once

#include <petscsys.h>

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

  // Calls put(first, count, values) for every run of nodes that this rank writes, `values` being those that
  // it has.
  using Put = std::function<void(std::int64_t first, std::int64_t count, const double* values)>;
  void place(const double* values, const Put& put) const;

  // The values that this rank has are one run of nodes from here on, and stand in the file once.
  bool is_one_run() const { return cells_ == 1; }
  std::int64_t first() const { return first_; }

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
  std::int64_t nodes_ = 0, cell_ = 0, cells_ = 1;
  // of the cell's nodes the first that this rank owns; if gathered, of the scene's nodes the
  std::int64_t first_ = 0;
  // first that it writes
  std::int64_t end_ = 0;  // one after the last of them
  std::size_t owned_ = 0, kept_ = 0;
  bool gathered_ = false;              // every rank has the cell
  std::vector<int> counts_, offsets_;  // of the ranks, for that
};

}  // namespace stickslip
