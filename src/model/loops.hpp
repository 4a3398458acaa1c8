// The loops of kernel.hpp as they are chosen for a scene: compiled for each law, half width of the stencil
// and set of instructions. Law and state law are the only names that a loop goes by; who calls one knows
// neither.
#pragma once

#include <functional>
#include <vector>

#include "model/kernel.hpp"
#include "stickslip/model/friction.hpp"

namespace stickslip {

using RangeLoop = std::function<void(const kernel::Coefficients&, const kernel::Range&)>;

// `places`: friction_places() of this rank's nodes. Part::full; half_width 0: Part::pointwise.
// `sticking`: with the direction of motion given, for laws that stick. `stencil`: of Part::stencil, where it
// is not that of the half width.
RangeLoop whole_loop(const FrictionParameters& friction, int half_width, bool sticking,
                     const FrictionPlaces& places = {}, const RangeLoop& stencil = {});
// Part::reaction.
RangeLoop reaction_loop(const FrictionParameters& friction, const FrictionPlaces& places);
// F of `count` nodes side by side, the first of number `node`, of friction amplitude 1, at psi and the stored
// state (not read without one), whatever their coefficients.
using ForceLoop =
    std::function<void(PetscInt node, PetscInt count, const double* psi, const double* state, double* F)>;
ForceLoop force_loop(const FrictionParameters& friction, FrictionPlaces places);
// Part::wave or Part::stencil, for so many unknowns a node.
RangeLoop wave_loop(int dof, int half_width, bool stencil_only);

// Of a medium that differs along x: the loop `same` of Part::stencil, or one with the links where these
// differ (links_along); and Part::wave with that stencil.
RangeLoop medium_stencil(int dof, const RangeLoop& same, const std::vector<double>& links);
RangeLoop medium_wave(int dof, const RangeLoop& stencil, const std::vector<NodeCoefficients>& nodes);

}  // namespace stickslip
