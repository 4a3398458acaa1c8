// What a BandSystem is made of, for one half width of the stencil.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "time/band_system.hpp"
#include "time/piece_kernel.hpp"
#include "time/separators.hpp"

namespace stickslip {

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
