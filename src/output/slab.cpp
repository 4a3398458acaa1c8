#include "stickslip/output/slab.hpp"

#include <algorithm>

#include "base/broadcast.hpp"
#include "base/scatter.hpp"
#include "stickslip/base/error.hpp"

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

}  // namespace stickslip
