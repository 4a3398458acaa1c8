// A grid that is passed through tile by tile: the nodes of a tile lie in columns that stay in the cache, with
// as many nodes beside them as the stages of a step reach.
//
// A stage looks half a stencil further than it is wanted, so that the first stage is taken on half_width
// nodes more at either side for each stage that follows: these nodes are computed twice, which is cheaper
// than to go through memory. What moves is u in and the new u out, once a step, and between ranks one message
// a step. A small grid, and one with so few nodes a rank that the overlap would be most of the work, is one
// tile that every rank takes as a whole.
#pragma once

#include <petscdmda.h>

#include <array>
#include <functional>
#include <utility>
#include <vector>

#include "base/local_values.hpp"
#include "model/kernel.hpp"
#include "stickslip/model/model.hpp"
#include "time/step_errors.hpp"

namespace stickslip {

constexpr PetscInt closed_nodes = 512;  // a whole grid of so many nodes or fewer is one tile on every rank

struct Tile {
  PetscInt begin, end;          // the nodes whose new values are wanted, counted from this rank's first;
  PetscInt own_begin, own_end;  // those of them that are this rank's,
  PetscInt from, to;            // the nodes that are loaded
};

// The terms of a sum that are not zero.
struct Row {
  std::vector<int> column;  // see Tiles::column
  std::vector<double> weight;
};
// Weights of the columns first, first + 1, ... , added to `row`.
void add_to_row(Row& row, const double* weights, int count, int first);

class Tiles {
 public:
  // `stages`: how many times a tile's overlap reaches half a stencil; `columns` besides u and y (see column).
  Tiles(const Model& model, int stages, int columns, bool sticking);
  Tiles(const Tiles&) = delete;
  Tiles& operator=(const Tiles&) = delete;

  const Model& model() const { return model_; }
  int dof() const { return dof_; }
  int half_width() const { return half_width_; }
  // the ends of the grid seen from this rank; far away on a ring in tiles
  PetscInt low() const { return low_; }
  PetscInt high() const { return high_; }

  // 1, -1 or 0 for every node of this rank, from now on. Collective.
  void set_direction(const std::vector<double>& own);

  // Passes through all tiles, each with `reach` nodes loaded at either side: u is in columns 0, and `through`
  // leaves the new values in columns 1, which go to u_new. Then `after` looks at the tile. Collective.
  template <class Through, class After>
  void pass(Vec u, Vec u_new, PetscInt reach, const Through& through, const After& after) const {
    if (scatter_) fetch(u);
    const Reading halo(scatter_ ? fetched_.get() : nullptr), a(u);
    const Writing b(u_new);
    for (PetscInt j = 0; j < count(); ++j) {
      const Tile t = tile(j, reach);
      load(t, a, halo);
      through(t);
      store(t, 1, b);
      after(t);
    }
  }

  // ---- within a tile ---- Column 0: u, 1: y (a stage, or the new u), from 2 on: slopes. Node i of the tile
  // for unknown d (0 psi, 1 eta, 2 the state) is column(...)[i - from].
  double* column(int index, int d) const { return &work_[(index * dof_ + d) * stride_ + pad_]; }
  const double* zeros() const { return zeros_.data(); }
  // into = base + dt * the row's sum, of unknown d on [begin, end); base, into: as column() gives them.
  void sum(const Tile& t, int d, const double* base, const Row& row, double dt, PetscInt begin, PetscInt end,
           double* into) const;
  // psi beyond an end of the grid, where [begin - half_width, end + half_width) passes it. psi: of node 0.
  void close_ends(double* psi, PetscInt begin, PetscInt end) const;
  // Copies the tile's own part of columns `index` to the array of a Vec.
  void store(const Tile& t, int index, double* u) const;
  const double* amplitude(PetscInt node) const { return at(amplitude_, node); }  // nullptr: all are 1
  // Where friction varies along x: the number of a node among those of this rank with its halo, and x of all
  // of these.
  PetscInt number(PetscInt node) const { return node + left_halo_; }
  FrictionPlaces places() const;
  // The links of all of these, links[k] before the node of number k; none where they do not differ.
  std::vector<double> links() const;
  // nullptr: friction does not stick
  const double* direction(PetscInt node) const { return at(direction_, node); }
  // Calls body(i) for the held nodes of this rank in [begin, end).
  template <class Body>
  void for_held(PetscInt begin, PetscInt end, const Body& body) const {
    for (const PetscInt node : {PetscInt(0), n_ - 1}) {
      const PetscInt i = node - first_;
      if (model_.held(node) && i >= begin && i < end) body(i);
      if (n_ == 1) break;
    }
  }

  // ---- over a step: what the new values err by ----
  // The new u stands in columns 1; columns 0 are used up. `estimate` false: only whether it is finite.
  // `refine`: what is made of the errors in columns 0.
  void measure(const Tile& t, const Row& error, double dt, const ErrorNorm& norm, bool estimate,
               StepErrors::Sums& sums, const std::function<void()>& refine) const;

 private:
  const double* at(const std::vector<double>& list, PetscInt node) const {
    return list.empty() ? nullptr : &list[node + left_halo_];
  }
  std::vector<std::pair<PetscInt, double>> beyond(PetscInt node) const;
  PetscInt wrapped(PetscInt node) const { return ((node % n_) + n_) % n_; }
  PetscInt count() const;
  Tile tile(PetscInt number, PetscInt reach) const;  // of them
  void set_amplitude();
  void set_up_scatter();
  void fetch(Vec from) const;
  std::array<double*, 3> columns(const Tile& t, int index, PetscInt i) const;
  void load(const Tile& t, const double* u, const double* halo) const;

  const Model& model_;
  int dof_, half_width_;
  PetscInt first_, local_, n_;
  bool closed_;  // one tile holds the whole grid, also of several ranks
  PetscInt low_, high_, left_halo_, right_halo_;
  std::vector<double> amplitude_, direction_;  // of the nodes -left_halo .. local + right_halo - 1
  // psi beyond an end, by local nodes
  std::vector<std::vector<std::pair<PetscInt, double>>> left_end_, right_end_;
  std::function<void(const kernel::Terms&)> add_;
  StepErrors errors_;
  kernel::Copy to_columns_, from_columns_;
  ScatterHandle scatter_;
  VecHandle fetched_, going_;          // going_: the direction in place of psi, to be fetched
  static constexpr PetscInt pad_ = 8;  // room for the nodes beyond an end
  PetscInt stride_ = 0;
  mutable std::vector<double> work_;
  std::vector<double> zeros_;
};

}  // namespace stickslip
