// The phase of det S(lambda) along a straight segment of the lambda plane, for long lines: O(n log n) altogether,
// however many eigenvalues stand beside the segment.
//
// Inside the line S p = 0 is a recurrence from node to node, a product of transfer matrices. Those of wide stencils
// have p/2 - 1 solutions that grow and as many that decay by a constant factor at every node; a stretch of nodes is
// therefore kept as a map from what enters it (the wave pair and the decaying parts on its left, the growing parts on
// its right) to what leaves it, which is bounded apart from the wave pair. As functions of lambda these maps are
// analytic, and a stretch of m nodes needs few values on a piece of length about 1/m of the segment: the pieces are
// halved as neighbouring stretches are joined, until one polynomial in lambda is left for the whole line on each.
//
// Nothing is assumed about where eigenvalues stand. What can fail is told: polynomials that do not settle, parts that
// do not stay apart (a grid so coarse that the waves between the nodes decay as fast as the stencil's own).
#pragma once

#include <petscsys.h>

#include <optional>
#include <vector>

#include "stickslip/sliding.hpp"

namespace stickslip {

struct PhaseTurn {
  double turn = 0;                 // of the phase, from one end of the segment to the other
  std::vector<Complex> zeros;      // near the segment, where the phase turns forward: a few, none surely
  long pieces = 0;                 // polynomials used
};

// Collective over comm, which shares the work; the same on every rank. Empty where it fails (see above), or the scene
// has no line to speak of (K1 = 0, fewer than `shortest_line` nodes).
constexpr std::size_t shortest_line = 64;
std::optional<PhaseTurn> follow_phase(MPI_Comm comm, const Sliding& sliding, Complex from, Complex to);

}  // namespace stickslip
