// The phase of a cycle.
#pragma once

#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

// y_0 lies in the plane through y across the motion there.
Condition plane_across(const VectorField& field, const std::vector<double>& y);
// The same where the plane goes through the middle of the cycle too: smaller cycles about it still cross it.
Condition plane_through(const VectorField& field, const std::vector<double>& y,
                        const std::vector<double>& middle);
// The plane through y in which unknown k keeps its value.
Condition plane_of(std::size_t k, const std::vector<double>& y);
// Under a forcing no phase is left open: the number q is unknown k at phase 0.
Condition number_of(std::size_t unknowns, std::size_t k = 0);
// Mean over a period of a profile of d unknowns on a mesh.
std::vector<double> mean_of(const std::vector<double>& mesh, const double* x, std::size_t d);

}  // namespace stickslip
