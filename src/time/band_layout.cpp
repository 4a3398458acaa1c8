#include "time/band.hpp"

#include <algorithm>
#include <cmath>

#include "numerics/elementary.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"

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
  set_up_fetch();
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

void BandLayout::set_up_fetch() {
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
  fetch_.emplace(NodeFetch::Layout{model_.comm(), local, n_, dof_}, dof_, nodes);
}

void BandLayout::read(const double* own, int d, PetscInt i, PetscInt count, double* into) const {
  const PetscInt local = model_.local();
  const double* const halo = fetch_ ? fetch_->values() : nullptr;
  for (PetscInt j = 0; j < count; ++j) {
    const PetscInt k = i + j;
    into[j] = k < 0        ? halo[(k + left_halo_) * dof_ + d]
              : k >= local ? halo[(left_halo_ + k - local) * dof_ + d]
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

ImexColumns::ImexColumns(const BandLayout& layout, const StageProgram& method, Implicit implicit)
    : dof_(layout.model().dof()),
      explicit_eta_(-layout.model().scene().s_delta() / layout.model().scene().A()),
      stride_(layout.size() + 8) {  // so that columns do not meet in the same lines of a cache
  int columns = 0;
  const std::size_t s = method.stages;
  for (int d = 0; d < dof_; ++d) {
    u_[d] = columns++;
    known_[d] = columns++;
  }
  stage_[0] = columns++;
  if (dof_ == 3) stage_[1] = columns++;
  d2_ = columns++;
  const bool wave = implicit == Implicit::wave;
  right_side_ = columns++;
  if (!wave) change_ = columns++;
  for (std::size_t i = 0; i < s; ++i)
    for (const Kind kind : {of_implicit, of_explicit}) {
      std::array<int, 3> own{-1, -1, -1};
      for (int d = 0; d < dof_; ++d) {
        const bool acts = kind == of_implicit ? !(wave && d == 2) : wave && d != 1;
        if (acts) own[d] = columns++;
      }
      slopes_[kind].push_back(own);
    }
  work_ = std::make_unique<double[]>(columns * std::size_t(stride_));
  PetscInt longest = 0;
  for (const BandTile& t : layout.tiles()) longest = std::max(longest, t.count());
  zeros_.assign(longest, 0.);

  sums_.resize(s);
  const double* const last = &method.At[(s - 1) * s];
  const bool ends_at_last = method.ends_at_last_stage();
  const std::vector<double> lacking = method.lacking(), f = method.error_of_f(), g = method.error_of_g();
  std::vector<double> of_last(s, 0.), none(s, 0.);
  of_last[s - 1] = last[s - 1];
  for (int d = 0; d < dof_; ++d) {
    for (std::size_t i = 0; i < s; ++i) {
      sums_[i][d].base = d == 0 ? -1 : u_[d];
      add(sums_[i][d], d, &method.At[i * s], &method.A[i * s], int(i));
    }
    Sum& solution = solution_[d];
    solution.base = !ends_at_last ? u_[d] : d == 1 ? known_[1] : stage_[d == 0 ? 0 : 1];
    add(solution, d,
        !ends_at_last ? method.bt.data()
        : d == 1          ? of_last.data()
                          : none.data(),
        lacking.data(), int(s));
    add(error_[d], d, g.data(), f.data(), int(f.size()));
  }
}

void ImexColumns::add(Sum& sum, int d, const double* implicit_weights, const double* explicit_weights,
                      int count) const {
  for (int j = 0; j < count; ++j)
    for (const Kind kind : {of_implicit, of_explicit}) {
      const bool of_psi = kind == of_explicit && d == 1;
      const double factor = of_psi ? explicit_eta_ : 1;
      const int column = slopes_[kind][j][of_psi ? 0 : d];
      if (column < 0 || factor == 0) continue;
      sum.slopes.add(column, (kind == of_implicit ? implicit_weights : explicit_weights)[j], factor);
    }
}

void ImexColumns::take(const BandTile& t, const Sum& sum, double dt, double* into) const {
  add_(sum.base < 0 ? zeros_.data() : at(t, sum.base), sum.slopes, dt, t.count(), into,
       [&](int column) { return at(t, column); });
}

void ImexColumns::sum_known(const BandTile& t, int i, double dt) const {
  for (int d = 0; d < dof_; ++d) take(t, sums_[i][d], dt, known(t, d));
}
void ImexColumns::sum_solution(const BandTile& t, int d, double dt, double* into) const {
  take(t, solution_[d], dt, into);
}
void ImexColumns::sum_error(const BandTile& t, int d, double dt, double* into) const {
  take(t, error_[d], dt, into);
}

}  // namespace stickslip
