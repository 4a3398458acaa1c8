// Banded elimination of eight pieces of a grid at once, one in each lane of a vector.
//
// A piece is L nodes with half_width nodes, a separator, on either side that are given. Its matrix has the
// diagonal d and the same c[k] beside it at distance k everywhere: that of (diag - p D2). It is taken apart
// as L D L^T without exchange of rows; where every pivot is positive the matrix is positive definite, and the
// other way round. A node that is given has a diagonal so large that its neighbours cannot move it.
//
// Row r of lane l stands at [8 r + l]. Only + - * / in the order written, so that a piece's result has the
// same bits whatever instructions run.
#pragma once

#include <petscsys.h>

#include <algorithm>
#include <array>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "numerics/elementary.hpp"
#include "time/band.hpp"

namespace stickslip::kernel {

constexpr int most_rows = 128;  // of a piece with its separator

// What the nodes inside mean to the separators (Schur complement and right-hand side), in lanes: LL, LR, RR
// row by row.
template <int half_width>
struct Sides {
  double LL[half_width][half_width][lanes], LR[half_width][half_width][lanes],
      RR[half_width][half_width][lanes];
  double L[half_width][lanes], R[half_width][lanes];
  bool positive;  // all pivots are
};

struct Piece {
  const double *d, *b;  // rows 0 .. L - 1; b: right-hand side
  const double* c;      // c[1..half_width]
  int L;
};

// The factors of a piece of one diagonal everywhere. Their rows are those of any shorter piece too.
struct PieceTable {
  std::vector<double> l, inverse;  // l[r half_width + k - 1] couples rows r and r - k; 1/pivot
  // V[r half_width + s]: what row r means to node s of the left separator, over the pivot
  std::vector<double> V;
};
struct ConstantPiece {
  const double* b;
  const double* c;
  int L;
  const PieceTable* table;
  const double* W;  // of this L: W[j half_width + t], row L - 1 - j to node t of the right separator
};

// What row r of the given nodes at either side takes from the right-hand side.
template <int half_width>
inline void subtract_given(Lanes& v, int r, int L, const double* c, const double* left, const double* right) {
  for (int s = r; s < half_width; ++s) v -= c[r + half_width - s] * *lanes_at(left + s * lanes);
  for (int t = 0; t < half_width; ++t)
    if (L + t - r <= half_width) v -= c[L + t - r] * *lanes_at(right + t * lanes);
}

// The sides' right-hand sides alone.
template <int half_width>
struct ForwardConstant {
  void operator()(const ConstantPiece& p, Sides<half_width>* into) const {
    Sides<half_width>& sides = *into;
    const double *const l = p.table->l.data(), *const V = p.table->V.data();
    Lanes y[half_width] = {}, left[half_width] = {}, right[half_width] = {};  // y[k - 1]: of row r - k
    for (int r = 0; r < p.L; ++r) {
      Lanes v = *lanes_at(p.b + lanes * r);
      for (int k = half_width; k >= 1; --k) v -= l[r * half_width + k - 1] * y[k - 1];
      for (int k = half_width - 1; k >= 1; --k) y[k] = y[k - 1];
      y[0] = v;
      for (int s = 0; s < half_width; ++s) left[s] -= V[r * half_width + s] * v;
    }
    for (int j = 0; j < half_width; ++j)
      for (int t = 0; t < half_width; ++t) right[t] -= p.W[j * half_width + t] * y[j];
    for (int s = 0; s < half_width; ++s) {
      *lanes_at(sides.L[s]) = left[s];
      *lanes_at(sides.R[s]) = right[s];
    }
  }
};

// x inside, from those of the separators (half_width rows of lanes each).
template <int half_width>
struct BackwardConstant {
  void operator()(const ConstantPiece& p, const double* given_left, const double* given_right,
                  double* x) const {
    const double *const l = p.table->l.data(), *const inverse = p.table->inverse.data();
    Lanes y[half_width] = {};
    for (int r = 0; r < p.L; ++r) {
      Lanes v = *lanes_at(p.b + lanes * r);
      if (r < half_width || r >= p.L - half_width)
        subtract_given<half_width>(v, r, p.L, p.c, given_left, given_right);
      for (int k = half_width; k >= 1; --k) v -= l[r * half_width + k - 1] * y[k - 1];
      for (int k = half_width - 1; k >= 1; --k) y[k] = y[k - 1];
      y[0] = v;
      *lanes_at(x + lanes * r) = v * inverse[r];
    }
    Lanes behind[half_width] = {};
    for (int r = p.L - 1; r >= 0; --r) {
      Lanes v = *lanes_at(x + lanes * r);
      for (int k = half_width; k >= 1; --k) v -= l[(r + k) * half_width + k - 1] * behind[k - 1];
      for (int k = half_width - 1; k >= 1; --k) behind[k] = behind[k - 1];
      behind[0] = v;
      *lanes_at(x + lanes * r) = v;
    }
  }
};

// One row of L D L^T after the other, of diagonals that vary.
template <int half_width>
struct RowFactor {
  Lanes l[half_width] = {};  // of this row
  Lanes inverse{};
  Lanes before[half_width][half_width] = {};  // l of the rows r - 1, r - 2, ...
  Lanes inverse_before[half_width] = {};
  Lanes least;  // pivot so far

  explicit RowFactor(const Lanes& large) : least(large) {}

  void next(int r, const LanesInMemory* d, const double* c) {
    Lanes t[half_width + 1] = {}, pivot = *d;
    for (int k = half_width; k >= 1; --k) {
      if (r < k) continue;
      Lanes sum = c[k] - Lanes{};
      for (int j = half_width; j > k; --j) sum -= t[j] * before[k - 1][j - k - 1];
      t[k] = sum;
      l[k - 1] = sum * inverse_before[k - 1];
      pivot -= sum * l[k - 1];
    }
    inverse = 1. / pivot;
    least = pivot < least ? pivot : least;
  }
  // To be called when the row is done with.
  void shift() {
    for (int k = half_width - 1; k >= 1; --k) {
      for (int j = 0; j < half_width; ++j) before[k][j] = before[k - 1][j];
      inverse_before[k] = inverse_before[k - 1];
    }
    for (int j = 0; j < half_width; ++j) before[0][j] = l[j];
    inverse_before[0] = inverse;
  }
  bool positive() const {
    bool all = true;
    for (int i = 0; i < lanes; ++i) all = all && least[i] > 0;
    return all;
  }
};

template <int half_width>
struct Forward {
  static constexpr int hw = half_width;

  void operator()(const Piece& p, Sides<hw>* into) const {
    Sides<hw>& sides = *into;
    RowFactor<hw> row(1e300 - Lanes{});
    Lanes y[hw] = {}, V[hw][hw] = {}, W[hw][hw] = {};  // of the rows before: [k - 1]
    Lanes LL[hw][hw] = {}, LR[hw][hw] = {}, RR[hw][hw] = {}, left[hw] = {}, right[hw] = {};
    for (int r = 0; r < p.L; ++r) {
      row.next(r, lanes_at(p.d + lanes * r), p.c);
      Lanes value = *lanes_at(p.b + lanes * r), v[hw], w[hw];
      for (int k = hw; k >= 1; --k) value -= row.l[k - 1] * y[k - 1];
      for (int s = 0; s < hw; ++s) {
        v[s] = (r <= s ? p.c[r + hw - s] : 0.) - Lanes{};
        for (int k = hw; k >= 1; --k) v[s] -= row.l[k - 1] * V[k - 1][s];
      }
      const Lanes scaled = value * row.inverse;
      for (int s = 0; s < hw; ++s) {
        left[s] -= v[s] * scaled;
        const Lanes over = v[s] * row.inverse;
        for (int i = 0; i <= s; ++i) LL[s][i] -= over * v[i];
      }
      if (r >= p.L - hw) {
        for (int t = 0; t < hw; ++t) {
          w[t] = (p.L + t - r <= hw ? p.c[p.L + t - r] : 0.) - Lanes{};
          for (int k = hw; k >= 1; --k) w[t] -= row.l[k - 1] * W[k - 1][t];
        }
        for (int t = 0; t < hw; ++t) {
          right[t] -= w[t] * scaled;
          const Lanes over = w[t] * row.inverse;
          for (int i = 0; i <= t; ++i) RR[t][i] -= over * w[i];
          for (int s = 0; s < hw; ++s) LR[s][t] -= over * v[s];
        }
        push(W, w);
      }
      for (int k = hw - 1; k >= 1; --k) y[k] = y[k - 1];
      y[0] = value;
      push(V, v);
      row.shift();
    }
    for (int i = 0; i < hw; ++i) {
      for (int j = 0; j < hw; ++j) {
        *lanes_at(sides.LL[i][j]) = j <= i ? LL[i][j] : LL[j][i];
        *lanes_at(sides.RR[i][j]) = j <= i ? RR[i][j] : RR[j][i];
        *lanes_at(sides.LR[i][j]) = LR[i][j];
      }
      *lanes_at(sides.L[i]) = left[i];
      *lanes_at(sides.R[i]) = right[i];
    }
    sides.positive = row.positive();
  }

 private:
  static void push(Lanes (&rows)[hw][hw], const Lanes (&row)[hw]) {
    for (int k = hw - 1; k >= 1; --k)
      for (int j = 0; j < hw; ++j) rows[k][j] = rows[k - 1][j];
    for (int j = 0; j < hw; ++j) rows[0][j] = row[j];
  }
};

template <int half_width>
struct Backward {
  static constexpr int hw = half_width;

  void operator()(const Piece& p, const double* given_left, const double* given_right, double* x) const {
    RowFactor<hw> row(1e300 - Lanes{});
    Lanes y[hw] = {};
    alignas(64) double l[(most_rows + hw) * hw * lanes];
    for (int r = 0; r < p.L; ++r) {
      row.next(r, lanes_at(p.d + lanes * r), p.c);
      Lanes v = *lanes_at(p.b + lanes * r);
      if (r < hw || r >= p.L - hw) subtract_given<hw>(v, r, p.L, p.c, given_left, given_right);
      for (int k = hw; k >= 1; --k) v -= row.l[k - 1] * y[k - 1];
      for (int k = hw - 1; k >= 1; --k) y[k] = y[k - 1];
      y[0] = v;
      *lanes_at(x + lanes * r) = v * row.inverse;
      for (int k = 0; k < hw; ++k) *lanes_at(l + (r * hw + k) * lanes) = row.l[k];
      row.shift();
    }
    Lanes behind[hw] = {};
    for (int r = p.L - 1; r >= 0; --r) {
      Lanes v = *lanes_at(x + lanes * r);
      for (int k = hw; k >= 1; --k)
        if (r + k < p.L) v -= *lanes_at(l + ((r + k) * hw + k - 1) * lanes) * behind[k - 1];
      for (int k = hw - 1; k >= 1; --k) behind[k] = behind[k - 1];
      behind[0] = v;
      *lanes_at(x + lanes * r) = v;
    }
  }
};

// The table of pieces of up to `rows` rows, diagonal d; false where a pivot is not positive. W: see
// ConstantPiece.
template <int half_width>
bool make_table(double d, const double* c, int rows, PieceTable& table) {
  constexpr int hw = half_width;
  const auto count = std::size_t(rows) * hw;
  table.l.assign(count, 0);
  table.V.assign(count, 0);
  table.inverse.assign(rows, 0);
  bool positive = true;
  std::vector<double> V(count);  // not yet over the pivot
  for (int r = 0; r < rows; ++r) {
    double t[hw + 1] = {}, pivot = d;
    double* const l = &table.l[std::size_t(r) * hw];
    for (int k = std::min(hw, r); k >= 1; --k) {
      t[k] = c[k];
      for (int j = hw; j > k; --j) t[k] -= t[j] * table.l[std::size_t(r - k) * hw + std::size_t(j - k - 1)];
      l[k - 1] = t[k] * table.inverse[r - k];
      pivot -= t[k] * l[k - 1];
    }
    positive = positive && pivot > 0;
    table.inverse[r] = 1 / pivot;
    for (int s = 0; s < hw; ++s) {
      double v = r <= s ? c[r + hw - s] : 0;
      for (int k = std::min(hw, r); k >= 1; --k) v -= l[k - 1] * V[std::size_t(r - k) * hw + std::size_t(s)];
      V[r * hw + s] = v;
      table.V[r * hw + s] = v / pivot;
    }
  }
  return positive;
}

// W of pieces of L rows.
template <int half_width>
std::vector<double> right_of_table(const PieceTable& table, const double* c, int L) {
  constexpr int hw = half_width;
  std::vector<double> W(hw * hw, 0.), found(std::size_t(hw * hw));
  for (int r = L - hw; r < L; ++r)
    for (int t = 0; t < hw; ++t) {
      double w = L + t - r <= hw ? c[L + t - r] : 0;
      for (int k = std::min(hw, r - (L - hw)); k >= 1; --k)
        w -= table.l[r * hw + k - 1] * W[(L - 1 - (r - k)) * hw + t];
      W[(L - 1 - r) * hw + t] = w;
    }
  for (int j = 0; j < hw; ++j)
    for (int t = 0; t < hw; ++t) found[j * hw + t] = W[j * hw + t] * table.inverse[L - 1 - j];
  return found;
}

}  // namespace stickslip::kernel

namespace stickslip {

// What a BandSystem is made of, for one half width of the stencil.

// Small dense blocks of the nodes that separate stretches of a grid, and how two stretches become one.
template <int hw>
struct Block {
  double m[hw][hw];
};

// Of nodes whose inside is eliminated (static condensation): their part of the matrix of the separators at
// its ends, left and right.
template <int hw>
struct CondensedMatrix {
  Block<hw> LL, LR, RR;
};
// Its part of the right-hand side, and the right-hand side of the separator behind it.
template <int hw>
struct CondensedLoad {
  double L[hw], R[hw], behind[hw];
};

// The separator between two such, eliminated.
template <int hw>
struct Separator {
  Block<hw> inverse, from_left, from_right;  // S^-1; couplings of the ends with it, times S^-1

  // `d`: its diagonal, c[k]: beside it. False where a pivot is not positive.
  bool eliminate(const double* d, const double* c, const CondensedMatrix<hw>& left,
                 const CondensedMatrix<hw>& right, CondensedMatrix<hw>& both) {
    Block<hw> S;
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j)
        S.m[i][j] = (i == j ? d[i] : c[i < j ? j - i : i - j]) + (left.RR.m[i][j] + right.LL.m[i][j]);
    const bool positive = invert(S);
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j) {
        double of_left = 0, of_right = 0;
        for (int k = 0; k < hw; ++k) {
          of_left += left.LR.m[i][k] * inverse.m[k][j];
          of_right += right.LR.m[k][i] * inverse.m[k][j];
        }
        from_left.m[i][j] = of_left;
        from_right.m[i][j] = of_right;
      }
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j) {
        double ll = left.LL.m[i][j], rr = right.RR.m[i][j], lr = 0;
        for (int k = 0; k < hw; ++k) {
          ll -= from_left.m[i][k] * left.LR.m[j][k];
          rr -= from_right.m[i][k] * right.LR.m[k][j];
          lr -= from_left.m[i][k] * right.LR.m[k][j];
        }
        both.LL.m[i][j] = ll;
        both.RR.m[i][j] = rr;
        both.LR.m[i][j] = lr;
      }
    return positive;
  }

  // b: the separator's own right-hand side, which becomes that after elimination of both insides.
  void join(const CondensedLoad<hw>& left, const CondensedLoad<hw>& right, double* b,
            CondensedLoad<hw>& both) const {
    for (int i = 0; i < hw; ++i) b[i] = left.behind[i] + (left.R[i] + right.L[i]);
    for (int i = 0; i < hw; ++i) {
      double l = left.L[i], r = right.R[i];
      for (int k = 0; k < hw; ++k) {
        l -= from_left.m[i][k] * b[k];
        r -= from_right.m[i][k] * b[k];
      }
      both.L[i] = l;
      both.R[i] = r;
      both.behind[i] = right.behind[i];
    }
  }

  // x of the separator from those of the ends.
  void solve(const double* b, const double* x_left, const double* x_right, double* x) const {
    for (int i = 0; i < hw; ++i) {
      double sum = 0;
      for (int k = 0; k < hw; ++k)
        sum += inverse.m[i][k] * b[k] - from_left.m[k][i] * x_left[k] - from_right.m[k][i] * x_right[k];
      x[i] = sum;
    }
  }

 private:
  // inverse = S^-1 by elimination without exchange.
  bool invert(Block<hw>& S) {
    bool positive = true;
    for (int i = 0; i < hw; ++i)
      for (int j = 0; j < hw; ++j) inverse.m[i][j] = i == j;
    for (int k = 0; k < hw; ++k) {
      positive = positive && S.m[k][k] > 0;
      const double over = 1 / S.m[k][k];
      for (int j = 0; j < hw; ++j) {
        S.m[k][j] *= over;
        inverse.m[k][j] *= over;
      }
      for (int i = 0; i < hw; ++i) {
        if (i == k) continue;
        const double factor = S.m[i][k];
        for (int j = 0; j < hw; ++j) {
          S.m[i][j] -= factor * S.m[k][j];
          inverse.m[i][j] -= factor * inverse.m[k][j];
        }
      }
    }
    return positive;
  }
};

// Eight stretches side by side become one: the separator behind stretch i (i < 7) goes in the round in which
// the lowest zero of i in binary is met.
constexpr std::array<int, 7> order_of_eight = {0, 2, 4, 6, 1, 5, 3};

using kernel::lanes;
using Dense = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

template <int hw>
class BandSystemOf : public BandSystem {
 public:
  explicit BandSystemOf(const BandLayout& layout);

  bool choose(double a, double p, bool varies) override;
  void forward(std::size_t tile, const double* d, const double* b) override;
  bool couple() override;
  void backward(std::size_t tile, const double* d, const double* b, double* x) override;

 private:
  // A stretch of groups, whole or made of two.
  struct Node {
    int left = -1, right = -1;
    CondensedMatrix<hw> matrix;
    CondensedLoad<hw> load;
    double d_behind[hw];                    // the diagonal of the separator behind it
    double b[hw], x_left[hw], x_right[hw];  // of the separator in its middle; of those at its ends
  };
  struct Leaf {
    int node, speaker;
  };
  struct Group {  // of a tile
    int node = -1;
    Separator<hw> separators[lanes - 1];  // where the diagonal varies
    double b[lanes - 1][hw];
  };
  struct Factors {
    double a = 0, p = 0;
    bool positive = true;
    double c[hw + 1];
    double middle;  // -p w_0
    kernel::PieceTable table;
    std::vector<double> W[2];  // of pieces of the least rows, and of one more
    Separator<hw> separators[2][lanes - 1];
    CondensedMatrix<hw> group[2];
    std::vector<Separator<hw>> nodes;  // of the tree
    Dense outer;                       // the inverse of what is left
  };

  int build(int lo, int hi, bool own);
  int add_node(int lo, int hi);
  void set_up_outer();
  void set_up_gather();
  void set_coefficients(Factors& f, double a, double p) const;
  void make_constant(Factors& f, double a, double p);
  bool join_eight(const double* d, const kernel::Sides<hw>& sides, const double* c, Separator<hw>* separators,
                  CondensedMatrix<hw>& whole) const;
  void load_eight(const kernel::Sides<hw>& sides, const double* b, const Separator<hw>* separators,
                  double (*own)[hw], CondensedLoad<hw>& whole) const;
  bool eliminate(const std::vector<int>& nodes);
  void join(const std::vector<int>& nodes);
  void descend(const std::vector<int>& nodes);
  bool gather(bool with_matrices, bool flag);
  Dense outer_matrix() const;
  bool solve_outer();
  int kind(const BandTile& t) const { return t.rows - layout_.least_rows(); }

  const BandLayout& layout_;
  const Scene& scene_;
  std::vector<Node> tree_;
  int root_ = -1;
  std::vector<int> own_, top_;  // nodes of two stretches: of this rank; of several
  std::vector<Leaf> leaves_;    // of the top
  std::vector<Group> groups_;   // of the tiles
  int outer_count_;
  Dense outer_d2_;
  std::vector<double> outer_b_, outer_d_, outer_x_;
  std::vector<char> outer_held_;
  int ranks_, rank_;
  std::vector<int> leaves_of_, outer_of_;  // of every rank
  std::vector<double> sent_, received_;
  std::vector<Factors> kept_;  // constant, the last used first
  Factors varying_;
  bool varies_ = false, positive_ = true;  // positive_: of this rank's tiles, where the diagonal varies

  std::function<void(const kernel::ConstantPiece&, kernel::Sides<hw>*)> forward_constant_;
  std::function<void(const kernel::ConstantPiece&, const double*, const double*, double*)> backward_constant_;
  std::function<void(const kernel::Piece&, kernel::Sides<hw>*)> forward_;
  std::function<void(const kernel::Piece&, const double*, const double*, double*)> backward_;
};

}  // namespace stickslip
