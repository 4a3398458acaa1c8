#include "stickslip/output/gather.hpp"

#include <stdexcept>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

Gather::Gather(Vec like, PetscInt dof)
    : comm_(PetscObjectComm(reinterpret_cast<PetscObject>(like))), components_(dof) {
  const PetscInt* first;  // of each rank, and the length
  SS_TRY(VecGetOwnershipRanges(like, &first));
  const int ranks = ranks_in(comm_);
  first_.assign(first, first + ranks);
  for (int k = 0; k < ranks; ++k) count_.push_back(static_cast<int>(first[k + 1] - first[k]));
  size_ = static_cast<std::size_t>(first[ranks]);
}

const std::vector<std::vector<double>>& Gather::components(Vec v) {
  const std::vector<double> values = interleaved(v);
  const std::size_t dof = components_.size();
  for (std::size_t d = 0; d < dof; ++d) {
    components_[d].resize(values.size() / dof);
    for (std::size_t i = 0; i < components_[d].size(); ++i) components_[d][i] = values[i * dof + d];
  }
  return components_;
}

std::vector<double> Gather::interleaved(Vec v) {
  const int rank = rank_in(comm_);
  std::vector<double> out(rank == 0 ? size_ : 0);
  SS_TRY(MPI_Gatherv(Reading(v), count_[rank], MPI_DOUBLE, out.data(), count_.data(), first_.data(),
                     MPI_DOUBLE, 0, comm_));
  return out;
}

void Gather::spread(const std::vector<double>& values, Vec v) {
  on_root(comm_, [&] {
    if (values.size() != size_) throw std::logic_error("a vector of another length");
  });
  SS_TRY(MPI_Scatterv(values.data(), count_.data(), first_.data(), MPI_DOUBLE, Writing(v),
                      count_[rank_in(comm_)], MPI_DOUBLE, 0, comm_));
}

}  // namespace stickslip
