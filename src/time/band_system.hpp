// (diag(d) - p D2) x = b over the nodes of a BandLayout: linear systems of waves taken implicitly, eta and
// the state eliminated.
//
// Nodes inside pieces are eliminated eight pieces at a time (piece_kernel.hpp), then the separators two
// neighbouring stretches at a time, up a tree that the grid alone decides. Ranks meet where a stretch would
// be of two of them: what is left of theirs (3 half_width numbers and 3 half_width^2 of the matrix for each
// of some log2 of the tiles) goes to all, and each finishes the tree and the outer nodes by itself. So no
// rank holds factors of nodes that are not its own, and the result has the same bits on any number of ranks.
#pragma once

#include <memory>

#include "time/band_layout.hpp"

namespace stickslip {

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

}  // namespace stickslip
