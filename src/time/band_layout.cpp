#include "time/band_layout.hpp"

#include <algorithm>

#include "base/broadcast.hpp"
#include "stickslip/base/error.hpp"
#include "time/piece_kernel.hpp"

namespace stickslip {

namespace {
constexpr int usual_rows = 64;  // of a piece: 512 nodes a tile
}  // namespace

BandLayout::BandLayout(const Model& model)
    : model_(model), half_width_(model.scene().order / 2), dof_(model.dof()), n_(model.scene().n) {
  first_of_rank_.resize(ranks_in(model.comm()));
  const PetscInt first = model.first();
  SS_TRY(MPI_Allgather(&first, 1, MPIU_INT, first_of_rank_.data(), 1, MPIU_INT, model.comm()));
  cut();
  choose_tiles();
  set_up_scatter();
}

void BandLayout::cut() {
  const bool ring = model_.scene().ring();
  const PetscInt hw = half_width_, ends = ring ? hw : 4 * hw, in_pieces = n_ - ends + hw;
  const PetscInt rows = in_pieces / kernel::lanes;
  if (in_pieces < 0 || rows < 2 * hw) {
    left_ = int(n_);
    return;
  }
  groups_ = int(std::max(PetscInt(1), (rows + usual_rows / 2) / usual_rows));
  least_rows_ = int(rows / groups_);
  longer_ = int(rows % groups_);
  const int rest = int(in_pieces % kernel::lanes);
  left_ = ring ? int(hw) + rest : int(2 * hw);
  right_ = ring ? 0 : int(2 * hw) + rest;
}

PetscInt BandLayout::begin_of(int group) const {
  return left_ + kernel::lanes * (PetscInt(group) * least_rows_ + std::min(group, longer_));
}

int BandLayout::rank_of(PetscInt node) const {
  const auto above = std::upper_bound(first_of_rank_.begin(), first_of_rank_.end(), node);
  return int(above - first_of_rank_.begin()) - 1;
}

bool BandLayout::is_shared(int group) const {
  const PetscInt begin = begin_of(group),
                 end = begin_of(group + 1) - (group + 1 == groups_ ? half_width_ : 0);
  return rank_of(begin) != rank_of(end - 1);
}

void BandLayout::choose_tiles() {
  const PetscInt first = model_.first(), end = first + model_.local();
  const auto add = [&](PetscInt begin, int rows, int lanes, int group) {
    const PetscInt own_count =
        PetscInt(rows) * lanes - (group >= 0 && group + 1 == groups_ ? half_width_ : 0);
    if (rows == 0 || begin >= end || begin + own_count <= first) return;
    tiles_.push_back({begin, rows, lanes, size_, group});
    size_ += (PetscInt(rows) * lanes + kernel::lanes - 1) / kernel::lanes * kernel::lanes;
  };
  add(0, left_, 1, -1);
  // those in between that can hold a node of this rank
  const auto guess = [&](PetscInt node) {
    return groups_ == 0 ? 0 : int(std::max(PetscInt(0), node - left_) / (kernel::lanes * (least_rows_ + 1)));
  };
  for (int g = guess(first); g < groups_ && begin_of(g) < end; ++g)
    add(begin_of(g), rows_of(g), kernel::lanes, g);
  add(n_ - right_, right_, 1, -1);
}

void BandLayout::set_up_scatter() {
  const PetscInt first = model_.first(), local = model_.local();
  const bool ring = model_.scene().ring();
  PetscInt low = 0, high = local;
  for (const BandTile& t : tiles_) {
    low = std::min(low, t.begin - first - half_width_);
    high = std::max(high, t.begin - first + t.count() + half_width_);
  }
  if (!ring) {
    low = std::max(low, -first);
    high = std::min(high, n_ - first);
  }
  left_halo_ = -low;
  right_halo_ = high - local;
  PetscInt most = left_halo_ + right_halo_;
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPIU_INT, MPI_MAX, model_.comm()));
  if (most == 0) return;
  std::vector<PetscInt> nodes;
  for (PetscInt i = low; i < 0; ++i) nodes.push_back(wrapped(first + i));
  for (PetscInt i = local; i < high; ++i) nodes.push_back(wrapped(first + i));
  const PetscInt count = nodes.size();
  const VecHandle pattern = model_.create_vector();
  SS_TRY(VecCreateSeq(PETSC_COMM_SELF, count * dof_, fetched_.out()));
  IsHandle from;
  SS_TRY(ISCreateBlock(model_.comm(), dof_, count, nodes.data(), PETSC_COPY_VALUES, from.out()));
  SS_TRY(VecScatterCreate(pattern, from, fetched_, nullptr, scatter_.out()));
}

void BandLayout::fetch(Vec u) const {
  if (!scatter_) return;
  SS_TRY(VecScatterBegin(scatter_, u, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  SS_TRY(VecScatterEnd(scatter_, u, fetched_, INSERT_VALUES, SCATTER_FORWARD));
  halo_.emplace(fetched_);
}

void BandLayout::end_fetch() const { halo_.reset(); }

void BandLayout::read(const double* own, int d, PetscInt i, PetscInt count, double* into) const {
  const PetscInt local = model_.local();
  for (PetscInt j = 0; j < count; ++j) {
    const PetscInt k = i + j;
    into[j] = k < 0        ? (*halo_)[(k + left_halo_) * dof_ + d]
              : k >= local ? (*halo_)[(left_halo_ + k - local) * dof_ + d]
                           : own[k * dof_ + d];
  }
}

PetscInt BandLayout::local(const BandTile& t) const { return t.begin - model_.first(); }

void BandLayout::own_range(const BandTile& t, PetscInt& begin, PetscInt& end) const {
  const PetscInt count = t.count() - (t.group >= 0 && t.group + 1 == groups_ ? half_width_ : 0), i = local(t);
  begin = std::max(PetscInt(0), -i);
  end = std::min(count, model_.local() - i);
}

void BandLayout::load(const BandTile& t, const double* own, int d, double* into) const {
  const PetscInt i = local(t);
  const bool inside = i >= 0 && i + t.count() <= model_.local();
  std::vector<double> line;
  const double* from = own + i * dof_ + d;
  PetscInt stride = dof_;
  if (!inside) {
    line.resize(t.count());
    read(own, d, i, t.count(), line.data());
    from = line.data();
    stride = 1;
  }
  if (t.lanes == 1) {
    for (PetscInt j = 0; j < t.count(); ++j) into[j] = from[j * stride];
    return;
  }
  for (int r = 0; r < t.rows; ++r)
    for (int l = 0; l < kernel::lanes; ++l) into[r * kernel::lanes + l] = from[(l * t.rows + r) * stride];
}

void BandLayout::store(const BandTile& t, const double* from, int d, double* own) const {
  PetscInt begin, end;
  own_range(t, begin, end);
  double* const into = own + local(t) * dof_ + d;
  if (begin == 0 && end == t.count() && t.lanes > 1) {
    for (int r = 0; r < t.rows; ++r)
      for (int l = 0; l < kernel::lanes; ++l) into[(l * t.rows + r) * dof_] = from[r * kernel::lanes + l];
    return;
  }
  for (PetscInt j = begin; j < end; ++j) into[j * dof_] = from[t.place(j)];
}

}  // namespace stickslip
