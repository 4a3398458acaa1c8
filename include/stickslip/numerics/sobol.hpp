// Sobol's sequence: points that fill a cube of up to four dimensions more evenly than random ones do.
//
// Boost's, in the order of Gray codes, with the direction numbers of S. Joe and F. Y. Kuo, SIAM J. Sci.
// Comput. 30 (2008) 2635-2654. Local to the process.
#pragma once

#include <cstdint>

namespace stickslip {

constexpr int sobol_dimensions = 4;

// Coordinate `dimension` (from 0) of point `index` (from 0), as a fraction of 2^32. Each coordinate of the
// first 2^k points is once in each of 2^k equal intervals.
std::uint32_t sobol(int dimension, std::uint32_t index);

}  // namespace stickslip
