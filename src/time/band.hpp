// A grid cut for banded solves: groups of eight pieces, one in each lane of a vector, and a few outer nodes.
//
// The cuts follow from the grid alone, so that what is computed does not depend on the ranks, to the last
// bit. A rank works on every tile (a group, or outer nodes) that holds one of its nodes; a tile on the border
// of two ranks is worked on by both. On a ring the outer nodes are the first few; on a line they stand at
// both ends, with every row of D2 that an end changes. A piece is `rows` nodes, the last half_width of which
// separate it from the next one; behind the last piece of all these are outer nodes, which its tile holds a
// second time. A small grid has outer nodes only.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "model/kernel.hpp"
#include "model/loops.hpp"
#include "numerics/tableau.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/time/time.hpp"
#include "time/tiles.hpp"

namespace stickslip {

struct BandTile {
  PetscInt begin;   // first node
  int rows, lanes;  // node of lane l, row r: begin + l rows + r; outer nodes: lanes 1
  PetscInt at;      // place of its first node in columns: that of lane l, row r is at + lanes r + l
  int group;        // -1: outer nodes
  PetscInt count() const { return PetscInt(rows) * lanes; }
  PetscInt place(PetscInt i) const { return (i % rows) * lanes + i / rows; }  // of node begin + i, from `at`
};

class BandLayout {
 public:
  explicit BandLayout(const Model& model);
  BandLayout(const BandLayout&) = delete;
  BandLayout& operator=(const BandLayout&) = delete;

  const Model& model() const { return model_; }
  // that this rank works on, by their first nodes
  const std::vector<BandTile>& tiles() const { return tiles_; }
  PetscInt size() const { return size_; }  // of a column
  int groups() const { return groups_; }
  int rows_of(int group) const { return least_rows_ + (group < longer_ ? 1 : 0); }
  int least_rows() const { return least_rows_; }
  int left_outer() const { return left_; }
  int outer() const { return left_ + right_; }
  PetscInt outer_node(int i) const { return i < left_ ? i : n_ - right_ + (i - left_); }
  // The rank that speaks for a tile, and whether the tile holds nodes of others too.
  int speaker_of_group(int group) const { return rank_of(begin_of(group)); }
  bool is_shared(int group) const;
  int speaker_of_left() const { return 0; }
  int speaker_of_right() const { return right_ > 0 ? rank_of(n_ - right_) : 0; }

  // The nodes that this rank does not own, for the tiles and half_width nodes around them, from the array of
  // u, for what follows. Collective.
  void fetch(const double* own) const {
    if (fetch_) fetch_->take(own);
  }
  // Unknown d of `count` nodes from local node i on (counted from this rank's first); own: the array of u.
  void read(const double* own, int d, PetscInt i, PetscInt count, double* into) const;
  // Unknown d of the tile, in the order of columns, from the array of a Vec; and what this rank owns back to
  // one.
  void load(const BandTile& t, const double* own, int d, double* into) const;
  void store(const BandTile& t, const double* from, int d, double* own) const;
  // The nodes of the tile that this rank owns, each node in one tile: as numbers from its first one.
  void own_range(const BandTile& t, PetscInt& begin, PetscInt& end) const;
  // The number of the tile's first node as seen from this rank's first.
  PetscInt local(const BandTile& t) const;
  PetscInt wrapped(PetscInt node) const { return ((node % n_) + n_) % n_; }

 private:
  PetscInt begin_of(int group) const;
  int rank_of(PetscInt node) const;
  void cut();
  void choose_tiles();
  void set_up_fetch();

  const Model& model_;
  int half_width_, dof_;
  PetscInt n_;
  std::vector<PetscInt> first_of_rank_;
  int groups_ = 0, least_rows_ = 0, longer_ = 0, left_ = 0, right_ = 0;
  std::vector<BandTile> tiles_;
  PetscInt size_ = 0, left_halo_ = 0, right_halo_ = 0;
  std::optional<NodeFetch> fetch_;
};

// The values of a step of an implicit-explicit method over a whole BandLayout: u, a stage, what is known of
// it, and the slopes of all stages, in columns; and their sums, as the tableau has them.
class ImexColumns {
 public:
  // `implicit`: wave or both.
  ImexColumns(const BandLayout& layout, const StageProgram& method, Implicit implicit);
  ImexColumns(const ImexColumns&) = delete;
  ImexColumns& operator=(const ImexColumns&) = delete;

  // Unknown d (0 psi, 1 eta, 2 the state) of a tile. eta of a stage is not kept.
  double* u(const BandTile& t, int d) const { return at(t, u_[d]); }
  double* stage(const BandTile& t, int d) const { return at(t, stage_[d == 0 ? 0 : 1]); }
  double* known(const BandTile& t, int d) const { return at(t, known_[d]); }
  double* d2(const BandTile& t) const { return at(t, d2_); }  // D2 psi of u
  // R' of a stage (loops.hpp)
  double* right_side(const BandTile& t) const { return at(t, right_side_); }
  // of psi since u, with everything implicit
  double* change(const BandTile& t) const { return at(t, change_); }
  enum Kind { of_implicit, of_explicit };
  // nullptr where the part does not act on the unknown, and of the explicit part of eta: friction there is
  // explicit_eta() times that of psi
  double* slope(const BandTile& t, Kind kind, int stage, int d) const {
    const int index = slopes_[kind][stage][d];
    return index < 0 ? nullptr : at(t, index);
  }

  double explicit_eta() const { return explicit_eta_; }

  // known = u + dt (the slopes before stage i), of psi without u: what is solved for is its change
  void sum_known(const BandTile& t, int i, double dt) const;
  // The new value of unknown d, and its error, from the tile's place on.
  void sum_solution(const BandTile& t, int d, double dt, double* into) const;
  void sum_error(const BandTile& t, int d, double dt, double* into) const;

 private:
  struct Sum {
    int base = -1;  // column; -1: 0
    SlopeSum slopes;
  };
  double* at(const BandTile& t, int index) const { return work_.get() + index * std::size_t(stride_) + t.at; }
  void add(Sum& sum, int d, const double* of_implicit, const double* of_explicit, int count) const;
  void take(const BandTile& t, const Sum& sum, double dt, double* into) const;

  int dof_;
  double explicit_eta_;
  PetscInt stride_;
  int u_[3] = {}, stage_[2] = {}, known_[3] = {}, d2_ = 0, right_side_ = 0, change_ = -1;
  std::vector<std::array<int, 3>> slopes_[2];  // by Kind, of the stages; -1: there is none
  std::vector<std::array<Sum, 3>> sums_;       // of the stages
  std::array<Sum, 3> solution_, error_;
  std::unique_ptr<double[]> work_;
  std::vector<double> zeros_;
  SlopeSums add_;
};

// (diag(d) - p D2) x = b over the nodes of a BandLayout: linear systems of waves taken implicitly, eta and
// the state eliminated.
//
// Nodes inside pieces are eliminated eight pieces at a time (band_system_of.hpp), then the separators two
// neighbouring stretches at a time, up a tree that the grid alone decides. Ranks meet where a stretch would
// be of two of them: what is left of theirs (3 half_width numbers and 3 half_width^2 of the matrix for each
// of some log2 of the tiles) goes to all, and each finishes the tree and the outer nodes by itself. So no
// rank holds factors of nodes that are not its own, and the result has the same bits on any number of ranks.
class BandSystem {
 public:
  static std::unique_ptr<BandSystem> make(const BandLayout& layout);
  virtual ~BandSystem() = default;

  // From now on: d = a everywhere but at held nodes, with factors that are kept for a while; or a d for every
  // solve (`varies`). Collective. Returns whether the matrix with a is positive definite (true where it
  // varies).
  virtual bool choose(double a, double p, bool varies) = 0;
  // Takes the tile's inside away. d and b as columns have them, from the tile's place on; d is not read with
  // constant factors. At held nodes x = b.
  virtual void forward(std::size_t tile, const double* d, const double* b) = 0;
  // The separators and outer nodes; false where a pivot was not positive (`varies`). Collective.
  virtual bool couple() = 0;
  // x of the tile, ready after couple(); d, b as they were given.
  virtual void backward(std::size_t tile, const double* d, const double* b, double* x) = 0;

  // A diagonal by which a node stays where b/d puts it: d x - b is then p D2 x there all the same.
  static constexpr double immovable = 1e150;
};

// A step of an implicit-explicit Runge-Kutta method with the wave, or everything, implicit.
//
// eta and the state are put into psi's equation, which leaves one banded system in psi alone
// (BandSystem). With the wave implicit, part Part::wave of the model, it is linear with one diagonal,
// whose factors stand while step and tableau do; friction is explicit. With everything implicit it has a new
// diagonal in each round of Newton's method (model/loops.hpp). A stage is solved to well below the
// error that a step is allowed. Where the error is estimated, a matrix that is not positive definite on the
// way counts as not solved: while it is, the solution found is the one that grows out of the start of the
// step.
//
// The tiles of a stage go through memory twice, before and behind the separators; behind them a tile goes on
// at once to the right-hand side of the next stage where both stages share their factors.
class BandedImex : public StepTaker {
 public:
  // `implicit`: wave or both.
  BandedImex(const Model& model, StageProgram method, Implicit implicit, bool sticking);

  Outcome take(Vec u, double dt, const ErrorNorm& norm, bool estimate, Vec u_new,
               const std::vector<VecHandle>& slopes, Vec last_slope = nullptr, double t = 0) const override;
  void set_direction(const std::vector<double>& direction) override;
  int stages() const override { return method_.stages; }
  // Of the stages of a tableau that this class takes only the first may be explicit.
  static bool takes(const StageProgram& method);

 private:
  struct Step {
    double dt, begin;
    const ErrorNorm& norm;
    bool estimate;
  };
  double diagonal(int i) const { return method_.At[i * method_.stages + i]; }
  // Of the nodes of a tile; nullptr where there are none of any.
  static const double* of_tile(const std::vector<double>& all, const BandTile& t) {
    return all.empty() ? nullptr : &all[t.at];
  }
  template <class T>
  std::vector<T> by_tiles(const std::vector<T>& of_nodes) const;
  kernel::Coefficients at_stage(const Step& step, int i) const;
  kernel::BandStage stage_of(const Step& step, int i) const;
  const double* from(const BandTile& t) const;
  kernel::Round round_of(const BandTile& t, const Step& step, int i) const;
  void load(Vec u, const Step& step) const;
  void second_difference(const BandTile& t, const double* own, double* d2) const;
  void take_first(const BandTile& t, const Step& step) const;
  void take_explicit(const BandTile& t, int i) const;
  void hold(const BandTile& t, int i, const Step& step) const;
  bool linear_stage(int i, bool begun, const Step& step) const;
  void forward(std::size_t tile, int i, const Step& step) const;
  bool newton_stage(int i, const Step& step) const;
  enum class Newton { solved, failed, lost_digits };
  Newton newton(int i, const Step& step) const;
  void linearise(const BandTile& t, const kernel::Round& round) const;
  void guess(const BandTile& t, int i, const Step& step) const;
  void finish(const BandTile& t, const Step& step, double* u_new, StepErrors::Sums& sums) const;
  void measure(const BandTile& t, int unknown, const Step& step, StepErrors::Sums& sums) const;
  void store_slopes(const std::vector<VecHandle>& slopes) const;
  // Calls body(place in the tile, row of D2 as places of the tile) for the held nodes of a tile.
  template <class Body>
  void for_held(const BandTile& t, const Body& body) const;

  const Model& model_;
  StageProgram method_;
  Implicit implicit_;
  BandLayout layout_;
  ImexColumns columns_;
  std::unique_ptr<BandSystem> system_;
  kernel::Coefficients coefficients_;
  double d2_row_;  // the sum of |D2| over a row
  // in the order of columns; empty: all are 1; friction never sticks
  std::vector<double> amplitude_, direction_;
  std::vector<std::vector<Combination>> end_rows_;         // of D2, at nodes of outer tiles on a line
  mutable std::vector<double> d_, b_, x_, spare_, zeros_;  // of one tile
  mutable std::array<std::vector<double>, 3> new_, of_new_;  // its new values, and their errors
  mutable bool from_start_ = true;  // psi's change is counted from the start of the step, not from 0
  StepErrors errors_;
  SlaveErrors slaves_;
  StencilLoop stencil_;
  PointwiseLoop pointwise_;
  NewtonLoop newton_;
  std::function<void(const kernel::Coefficients&, const kernel::Round&)> wave_;
  std::function<void(const kernel::Round&, double*)> right_sides_;
};

}  // namespace stickslip
