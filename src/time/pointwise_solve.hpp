// What is pointwise, taken implicitly on a piece of a tile (model/implicit_kernel.hpp): the stage of an
// implicit-explicit step, and the middle of a leapfrog step.
#pragma once

#include "model/loops.hpp"
#include "time/tiles.hpp"

namespace stickslip {

class PointwiseSolve {
 public:
  PointwiseSolve(const Tiles& tiles, bool sticking);

  // Columns of the tile: what is known of the new values, z; their slope; that of the stage before, -1
  // without one. The solution y = z + h g(y) ends in columns 1, where a guess of psi and the state stands;
  // columns 0 hold the start.
  struct Where {
    int known, slope, slope_before;
  };
  struct Asked {
    const kernel::Coefficients& c;
    double h;
    double target;         // of the residual, against the scale of psi and |psi|
    const Scales& scales;
    bool strict;           // only by the root that the step leads to
  };
  // On [begin, end); psi of held nodes stands. Returns how many nodes are left unsolved.
  long operator()(const Tile& t, const Where& where, const Asked& asked, PetscInt begin, PetscInt end) const;

 private:
  long solve(const Tile& t, const Where& where, const Asked& asked, PetscInt begin, PetscInt end,
             bool held) const;

  const Tiles& tiles_;
  StageLoop solve_stage_;
};

}  // namespace stickslip
