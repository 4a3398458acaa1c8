// The loops that steps tile by tile are made of, in the version that suits this processor. Compiled apart,
// since they are compiled for every law or order, and vector length.
#pragma once

#include <functional>
#include <vector>

#include "model/column_kernel.hpp"
#include "model/implicit_kernel.hpp"
#include "model/newton_kernel.hpp"
#include "model/tangent_kernel.hpp"

namespace stickslip::tile {

// K1 D2 psi; `links` by the numbers of nodes, where they differ (Tiles::links).
using Stencil = std::function<void(const kernel::Coefficients&, const kernel::ColumnRange&)>;
Stencil stencil(const Scene& scene, const std::vector<double>& links = {});

// What is added to it; `sticking`: of friction that sticks. `places`: friction_places() of the nodes by
// their numbers.
using Pointwise = std::function<void(const kernel::Coefficients&, const kernel::Columns&)>;
Pointwise pointwise(const Scene& scene, bool sticking, const FrictionPlaces& places);

// The stage of an implicit-explicit method with what is pointwise implicit; the number of nodes left
// unsolved.
using SolveStage = std::function<long(const kernel::Coefficients&, const kernel::Stage&)>;
SolveStage solve_stage(const Scene& scene, bool sticking, const FrictionPlaces& places);

// A round of Newton's method with everything implicit.
using NewtonRound =
    std::function<kernel::Flag(const kernel::Coefficients&, const kernel::Round&, bool advance)>;
NewtonRound newton_round(const Scene& scene, bool sticking, const FrictionPlaces& places);

// The derivatives of what is pointwise.
using NodeTangents = std::function<void(const kernel::Tangents&)>;
NodeTangents tangents(const Scene& scene, bool sticking, const FrictionPlaces& places);

}  // namespace stickslip::tile
