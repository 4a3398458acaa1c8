#include "model/turned_row.hpp"

#include <array>
#include <cmath>

#include "stickslip/model/stencil.hpp"

namespace stickslip {

std::vector<TurnedTerm> turned_row(const Scene& ring, PetscInt i) {
  const std::array<double, 5> w = second_difference(ring.order);
  const double scale = ring.form == Form::chain ? 1 : 1 / (ring.h() * ring.h());
  std::vector<TurnedTerm> row;
  for (PetscInt j = -ring.order / 2; j <= ring.order / 2; ++j) {
    const PetscInt there = i + j, turns = there >= 0 ? there / ring.n : -((ring.n - 1 - there) / ring.n);
    row.push_back({there - turns * ring.n, scale * w[std::abs(j)], int(turns)});
  }
  return row;
}

}  // namespace stickslip
