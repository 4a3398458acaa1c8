// The phase of det S(lambda) along a straight segment of the lambda plane, for long lines: O(n log n)
// altogether, however many eigenvalues stand beside the segment.
//
// S is banded with constant coefficients off its diagonal, so that its wide part can be taken off by a
// congruence S = U M U^T, M tridiagonal, row by row from the right: det S = det M, and M p = 0 is a
// recurrence in two components, a product of 2x2 transfer matrices. As functions of lambda these are
// analytic, and a stretch of m nodes needs few values on a piece of length about 1/m of the segment: the
// pieces are halved as neighbouring stretches are joined, until one polynomial in lambda is left for the
// whole line on each. Where one of the two waves outweighs the other by all digits its oscillation is divided
// out, and the pieces stay long.
//
// Nothing is assumed about where eigenvalues stand. What can fail is told: polynomials that do not settle, a
// congruence that does not forget its start (a grid so coarse that the waves between the nodes decay as fast
// as the stencil's own solutions).
#pragma once

#include <petscsys.h>

#include <optional>
#include <vector>

#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

struct PhaseTurn {
  double turn = 0;             // of the phase, from one end of the segment to the other
  std::vector<Complex> zeros;  // beside the segment, the rightmost found first; none surely
  long pieces = 0;             // polynomials used
};

// Collective over comm, which shares the work; the same on every rank. Empty where it fails (see above), or
// the scene has no line to speak of (viscosity between neighbours, which is not in the maps; K1 = 0, fewer
// than `shortest_line` nodes). At most `zeros` zeros are told.
constexpr std::size_t shortest_line = 64;
std::optional<PhaseTurn> follow_phase(MPI_Comm comm, const LinearisedOperator& J, Complex from, Complex to,
                                      std::size_t zeros = 0);

}  // namespace stickslip
