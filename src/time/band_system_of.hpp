// What a BandSystem is made of, for one half width of the stencil.
#pragma once

#include <array>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "time/band.hpp"
#include "time/piece_kernel.hpp"

namespace stickslip {

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
