// Which points of a box are looked at: where an answer changes, and evenly.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace stickslip {

// Where something that takes a few distinct values changes, on a lattice in one or two dimensions, found
// without looking at all points of the lattice.
//
// The coarse cells (intervals in one dimension) are looked at first. A cell on whose edge two known points
// differ is divided into halves (quarters), until none is left but those of the lattice itself; so a line
// along which the values change is followed through every cell that it enters, also one whose corners are
// alike, where a neighbour's finer points show it. What lies wholly between the points of the coarse cells is
// not seen. Local to the process.
class ChangeSearch {
 public:
  // `cells`: coarse ones in each dimension (0 in the second: one dimension), each to be halved `halvings`
  // times.
  ChangeSearch(std::array<long, 2> cells, int halvings);

  // Points of the finest lattice, counted from 0 with the second dimension running fastest.
  long points() const { return size_[0] * size_[1]; }
  std::array<long, 2> place(long point) const { return {point / size_[1], point % size_[1]}; }
  std::array<long, 2> size() const { return size_; }

  // The points that are to be looked at next, in rising order; empty where the search has ended. `known`: the
  // value of every point handed out so far.
  std::vector<long> next(const std::unordered_map<long, int>& known);

 private:
  struct Cell {
    long i, j, width;
  };
  bool differs(const Cell& cell, const std::unordered_map<long, int>& known) const;
  void corners(const Cell& cell, std::vector<long>& into) const;
  void divide(const Cell& cell, std::vector<Cell>& into) const;
  long point(long i, long j) const { return i * size_[1] + j; }
  bool flat() const { return size_[1] == 1; }

  std::array<long, 2> size_{};
  std::vector<Cell> leaves_;  // cells that have not been divided, those of the lattice itself excepted
  bool begun_ = false;
};

// Sobol's sequence: points that fill a cube of up to four dimensions more evenly than random ones do.
//
// Boost's, in the order of Gray codes, with the direction numbers of S. Joe and F. Y. Kuo, SIAM J. Sci.
// Comput. 30 (2008) 2635-2654. Local to the process.
constexpr int sobol_dimensions = 4;

// Coordinate `dimension` (from 0) of point `index` (from 0), as a fraction of 2^32. Each coordinate of the
// first 2^k points is once in each of 2^k equal intervals.
std::uint32_t sobol(int dimension, std::uint32_t index);

}  // namespace stickslip
