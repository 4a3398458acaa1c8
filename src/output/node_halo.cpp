#include "output/node_halo.hpp"

#include <algorithm>
#include <set>

#include "base/local_copy.hpp"

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
  const auto size = static_cast<PetscInt>(nodes_.size());
  IsHandle from;
  SS_TRY(VecCreateMPIWithArray(nodes.comm, 1, count_, static_cast<PetscInt>(nodes.all), nullptr, own_.out()));
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, size, fetched_.out()));
  SS_TRY(ISCreateGeneral(PETSC_COMM_SELF, size, nodes_.data(), PETSC_COPY_VALUES, from.out()));
  SS_TRY(VecScatterCreate(own_, from, fetched_, nullptr, scatter_.out()));
}

std::vector<double> NodeHalo::fetch(const std::vector<double>& own) const {
  if (!scatter_) return {};
  SS_TRY(VecPlaceArray(own_, own.data()));
  SS_TRY(VecScatterBegin(scatter_, own_, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecScatterEnd(scatter_, own_, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecResetArray(own_));
  return local_values(fetched_);
}

std::size_t NodeHalo::place_of(PetscInt node) const {
  return static_cast<std::size_t>(std::lower_bound(nodes_.begin(), nodes_.end(), node) - nodes_.begin());
}

}  // namespace stickslip
