// The smallest problem that has the answer of a scene, and whether the scene's motion keeps the symmetry that
// makes it so small (option scene_reduce).
//
// Where every node starts alike, friction has no spread and the ends are a ring or free, every node moves
// alike: D2 psi is 0 and the motion is that of one node, an ordinary differential equation. Where a ring
// starts as m equal cells it stays so, and one cell, closed to a ring, moves as every one of them. The
// reduced grid keeps the distance of the nodes and the scene's frequencies, so that the method and its steps
// are those of the whole scene: the error norm is a mean over the nodes, the same over one cell as over m.
// Steps and answer then agree to rounding.
//
// Symmetric data stay symmetric exactly; the whole scene computed on its grid leaves them only by round-off,
// where an instability amplifies it. One cell cannot show that, so it is computed:
//   uniform sliding      eigenvalues of the linearised system at psi = v for the wavenumbers that fit the
//                        scene
//   uniform oscillation  Floquet multipliers: the perturbation exp(ikx) obeys the one-node equation
//                        linearised about the limit cycle, with K0 + K1 kappa^2(k) for K0; its matrix is
//                        carried round one period
//   a train on cells     eigenvalues right of the imaginary axis with a Bloch factor that one cell does not
//                        have, counted by the argument principle (wave_stability.hpp)
#pragma once

#include <optional>
#include <string>

#include "stickslip/output/regime.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/options/options.hpp"

namespace stickslip {

// How many equal cells the options promise: n where every node starts alike, 1 where nothing repeats, 0 where
// only the fields can tell.
PetscInt promised_cells(const Scene& scene, const Options& options);
// One of `cells` equal cells of a scene, closed to a ring.
Scene cell_of(const Scene& scene, PetscInt cells);

// The problem that is solved for a scene.
struct Problem {
  Model model;       // over all ranks, or, where they are more than its nodes, on every rank alike
  VecHandle u;       // its start; not set where the number of nodes was given
  std::string what;  // what was reduced and why; "" where nothing was
};

// How the start decides: formulas have the symmetry that their options say, whatever rounding does to it;
// fields of a file must be equal to the last bit, so that a perturbation of any size is kept. `nodes`, where
// given, is that of a checkpoint, and no start is made. Collective on PETSC_COMM_WORLD.
Problem problem_of(const Scene& whole, const Options& options, std::optional<PetscInt> nodes);

// A wave that grows on a uniform motion.
struct UniformInstability {
  double growth_rate = 0;  // largest over the wavenumbers that fit the scene, 0 where none grows
  double wavenumber = 0;   // the one that reaches it
  double period = 0;       // of the oscillation; 0 for sliding
  double multiplier = 1;   // exp(growth_rate period)
};

// Of sliding at psi = v, or of the uniform oscillation: over the waves (k > 0) of the scene's own ring or
// free ends. Where there are more than 400 of them (of an oscillation: with c k T < 100, beyond which its
// mean damping decides), 400 are looked at first, then the neighbours of the fastest. The orbit is known to
// 1e-7; a growth of less than 1e-6 a period counts as none. Throws UsageError where the law jumps at rest,
// Failure where no oscillation exists.
UniformInstability instability_of_sliding(const Scene& scene);
UniformInstability instability_of_oscillation(const Scene& scene);

// What a warning says of the whole scene's motion, "" where it keeps its symmetry (on a uniform motion: where
// no perturbation of 1e-6 takes over in the time of the run): `scene` is the whole one, `cell` the one
// solved, `seen` what was measured at the end of the run (pulses: on the whole ring), which lasted `duration`
// and ended with the mean velocity `psi`.
std::string broken_symmetry(const Scene& scene, const Scene& cell, const Measured& seen, double psi,
                            double duration);

}  // namespace stickslip
