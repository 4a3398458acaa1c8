#include "stickslip/base/node_fetch.hpp"

#include <algorithm>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

NodeFetch::NodeFetch(const Layout& l, int kept, const std::vector<PetscInt>& nodes)
    : dof_(l.dof), kept_(kept), values_(nodes.size() * std::size_t(kept)) {
  const auto size = PetscInt(values_.size());
  SS_TRY(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, size, values_.data(), fetched_.out()));
  if (ranks_in(l.comm) == 1) {  // a scatter would take longer over its types than over the values
    nodes_ = nodes;
    return;
  }
  IsHandle from;
  if (kept == dof_) {
    SS_TRY(ISCreateBlock(PETSC_COMM_SELF, dof_, PetscInt(nodes.size()), nodes.data(), PETSC_COPY_VALUES,
                         from.out()));
  } else {
    std::vector<PetscInt> entries;
    for (const PetscInt node : nodes)
      for (int d = 0; d < kept; ++d) entries.push_back(node * dof_ + d);
    SS_TRY(ISCreateGeneral(PETSC_COMM_SELF, size, entries.data(), PETSC_COPY_VALUES, from.out()));
  }
  SS_TRY(VecCreateMPIWithArray(l.comm, dof_, l.local * dof_, l.all * dof_, nullptr, own_.out()));
  SS_TRY(VecScatterCreate(own_, from, fetched_, nullptr, scatter_.out()));
}

void NodeFetch::begin(const double* own) const {
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    std::copy_n(own + nodes_[i] * dof_, kept_, &values_[i * std::size_t(kept_)]);
  if (!scatter_) return;
  SS_TRY(VecPlaceArray(own_, own));
  SS_TRY(VecScatterBegin(scatter_, own_, fetched_, INSERT_VALUES, SCATTER_FORWARD));
}

void NodeFetch::end() const {
  if (!scatter_) return;
  SS_TRY(VecScatterEnd(scatter_, own_, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecResetArray(own_));
}

void NodeFetch::take(Vec u) const { take(Reading(u)); }

}  // namespace stickslip
