#include "stickslip/numerics/sobol.hpp"

#include <array>

namespace stickslip {

namespace {

constexpr int bits = 32;
using Directions = std::array<std::array<std::uint32_t, bits>, sobol_dimensions>;

// A primitive polynomial of this degree, its inner coefficients as binary digits, and the first direction
// numbers.
struct Generator {
  int degree;
  unsigned inner;
  std::array<std::uint32_t, 3> first;
};
constexpr std::array<Generator, sobol_dimensions - 1> generators{
    {{1, 0, {1}}, {2, 1, {1, 3}}, {3, 1, {1, 3, 1}}}};

Directions make_directions() {
  Directions v{};
  for (int k = 0; k < bits; ++k) v[0][k] = std::uint32_t(1) << (bits - 1 - k);
  for (std::size_t d = 1; d < v.size(); ++d) {
    const Generator& g = generators[d - 1];
    for (int k = 0; k < bits; ++k) {
      const auto at = [&](int i) { return v[d][i]; };
      std::uint32_t& here = v[d][k];
      if (k < g.degree) {
        here = g.first[k] << (bits - 1 - k);
        continue;
      }
      here = at(k - g.degree) ^ (at(k - g.degree) >> g.degree);
      for (int i = 1; i < g.degree; ++i)
        if (g.inner >> (g.degree - 1 - i) & 1) here ^= at(k - i);
    }
  }
  return v;
}

}  // namespace

std::uint32_t sobol(int dimension, std::uint32_t index) {
  static const Directions directions = make_directions();
  const std::uint32_t gray = index ^ (index >> 1);
  std::uint32_t sum = 0;
  for (int k = 0; k < bits; ++k)
    if (gray >> k & 1) sum ^= directions[dimension][k];
  return sum;
}

}  // namespace stickslip
