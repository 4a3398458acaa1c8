// Where friction or the medium is not smooth along x: at the places that their profiles name
// (friction_*_profile, state_*_profile, model_*_profile). A random spread is smooth to its second derivative
// everywhere and has no corners here.
//
// A solution inherits them. With what of either jumps at a corner, its value, its first or its third
// derivative, differences of any order converge like h, h^2 or h^4: a node stands for the cell around it, and
// takes its friction from one place.
//
// Nothing here communicates. Places are lengths from the scene's left end.
#pragma once

#include <utility>
#include <vector>

#include "stickslip/model/scene.hpp"

namespace stickslip {

struct Corner {
  double x;
  int order;  // at which differences converge: 1, 2 or 4
};

// In the order of x, each place once with its lowest order; none where nothing changes, beyond a ring's seam
// or at an end.
std::vector<Corner> corners_of(const Scene& scene);

// The neighbours of a place between which no corner lies, the one behind not included where friction jumps
// there. Without a corner on that side infinite; on a ring they may lie beyond its seam. A place at a corner
// belongs to what follows it.
struct SmoothStretch {
  double from, to;
  bool jumps;  // at `to`
};
SmoothStretch stretch_around(const std::vector<Corner>& corners, const Scene& scene, double x);

// The least number of cells, up to `most`, of which a grid has a node at every corner of at most that order;
// 0 where there is none, 1 where there are no such corners.
PetscInt cells_between_corners(const std::vector<Corner>& corners, const Scene& scene, int order,
                               PetscInt most);

}  // namespace stickslip
