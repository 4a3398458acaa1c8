// A row of D2 on a ring (stencil.hpp) with each neighbour apart and how many rings on it stands (negative:
// back): the nodes of a ring are those of a cell that repeats, and its copies beside it may move otherwise.
// Local to the process.
#pragma once

#include <vector>

#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

struct TurnedTerm {
  PetscInt node;
  double weight;
  int turns;
};
std::vector<TurnedTerm> turned_row(const Scene& ring, PetscInt i);

// A row of D2 on any scene; where links differ (medium.hpp), here and above, that of the links over the mean
// K1.
Combination row_over_mean(const Scene& scene, PetscInt i);

}  // namespace stickslip
