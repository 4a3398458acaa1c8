// Whether the machines and the number of ranks suit the scene: what a command takes of memory, and what is
// there.
//
// At its peak a command takes, of all ranks together, at most
//
//     bytes = 55e6 ranks + n b
//
// with the n nodes that are solved for and b bytes a node, and no less than a 1.3th of it
// (tests/bench/memory.py holds the table of docs/developers/performance.md against runs). b is that of so
// many vectors of the unknowns (16 bytes, with a state 24) as a run keeps:
//
//     4                      always
//     5.5                    fixed steps: those that are made again
//     s + 5                  values inside a step of s slopes: a file, exponents, exact stick
//     3, 6 + 3 p             checkpoints, out_displacement, p the order
//     1                      a threshold that is smoothed
//     8, 11 + 7 k, 5         out_events (15 with that or a state), k exponents, exact stick
//     13                     implicit waves in bands
//     2 s + 2, 3; 18, 12     PETSc's rk, euler and ssp; arkimex, others that are implicit
//
// and with implicit waves by PETSc's solvers dof^2 (94 + 12 p, on a ring 24 p) for the matrix and its
// factors. Those of `spectrum`, `boundary` and `chart` are measured. Symmetry (scene_reduce) leaves fewer
// nodes, after a start that takes 76 and the unknowns for each of the scene's. wave, cycle, laws and
// sweep have no grid of the scene's.
#pragma once

#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/run_file.hpp"

namespace stickslip {

// UsageError where there are more ranks than nodes, or where the memory that is left, on any machine that
// takes part or by a limit of a process (ulimit -v) or control group, is less than a 1.3th of what the
// command takes at most for its nodes, as far as the options tell: of a run by the smallest method. main()
// calls it for commands with a grid, except before a restart: that command calls it with the restored
// options. Collective on the ranks that share the scene.
void check_size(const Options& options, MPI_Comm comm = MPI_COMM_WORLD);

// The same of a run whose start is known, and so its method and how many nodes symmetry leaves, before
// anything is made for them. Collective.
void check_size_of_run(const Options& options, const Model& model, Vec u);

// b of such a run. Collective.
double bytes_a_node(const Options& options, const Model& model, Vec u);

// What the file of a run says of its scene.

// All that follows from a scene: x, the fields psi, eta and tau or theta; as numbers the coefficients A, B,
// K0, K1, s_delta and v of the one system and, where uniform sliding exists, its steady_eta and steady_stable
// (1 or 0, to perturbations of every wavelength of the grid); the table of friction (amplitude 1). To be
// completed by the slab, probes, series, frames. Not collective.
RunLayout run_layout(const Scene& scene);
// Those numbers and the table of friction, to a file that is written in one piece.
void add_scene(ResultFile& file, const Scene& scene);

}  // namespace stickslip
