#include "stickslip/output/slab.hpp"

#include <algorithm>

#include "base/broadcast.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

constexpr std::int64_t small_cell = 1 << 17;  // nodes: a megabyte a field

}  // namespace

Slab Slab::even(MPI_Comm comm, std::int64_t nodes) {
  const std::int64_t rank = rank_in(comm), ranks = ranks_in(comm);
  Slab slab;
  slab.nodes_ = slab.cell_ = nodes;
  slab.first_ = nodes * rank / ranks;
  slab.end_ = nodes * (rank + 1) / ranks;
  slab.owned_ = slab.kept_ = std::size_t(slab.end_ - slab.first_);
  return slab;
}

Slab::Slab(const Model& model, std::int64_t nodes)
    : comm_(model.comm()), nodes_(nodes), cell_(model.scene().n), cells_(nodes / cell_),
      first_(model.first()), end_(first_ + model.local()), owned_(model.local()), kept_(owned_),
      gathered_(cells_ > 1 && cell_ <= small_cell) {
  if (!gathered_) return;
  const int ranks = ranks_in(comm_);
  counts_.resize(ranks);
  offsets_.assign(ranks, 0);
  const int own = int(owned_);
  SS_TRY(MPI_Allgather(&own, 1, MPI_INT, counts_.data(), 1, MPI_INT, comm_));
  for (std::size_t k = 1; k < counts_.size(); ++k) offsets_[k] = offsets_[k - 1] + counts_[k - 1];
  kept_ = std::size_t(cell_);
  const std::int64_t rank = rank_in(PETSC_COMM_WORLD), all = ranks_in(PETSC_COMM_WORLD);
  first_ = nodes * rank / all;
  end_ = nodes * (rank + 1) / all;
}

void Slab::take(const double* own, int stride, std::vector<double>& to) const {
  const std::size_t before = to.size();
  to.resize(before + kept_);
  double* into = &to[before] + (gathered_ ? offsets_[rank_in(comm_)] : 0);
  for (std::size_t i = 0; i < owned_; ++i) into[i] = own[i * std::size_t(stride)];
  if (gathered_ && counts_.size() > 1)
    SS_TRY(MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, &to[before], counts_.data(), offsets_.data(),
                          MPI_DOUBLE, comm_));
}

void Slab::place(const double* values, const Put& put) const {
  if (!gathered_) {
    for (std::int64_t k = 0; k < cells_; ++k) put(k * cell_ + first_, end_ - first_, values);
    return;
  }
  std::vector<double> repeated(std::min(end_ - first_, small_cell));
  for (std::int64_t at = first_; at < end_; at += small_cell) {
    const std::int64_t count = std::min(small_cell, end_ - at);
    for (std::int64_t k = 0; k < count; ++k) repeated[k] = values[(at + k) % cell_];
    put(at, count, repeated.data());
  }
}

}  // namespace stickslip
