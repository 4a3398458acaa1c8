#include "model/kernel.hpp"
#include "time/band_system_of.hpp"

#include <algorithm>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

template <int hw>
BandSystemOf<hw>::BandSystemOf(const BandLayout& layout)
    : layout_(layout), scene_(layout.model().scene()), outer_count_(layout.outer()),
      ranks_(ranks_in(layout.model().comm())), rank_(rank_in(layout.model().comm())),
      forward_constant_(kernel::compiled<decltype(forward_constant_)>(kernel::ForwardConstant<hw>{})),
      backward_constant_(kernel::compiled<decltype(backward_constant_)>(kernel::BackwardConstant<hw>{})),
      forward_(kernel::compiled<decltype(forward_)>(kernel::Forward<hw>{})),
      backward_(kernel::compiled<decltype(backward_)>(kernel::Backward<hw>{})) {
  groups_.resize(layout.tiles().size());
  if (layout.groups() > 0) root_ = build(0, layout.groups(), false);
  set_up_outer();
  set_up_gather();
}

// ---- the tree

static int middle_of(int lo, int hi) {
  int half = 1;
  while (2 * half < hi - lo) half *= 2;
  return lo + half;
}

// The tree of the groups lo to hi - 1. Stretches of one rank are leaves of the top; that rank alone goes on
// inside (`own`).
template <int hw>
int BandSystemOf<hw>::build(int lo, int hi, bool own) {
  const int speaker = layout_.speaker_of_group(lo);
  const bool of_one = speaker == layout_.speaker_of_group(hi - 1) && !layout_.is_shared(hi - 1);
  if (!own && (of_one || hi - lo == 1)) {
    const int node = of_one && speaker == rank_ ? build(lo, hi, true) : add_node(lo, hi);
    leaves_.push_back({node, speaker});
    return node;
  }
  if (hi - lo == 1) return add_node(lo, hi);
  const int mid = middle_of(lo, hi), left = build(lo, mid, own), right = build(mid, hi, own),
            node = add_node(lo, hi);
  tree_.back().left = left;
  tree_.back().right = right;
  (own ? own_ : top_).push_back(node);
  return node;
}

// That of a single group belongs to its tile, where this rank has it.
template <int hw>
int BandSystemOf<hw>::add_node(int lo, int hi) {
  const int node = int(tree_.size());
  tree_.emplace_back();
  const auto& tiles = layout_.tiles();
  const auto tile =
      std::find_if(tiles.begin(), tiles.end(), [&](const BandTile& t) { return t.group == lo; });
  if (hi - lo == 1 && tile != tiles.end()) groups_[tile - tiles.begin()].node = node;
  return node;
}

template <int hw>
void BandSystemOf<hw>::set_up_outer() {
  outer_d2_ = Dense::Zero(outer_count_, outer_count_);
  outer_b_.assign(outer_count_, 0.);
  outer_d_ = outer_x_ = outer_b_;
  outer_held_.assign(outer_count_, 0);
  for (int i = 0; i < outer_count_; ++i) {
    const PetscInt node = layout_.outer_node(i);
    outer_held_[i] = layout_.model().held(node) ? 1 : 0;
    for (const auto& [column, weight] : second_difference_row(scene_, node))
      for (int j = 0; j < outer_count_; ++j)
        if (layout_.outer_node(j) == column) outer_d2_(i, j) += weight;
  }
}

template <int hw>
void BandSystemOf<hw>::set_up_gather() {
  leaves_of_.assign(ranks_, 0);
  outer_of_ = leaves_of_;
  for (const Leaf& leaf : leaves_) ++leaves_of_[leaf.speaker];
  outer_of_[layout_.speaker_of_left()] += layout_.left_outer();
  outer_of_[layout_.speaker_of_right()] += outer_count_ - layout_.left_outer();
}

// ---- factors

template <int hw>
void BandSystemOf<hw>::set_coefficients(Factors& f, double a, double p) const {
  const kernel::Coefficients weights = kernel::coefficients_with(scene_, p);  // of p D2, which add up to 0
  f.a = a;
  f.p = p;
  f.middle = -weights.w[0];
  f.c[0] = 0;
  for (int k = 1; k <= hw; ++k) f.c[k] = -weights.w[k];
}

template <int hw>
bool BandSystemOf<hw>::choose(double a, double p, bool varies) {
  varies_ = varies;
  positive_ = true;
  if (varies) {
    set_coefficients(varying_, a, p);
    varying_.nodes.resize(tree_.size());
    return true;
  }
  constexpr std::size_t most_kept = 6;
  const auto found =
      std::find_if(kept_.begin(), kept_.end(), [&](const Factors& f) { return f.a == a && f.p == p; });
  if (found != kept_.end()) {
    std::rotate(kept_.begin(), found, found + 1);
  } else {
    if (kept_.size() < most_kept) kept_.emplace_back();
    std::rotate(kept_.begin(), kept_.end() - 1, kept_.end());
    make_constant(kept_.front(), a, p);
  }
  return kept_.front().positive;
}

template <int hw>
void BandSystemOf<hw>::make_constant(Factors& f, double a, double p) {
  set_coefficients(f, a, p);
  f.nodes.resize(tree_.size());
  bool positive = true;
  if (root_ >= 0) {
    const int least = layout_.least_rows() - hw;
    positive = kernel::make_table<hw>(a + f.middle, f.c, least + 1 + hw, f.table);
    const std::vector<double> d((least + 1 + hw) * lanes, a + f.middle), zero(d.size(), 0.);
    for (int k = 0; k < 2; ++k) {
      f.W[k] = kernel::right_of_table<hw>(f.table, f.c, least + k);
      kernel::Sides<hw> sides;
      forward_({d.data(), zero.data(), f.c, least + k}, &sides);
      positive = join_eight(&d[(least + k) * lanes], sides, f.c, f.separators[k], f.group[k]) && positive;
    }
  }
  for (std::size_t i = 0; i < groups_.size(); ++i) {
    if (groups_[i].node < 0) continue;
    Node& node = tree_[groups_[i].node];
    node.matrix = f.group[kind(layout_.tiles()[i])];
    std::fill(std::begin(node.d_behind), std::end(node.d_behind), a + f.middle);
  }
  std::fill(outer_d_.begin(), outer_d_.end(), a);
  positive = eliminate(own_) && positive;
  positive = gather(true, positive);
  f.positive = eliminate(top_) && positive;
  Dense M = outer_matrix();
  f.outer = Dense::Identity(outer_count_, outer_count_);
  f.positive = solve_dense(outer_count_, M.data(), outer_count_, f.outer.data()) && f.positive;
}

// d, sides: as forward() has them, d from the first row of the separators on.
template <int hw>
bool BandSystemOf<hw>::join_eight(const double* d, const kernel::Sides<hw>& sides, const double* c,
                                  Separator<hw>* separators, CondensedMatrix<hw>& whole) const {
  CondensedMatrix<hw> parts[lanes];
  for (int i = 0; i < hw; ++i)
    for (int j = 0; j < hw; ++j)
      for (int l = 0; l < lanes; ++l) {
        parts[l].LL.m[i][j] = sides.LL[i][j][l];
        parts[l].LR.m[i][j] = sides.LR[i][j][l];
        parts[l].RR.m[i][j] = sides.RR[i][j][l];
      }
  bool positive = sides.positive;
  for (const int s : order_of_eight) {
    double own[hw];
    for (int i = 0; i < hw; ++i) own[i] = d[i * lanes + s];
    CondensedMatrix<hw> both;
    positive = separators[s].eliminate(own, c, parts[s & (s + 1)], parts[s + 1], both) && positive;
    parts[s & (s + 1)] = both;
  }
  whole = parts[0];
  return positive;
}

// b: of the separators, from their first row on.
template <int hw>
void BandSystemOf<hw>::load_eight(const kernel::Sides<hw>& sides, const double* b,
                                  const Separator<hw>* separators, double (*own)[hw],
                                  CondensedLoad<hw>& whole) const {
  CondensedLoad<hw> parts[lanes];
  for (int i = 0; i < hw; ++i)
    for (int l = 0; l < lanes; ++l) {
      parts[l].L[i] = sides.L[i][l];
      parts[l].R[i] = sides.R[i][l];
      parts[l].behind[i] = b[i * lanes + l];
    }
  for (const int s : order_of_eight) {
    CondensedLoad<hw> both;
    separators[s].join(parts[s & (s + 1)], parts[s + 1], own[s], both);
    parts[s & (s + 1)] = both;
  }
  whole = parts[0];
}

template <int hw>
bool BandSystemOf<hw>::eliminate(const std::vector<int>& nodes) {
  Factors& f = varies_ ? varying_ : kept_.front();
  bool positive = true;
  for (const int i : nodes) {
    Node& node = tree_[i];
    const Node &left = tree_[node.left], &right = tree_[node.right];
    positive = f.nodes[i].eliminate(left.d_behind, f.c, left.matrix, right.matrix, node.matrix) && positive;
    std::copy(right.d_behind, right.d_behind + hw, node.d_behind);
  }
  return positive;
}

// ---- one solve

template <int hw>
void BandSystemOf<hw>::forward(std::size_t tile, const double* d, const double* b) {
  const BandTile& t = layout_.tiles()[tile];
  if (t.group < 0) {
    const auto at = t.begin == 0 ? 0 : layout_.left_outer();
    std::copy(b, b + t.count(), outer_b_.begin() + at);
    if (varies_) std::copy(d, d + t.count(), outer_d_.begin() + at);
    return;
  }
  Group& group = groups_[tile];
  Node& node = tree_[group.node];
  const int L = t.rows - hw;
  kernel::Sides<hw> sides;
  if (varies_) {
    alignas(64) double whole[kernel::most_rows * lanes];
    for (int i = 0; i < t.rows * lanes; ++i) whole[i] = d[i] + varying_.middle;
    forward_({whole, b, varying_.c, L}, &sides);
    positive_ = join_eight(whole + L * lanes, sides, varying_.c, group.separators, node.matrix) && positive_;
    for (int i = 0; i < hw; ++i) node.d_behind[i] = whole[(L + i) * lanes + lanes - 1];
    load_eight(sides, b + L * lanes, group.separators, group.b, node.load);
  } else {
    const Factors& f = kept_.front();
    forward_constant_({b, f.c, L, &f.table, f.W[kind(t)].data()}, &sides);
    load_eight(sides, b + L * lanes, f.separators[kind(t)], group.b, node.load);
  }
}

template <int hw>
void BandSystemOf<hw>::join(const std::vector<int>& nodes) {
  const Factors& f = varies_ ? varying_ : kept_.front();
  for (const int i : nodes) {
    Node& node = tree_[i];
    f.nodes[i].join(tree_[node.left].load, tree_[node.right].load, node.b, node.load);
  }
}

template <int hw>
void BandSystemOf<hw>::descend(const std::vector<int>& nodes) {
  const Factors& f = varies_ ? varying_ : kept_.front();
  for (auto i = nodes.rbegin(); i != nodes.rend(); ++i) {
    const Node& node = tree_[*i];
    Node &left = tree_[node.left], &right = tree_[node.right];
    f.nodes[*i].solve(node.b, node.x_left, node.x_right, left.x_right);
    std::copy(left.x_right, left.x_right + hw, right.x_left);
    std::copy(node.x_left, node.x_left + hw, left.x_left);
    std::copy(node.x_right, node.x_right + hw, right.x_right);
  }
}

template <int hw>
bool BandSystemOf<hw>::couple() {
  bool positive = positive_;
  if (varies_) positive = eliminate(own_) && positive;
  join(own_);
  positive = gather(varies_, positive);
  if (varies_) positive = eliminate(top_) && positive;
  join(top_);
  positive = solve_outer() && positive;
  if (root_ >= 0) {
    Node& root = tree_[root_];
    const int left = layout_.left_outer(), right = scene_.ring() ? 0 : left;
    for (int i = 0; i < hw; ++i) {
      root.x_left[i] = outer_x_[left - hw + i];
      root.x_right[i] = outer_x_[right + i];
    }
    descend(top_);
    descend(own_);
  }
  positive_ = true;
  return varies_ ? positive : kept_.front().positive;
}

// What is left of the outer nodes with everything else eliminated.
template <int hw>
Dense BandSystemOf<hw>::outer_matrix() const {
  const Factors& f = varies_ ? varying_ : kept_.front();
  Dense M = -f.p * outer_d2_;
  for (int i = 0; i < outer_count_; ++i) M(i, i) += outer_d_[i];
  if (root_ >= 0) {
    const CondensedMatrix<hw>& inside = tree_[root_].matrix;
    const int left = layout_.left_outer() - hw, right = scene_.ring() ? 0 : left + hw;
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j) {
        M(left + i, left + j) += inside.LL.m[i][j];
        M(right + i, right + j) += inside.RR.m[i][j];
        M(left + i, right + j) += inside.LR.m[i][j];
        M(right + j, left + i) += inside.LR.m[i][j];
      }
  }
  for (int i = 0; i < outer_count_; ++i)
    if (outer_held_[i]) M.row(i) = Dense::Identity(outer_count_, outer_count_).row(i);
  return M;
}

// Elimination without exchange of rows, whose pivots tell whether a matrix is positive definite; x = b at
// first. Where one is not positive nothing is done.
static bool solve_positive(Dense a, std::vector<double>& x) {
  const int n = int(a.rows());
  std::vector<double> y = x;
  for (int k = 0; k < n; ++k) {
    if (!(a(k, k) > 0)) return false;
    for (int i = k + 1; i < n; ++i) {
      const double factor = a(i, k) / a(k, k);
      if (factor == 0) continue;
      for (int j = k + 1; j < n; ++j) a(i, j) -= factor * a(k, j);
      y[i] -= factor * y[k];
    }
  }
  for (int k = n - 1; k >= 0; --k) {
    for (int j = k + 1; j < n; ++j) y[k] -= a(k, j) * y[j];
    y[k] /= a(k, k);
  }
  x = y;
  return true;
}

template <int hw>
bool BandSystemOf<hw>::solve_outer() {
  std::vector<double> b = outer_b_;
  if (root_ >= 0) {
    const CondensedLoad<hw>& inside = tree_[root_].load;
    const int left = layout_.left_outer() - hw, right = scene_.ring() ? 0 : left + hw;
    for (int i = 0; i < hw; ++i) {
      if (!outer_held_[left + i]) b[left + i] += inside.L[i];
      if (!outer_held_[right + i]) b[right + i] += inside.R[i];
    }
  }
  if (varies_) {
    Dense M = outer_matrix();
    outer_x_ = b;
    if (solve_positive(M, outer_x_)) return true;
    (void)solve_dense(outer_count_, M.data(), 1, outer_x_.data());
    return false;
  }
  const Dense& inverse = kept_.front().outer;
  for (int i = 0; i < outer_count_; ++i) {
    double sum = 0;
    for (int j = 0; j < outer_count_; ++j) sum += inverse(i, j) * b[j];
    outer_x_[i] = sum;
  }
  return true;
}

template <int hw>
void BandSystemOf<hw>::backward(std::size_t tile, const double* d, const double* b, double* x) {
  const BandTile& t = layout_.tiles()[tile];
  if (t.group < 0) {
    const auto from = outer_x_.begin() + (t.begin == 0 ? 0 : layout_.left_outer());
    std::copy(from, from + t.count(), x);
    return;
  }
  const Group& group = groups_[tile];
  const Node& node = tree_[group.node];
  const Factors& f = varies_ ? varying_ : kept_.front();
  const Separator<hw>* const separators = varies_ ? group.separators : f.separators[kind(t)];
  double ends[lanes + 1][hw];  // of the separators: before piece 0, behind piece 0, ...
  std::copy(node.x_left, node.x_left + hw, ends[0]);
  std::copy(node.x_right, node.x_right + hw, ends[lanes]);
  for (auto s = order_of_eight.rbegin(); s != order_of_eight.rend(); ++s) {
    const int i = *s, left = i & (i + 1), right = i + 1 + ((i + 1) & -(i + 1));
    separators[i].solve(group.b[i], ends[left], ends[right], ends[i + 1]);
  }
  alignas(64) double given_left[hw * lanes], given_right[hw * lanes];
  for (int k = 0; k < hw; ++k)
    for (int l = 0; l < lanes; ++l) {
      given_left[k * lanes + l] = ends[l][k];
      given_right[k * lanes + l] = ends[l + 1][k];
    }
  const int L = t.rows - hw;
  if (varies_) {
    alignas(64) double whole[kernel::most_rows * lanes];
    for (int i = 0; i < t.rows * lanes; ++i) whole[i] = d[i] + f.middle;
    backward_({whole, b, f.c, L}, given_left, given_right, x);
  } else {
    backward_constant_({b, f.c, L, &f.table, nullptr}, given_left, given_right, x);
  }
  std::copy(given_right, given_right + hw * lanes, x + L * lanes);
}

// ---- between ranks

// Walks over all numbers that the ranks tell each other, in their order; body(rank, a, count) for each piece
// of them. Returns the conjunction of the flags.
template <int hw>
bool BandSystemOf<hw>::gather(bool with_matrices, bool flag) {
  if (ranks_ == 1) return flag;
  const int of_load = 3 * hw, of_matrix = with_matrices ? 3 * hw * hw + hw : 0,
            of_outer = with_matrices ? 2 : 1;
  std::vector<int> counts, starts;
  int total = 0;
  for (int r = 0; r < ranks_; ++r) {
    starts.push_back(total);
    counts.push_back(1 + leaves_of_[r] * (of_load + of_matrix) + outer_of_[r] * of_outer);
    total += counts.back();
  }
  const auto walk = [&](int rank, double* at, bool into) {
    const auto move = [&](double* own, int count) {
      if (into)
        std::copy(own, own + count, at);
      else
        std::copy(at, at + count, own);
      at += count;
    };
    double as_number = flag;
    move(&as_number, 1);
    flag = flag && as_number != 0;
    for (const Leaf& leaf : leaves_) {
      if (leaf.speaker != rank) continue;
      Node& node = tree_[leaf.node];
      move(node.load.L, hw);
      move(node.load.R, hw);
      move(node.load.behind, hw);
      if (!with_matrices) continue;
      for (Block<hw>* block : {&node.matrix.LL, &node.matrix.LR, &node.matrix.RR})
        move(&block->m[0][0], hw * hw);
      move(node.d_behind, hw);
    }
    const int left = layout_.left_outer();
    for (std::vector<double>* own : {&outer_b_, &outer_d_}) {
      if (own == &outer_d_ && !with_matrices) continue;
      if (rank == layout_.speaker_of_left()) move(own->data(), left);
      if (rank == layout_.speaker_of_right()) move(own->data() + left, outer_count_ - left);
    }
  };
  sent_.resize(counts[rank_]);
  received_.resize(total);
  walk(rank_, sent_.data(), true);
  SS_TRY(MPI_Allgatherv(sent_.data(), counts[rank_], MPI_DOUBLE, received_.data(), counts.data(),
                        starts.data(), MPI_DOUBLE, layout_.model().comm()));
  for (int r = 0; r < ranks_; ++r) walk(r, received_.data() + starts[r], false);
  return flag;
}

std::unique_ptr<BandSystem> BandSystem::make(const BandLayout& layout) {
  std::unique_ptr<BandSystem> system;
  kernel::for_half_width(layout.model().scene().order / 2,
                         [&](auto hw) { system = std::make_unique<BandSystemOf<hw>>(layout); });
  return system;
}

}  // namespace stickslip
