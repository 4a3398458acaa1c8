// Centred second differences of order 2, 4, 6, 8 and the ends of the grid. Local to the process.
//
// At every node D2 psi = sum_{|j| <= p/2} w_|j| psi[i+j] with the same weights; an end enters only through
// the values given to the halo, the p/2 nodes beyond it, each a linear combination of nodes inside:
//   ring             the node on the other side
//   free, continuum  even reflection about the end node: psi[-j] = psi[j] (full order, D2 symmetric in the
//                    inner product with weight 1/2 at the ends)
//   free, chain      psi[-1] = psi[0], so that the end block has one neighbour
//   held, continuum  the polynomial of degree p - 1 through the p nodes from the end inwards. This is the
//                    same as the one-sided stencil of order p - 2 at the nodes next to the end, which keeps
//                    order p in the solution. The eigenvalues of D2 are real and negative for p = 2, 4, 6;
//                    for p = 8 some are complex, so that waves would grow, and a scene with order 8 and a
//                    held end is refused.
//   held, chain      as free: it only serves the elastic force at the held block, which is output
#pragma once

#include <array>
#include <complex>
#include <utility>
#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

// Weights w_0..w_{p/2} of the second difference of order p, for spacing 1; entries beyond p/2 are 0.
std::array<double, 5> second_difference(int order);

// The symbol of -D2 for spacing h: kappa^2(k) = (4/h^2)[S + S^2/3 + 8 S^3/45 + 4 S^4/35], S = sin^2(k h/2),
// the first p/2 terms.
double symbol(int order, double h, double k);

// The largest value of the symbol, at the grid scale k = pi/h: bounds the spectrum of -D2 for all ends but
// the held ones of order 4 and 6, which stay below it too (tested).
double largest_symbol(int order, double h);

// Node j of the halo (j < 0 or j >= n) as a combination of nodes inside: pairs (node, weight).
using Combination = std::vector<std::pair<PetscInt, double>>;
Combination halo_node(const Scene& scene, PetscInt j);

// Row i of D2 (without 1/h^2 for the chain, with it in the continuum) as a combination of nodes, sorted by
// node.
Combination second_difference_row(const Scene& scene, PetscInt i);

// Row i of K1 D2, likewise; with the links of the scene's own where they differ (medium.hpp).
Combination coupling_row(const Scene& scene, PetscInt i);

// A row of D2 on a ring (stencil.hpp) with each neighbour apart and how many rings on it stands (negative:
// back): the nodes of a ring are those of a cell that repeats, and its copies beside it may move otherwise.
// Local to the process.
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
