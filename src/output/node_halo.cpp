#include "output/node_halo.hpp"

#include <algorithm>
#include <set>

namespace stickslip {

namespace {
// no row of any order reaches further, the one-sided ones at held ends included
constexpr PetscInt widest_row = 16;
}  // namespace

NodeHalo::NodeHalo(const Scene& scene, const NodeRange& nodes)
    : first_(static_cast<PetscInt>(nodes.first)), count_(static_cast<PetscInt>(nodes.count)) {
  if (nodes.count == nodes.all) return;
  std::set<PetscInt> beside;
  for (PetscInt i = 0; i < count_; ++i) {
    if (i == widest_row) i = std::max(i, count_ - widest_row);
    for (const auto& term : second_difference_row(scene, first_ + i))
      if (term.first < first_ || term.first >= first_ + count_) beside.insert(term.first);
  }
  nodes_.assign(beside.begin(), beside.end());
  fetch_.emplace(NodeFetch::Layout{nodes.comm, count_, static_cast<PetscInt>(nodes.all), 1}, 1, nodes_);
}

std::vector<double> NodeHalo::fetch(const std::vector<double>& own) const {
  if (!fetch_) return {};
  fetch_->take(own.data());
  return {fetch_->values(), fetch_->values() + nodes_.size()};
}

std::size_t NodeHalo::place_of(PetscInt node) const {
  return static_cast<std::size_t>(std::lower_bound(nodes_.begin(), nodes_.end(), node) - nodes_.begin());
}

}  // namespace stickslip
