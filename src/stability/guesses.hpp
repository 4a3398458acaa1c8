// Where modes may stand, and what they may look like: the beginning of every search.
#pragma once

#include <vector>

#include "stickslip/stability/spectrum.hpp"

namespace stickslip {

constexpr std::size_t many_nodes = 5000;  // beyond, the search is frugal: what it misses the count points at

// Frequencies of the medium with mean coefficients, one a mode: knots with about one eigenvalue between two
// of them.
std::vector<double> mean_frequencies(const LinearisedOperator& s);
// Shifts where the medium with mean coefficients grows fastest, at the ends of its band, and between. One
// shift is enough where all nodes are alike.
std::vector<Complex> first_shifts(const LinearisedOperator& s, double height, PetscInt count);
// What a node would do alone: the rightmost root for three stiffnesses; or of its oscillations only.
double local_growth(const LinearisedOperator& s, std::size_t i, bool oscillations);
// Segments of the line where the mean over 1, 4, 16, ... nodes of the local growth is largest: what they
// would do alone is nearly what modes trapped there do. `quick`: one segment a length.
struct Segment {
  std::size_t first, width;
};
std::vector<Segment> promising_segments(const LinearisedOperator& s, bool quick);
// The modes of a segment alone (psi on its nodes). `inside`: only those that are small at the ends of the
// segment: others look more growing than they are, and would stand before them.
std::vector<Mode> segment_modes(const LinearisedOperator& s, const Segment& segment, double height,
                                bool inside);

}  // namespace stickslip
