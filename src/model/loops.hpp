// The loops over nodes as they are chosen for a scene, compiled for each set of instructions: for each order,
// or for what laws have (a state, a threshold, a steep rise), but for no law. Who calls one knows neither.
#pragma once

#include <functional>
#include <vector>

#include "model/implicit_kernel.hpp"
#include "model/newton_kernel.hpp"

namespace stickslip {

// K1 D2 psi; `links`, where they differ, by the numbers of nodes.
using StencilLoop = std::function<void(const kernel::Coefficients&, const kernel::ColumnRange&)>;
StencilLoop stencil_loop(const Scene& scene, const std::vector<double>& links = {});

// All that is pointwise; the stage of a method that takes it implicitly, with the number of nodes left
// unsolved; a round of Newton's method with everything implicit.
using PointwiseLoop = std::function<void(const kernel::Coefficients&, const kernel::Columns&)>;
using StageLoop = std::function<long(const kernel::Coefficients&, const kernel::Stage&)>;
using NewtonLoop =
    std::function<kernel::Flag(const kernel::Coefficients&, const kernel::Round&, bool advance)>;
// One of these three. `sticking`: with the direction of motion given, for laws that stick. `places`:
// friction_places() of the nodes by their numbers.
template <class Loop>
Loop loop_for(const FrictionParameters& friction, bool sticking, const FrictionPlaces& places);

// What is pointwise without friction; `medium`: of each node, empty where all are alike.
PointwiseLoop frictionless_loop(int dof, const std::vector<NodeCoefficients>& medium);

// F of `count` nodes side by side, the first of number `node`, of friction amplitude 1, at psi and the stored
// state (not read without one), whatever their coefficients.
using ForceLoop =
    std::function<void(PetscInt node, PetscInt count, const double* psi, const double* state, double* F)>;
ForceLoop force_loop(const FrictionParameters& friction, const FrictionPlaces& places);

}  // namespace stickslip
