// A row of D2 on a ring (stencil.hpp) with each neighbour apart and how many rings on it stands (negative:
// back): the nodes of a ring are those of a cell that repeats, and its copies beside it may move otherwise.
// Local to the process.
#pragma once

#include <complex>
#include <vector>

#include "stickslip/model/scene.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

struct TurnedTerm {
  PetscInt node;
  double weight;
  int turns;
};
using TurnedRow = std::vector<TurnedTerm>;
TurnedRow turned_row(const Scene& ring, PetscInt i);

// Of the rows of a cell those with terms in other copies; of a single one that, whatever it holds.
std::vector<std::size_t> nodes_at_ends(const std::vector<TurnedRow>& rows);
// What the terms of these in other copies add to D2 where each copy moves exp(i theta) times as much as the
// one before it, against copies that move as the cell: row by row, times psi at these nodes.
std::vector<std::complex<double>> phase_weights(const std::vector<TurnedRow>& rows,
                                                const std::vector<std::size_t>& at_ends, double theta);

// A row of D2 on any scene; where links differ (medium.hpp), here and above, that of the links over the mean
// K1.
Combination row_over_mean(const Scene& scene, PetscInt i);

}  // namespace stickslip
