// The phase of a cycle.
#pragma once

#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

// y_0 lies in the plane through y across the motion there.
Condition plane_across(const VectorField& field, const std::vector<double>& y);

}  // namespace stickslip
