#include "stickslip/numerics/sobol.hpp"

#include <boost/random/sobol.hpp>

namespace stickslip {

// Boost's sequence leaves out point 0, the origin.
std::uint32_t sobol(int dimension, std::uint32_t index) {
  if (index == 0) return 0;
  boost::random::sobol_engine<std::uint32_t, 32> coordinates(dimension + 1);
  coordinates.seed(index - 1);
  coordinates.discard(dimension);
  return coordinates();
}

}  // namespace stickslip
