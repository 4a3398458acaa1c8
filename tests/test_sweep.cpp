// The parts of a sweep that know nothing of scenes: Sobol's points, and the search for changes on a lattice.
#include <cmath>
#include <set>
#include <unordered_map>

#include "catch.hpp"
#include "stickslip/numerics/sampling.hpp"

using namespace stickslip;

TEST_CASE("Sobol's points: first ones as tabulated, and one in each interval", "[sweep]") {
  // scipy.stats.qmc.Sobol(4, scramble=False).random(8) times 8
  const int expected[8][4] = {{0, 0, 0, 0}, {4, 4, 4, 4}, {6, 2, 2, 2}, {2, 6, 6, 6},
                              {3, 3, 5, 7}, {7, 7, 1, 3}, {5, 1, 7, 5}, {1, 5, 3, 1}};
  for (std::uint32_t n = 0; n < 8; ++n)
    for (int d = 0; d < 4; ++d) CHECK(std::ldexp(double(sobol(d, n)), -29) == expected[n][d]);
  for (std::uint32_t n = 0; n < 4096; ++n) {  // along the first axis the digits of Gray's code, mirrored
    std::uint32_t mirrored = 0;
    for (int k = 0; k < 32; ++k) mirrored |= ((n ^ (n >> 1)) >> k & 1) << (31 - k);
    REQUIRE(sobol(0, n) == mirrored);
  }
  for (int d = 0; d < sobol_dimensions; ++d) {
    std::set<std::uint32_t> intervals;
    for (std::uint32_t n = 0; n < 4096; ++n) intervals.insert(sobol(d, n) >> 20);
    CHECK(intervals.size() == 4096);
  }
}

namespace {

// All of the search, with the number of points that it looked at.
template <class Value>
std::unordered_map<long, int> searched(ChangeSearch& search, const Value& value) {
  std::unordered_map<long, int> known;
  for (auto next = search.next(known); !next.empty(); next = search.next(known))
    for (const long point : next) {
      const auto [i, j] = search.place(point);
      // none twice
      REQUIRE(known.emplace(point, value(double(i) / double(search.size()[0] - 1), double(j))).second);
    }
  return known;
}

}  // namespace

TEST_CASE("A change on a line is enclosed between neighbours of the lattice", "[sweep]") {
  ChangeSearch search({4, 0}, 10);
  const double edge = 0.3712;
  const auto known = searched(search, [&](double x, double) { return x > edge; });
  const long at = long(edge * double(search.size()[0] - 1));
  CHECK(known.at(at) == 0);
  CHECK(known.at(at + 1) == 1);
  CHECK(known.size() == 5 + 10);  // a bisection of one cell
}

TEST_CASE("A curve in two dimensions is followed to the width of the lattice", "[sweep]") {
  ChangeSearch search({4, 5}, 5);
  const double last = double(search.size()[1] - 1);
  // a circle, which also bulges into cells whose corners are alike
  const auto inside = [&](double x, double j) { return std::hypot(x - 0.52, j / last - 0.41) < 0.37; };
  const auto known = searched(search, [&](double x, double j) { return int(inside(x, j)); });
  long missed = 0, edges = 0;
  for (long i = 0; i < search.size()[0]; ++i)
    for (long j = 0; j + 1 < search.size()[1]; ++j) {
      const double x = double(i) / double(search.size()[0] - 1);
      if (inside(x, double(j)) == inside(x, double(j + 1))) continue;
      ++edges;
      const long here = i * search.size()[1] + j;
      missed += !known.count(here) || !known.count(here + 1);
    }
  CHECK(edges > 150);
  CHECK(missed == 0);
  CHECK(known.size() < std::size_t(search.points()) / 5);
}
