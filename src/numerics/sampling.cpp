
#include "stickslip/numerics/sampling.hpp"

#include <algorithm>
#include <boost/random/sobol.hpp>

namespace stickslip {

ChangeSearch::ChangeSearch(std::array<long, 2> cells, int halvings) {
  const long width = 1L << halvings;
  for (std::size_t d = 0; d < 2; ++d) size_[d] = cells[d] * width + 1;
  for (long i = 0; i + 1 < size_[0]; i += width)
    for (long j = 0; j == 0 || j + 1 < size_[1]; j += width) leaves_.push_back({i, j, width});
}

void ChangeSearch::corners(const Cell& cell, std::vector<long>& into) const {
  for (const long i : {cell.i, cell.i + cell.width}) {
    into.push_back(point(i, cell.j));
    if (!flat()) into.push_back(point(i, cell.j + cell.width));
  }
}

bool ChangeSearch::differs(const Cell& cell, const std::unordered_map<long, int>& known) const {
  const int first = known.at(point(cell.i, cell.j));
  const auto other = [&](long i, long j) {
    const auto found = known.find(point(i, j));
    return found != known.end() && found->second != first;
  };
  for (long k = 0; k <= cell.width; ++k) {
    if (other(cell.i + k, cell.j)) return true;
    if (flat()) continue;
    if (other(cell.i + k, cell.j + cell.width) || other(cell.i, cell.j + k) ||
        other(cell.i + cell.width, cell.j + k))
      return true;
  }
  return false;
}

void ChangeSearch::divide(const Cell& cell, std::vector<Cell>& into) const {
  const long half = cell.width / 2;
  for (const long i : {cell.i, cell.i + half}) {
    into.push_back({i, cell.j, half});
    if (!flat()) into.push_back({i, cell.j + half, half});
  }
}

std::vector<long> ChangeSearch::next(const std::unordered_map<long, int>& known) {
  std::vector<long> wanted;
  if (!begun_) {
    begun_ = true;
    for (const Cell& cell : leaves_) corners(cell, wanted);
  }
  while (wanted.empty()) {
    std::vector<Cell> kept, fresh;
    for (const Cell& cell : leaves_) {
      if (cell.width > 1 && differs(cell, known))
        divide(cell, fresh);
      else
        kept.push_back(cell);
    }
    if (fresh.empty()) return {};
    for (const Cell& cell : fresh) corners(cell, wanted);
    kept.insert(kept.end(), fresh.begin(), fresh.end());
    leaves_ = std::move(kept);
    wanted.erase(std::remove_if(wanted.begin(), wanted.end(), [&](long p) { return known.count(p) > 0; }),
                 wanted.end());
  }
  std::sort(wanted.begin(), wanted.end());
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  return wanted;
}

// Boost's sequence leaves out point 0, the origin.
std::uint32_t sobol(int dimension, std::uint32_t index) {
  if (index == 0) return 0;
  boost::random::sobol_engine<std::uint32_t, 32> coordinates(dimension + 1);
  coordinates.seed(index - 1);
  coordinates.discard(dimension);
  return coordinates();
}

}  // namespace stickslip
