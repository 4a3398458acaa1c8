#include "stickslip/output/slab.hpp"

#include <algorithm>
#include <stdexcept>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "base/scatter.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

namespace stickslip {

namespace {

constexpr std::int64_t small_cell = largest_piece;  // nodes

}  // namespace

Slab Slab::even(MPI_Comm comm, std::int64_t nodes) {
  const std::int64_t rank = rank_in(comm), ranks = ranks_in(comm);
  Slab slab;
  slab.nodes_ = slab.cell_ = nodes;
  slab.first_ = nodes * rank / ranks;
  slab.owned_ = slab.kept_ = std::size_t(nodes * (rank + 1) / ranks - slab.first_);
  return slab;
}

Slab::Slab(const Model& model, std::int64_t nodes)
    : comm_(model.comm()), nodes_(nodes), cell_(model.scene().n), cells_(nodes / cell_),
      first_(model.first()), owned_(model.local()), kept_(owned_),
      gathered_(cells_ > 1 && cell_ <= small_cell) {
  const int ranks = ranks_in(comm_);
  if (ranks == 1 && rank_in(PETSC_COMM_WORLD) != 0) {  // each rank has the whole: rank 0 gives it
    owned_ = kept_ = 0;
    gathered_ = false;
  }
  if (!gathered_) return;
  counts_.resize(ranks);
  offsets_.assign(ranks, 0);
  const int own = int(owned_);
  SS_TRY(MPI_Allgather(&own, 1, MPI_INT, counts_.data(), 1, MPI_INT, comm_));
  for (std::size_t k = 1; k < counts_.size(); ++k) offsets_[k] = offsets_[k - 1] + counts_[k - 1];
  kept_ = rank_in(comm_) == 0 ? std::size_t(cell_) : 0;
}

void Slab::take(const double* own, int stride, std::vector<double>& to) const {
  std::vector<double> part(gathered_ ? owned_ : 0);
  const std::size_t before = to.size();
  to.resize(before + kept_);
  double* const into = gathered_ ? part.data() : to.data() + before;
  for (std::size_t i = 0; i < owned_; ++i) into[i] = own[i * std::size_t(stride)];
  if (gathered_)
    SS_TRY(MPI_Gatherv(part.data(), int(owned_), MPI_DOUBLE, to.data() + before, counts_.data(),
                       offsets_.data(), MPI_DOUBLE, 0, comm_));
}

void Slab::place(const double* values, const Put& put) const {
  if (kept_ == 0) return;
  if (!gathered_) {
    for (std::int64_t k = 0; k < cells_; ++k) put(k * cell_ + first_, std::int64_t(kept_), values);
    return;
  }
  std::vector<double> repeated(std::min(nodes_, small_cell));
  for (std::int64_t at = 0; at < nodes_; at += small_cell) {
    const std::int64_t count = std::min(small_cell, nodes_ - at);
    for (std::int64_t k = 0; k < count; ++k) repeated[k] = values[(at + k) % cell_];
    put(at, count, repeated.data());
  }
}

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
