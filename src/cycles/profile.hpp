// What a solution by collocation shows: its values in the order of the scene's nodes, extrema, times of rest.
#pragma once

#include "cycles/cell_field.hpp"
#include "stickslip/cycles/smooth_cycle.hpp"

namespace stickslip {

// Unknowns of the field from values node by node, and back.
std::vector<double> in_band_order(const CellField& field, const double* natural);
void unfold(const CellField& field, const double* y, double* natural);

// The motion with everything that is measured of it: times, states, psi_min to force_drop; multipliers and
// errors are left open.
Cycle cycle_of(const CellField& field, const std::vector<double>& mesh, const std::vector<double>& values,
               double period);

}  // namespace stickslip
