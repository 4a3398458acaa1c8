// Whether the machines and the number of ranks suit the scene: what a command takes of memory, and what is
// there.
//
// At its peak a command takes, of all ranks together,
//
//     bytes = 45e6 ranks + n b
//
// with the n nodes that are solved for and b bytes a node. Each part of a run states its own, bytes_a_node()
// beside what it allocates: Stick, Displacement, Events, Tangents, StepAudit, Frames, FusedStepper,
// BandedImex, DenseOutput, FieldWatch; here they are summed, with u, the amplitude of friction and what
// PETSc's types keep. With V = 8 dof the bytes of a node's unknowns (16, with a state 24), p the order,
// s the stages, M =
// (p + 1) (8 dof^2 + 4) + 20 a matrix and L = (2p + 1 on a ring, else p + 1) (8 dof^2 + 4) + 8 dof^2 its
// factors, these are
//
//     M + L + (17, 15, 11, 10, 14, 3 s + 9) V  PETSc's bdf, rosw, cn, theta and beuler, alpha, arkimex
//     (2 s + 2, 2, 3 or 4) V    PETSc's rk, euler, ssp
//
// Those of PETSc's solvers count its vectors; of `spectrum` (736 + 145 p + 18 k on a ring, 770 + 97 p + 8 k
// else, with k eigenvalues), `boundary` (253 + 30 p; held ends 640 + 69 p) and `chart` (183) they are
// measured, of which tests/bench/memory.py holds all against runs. Symmetry (scene_reduce) leaves fewer
// nodes, after a start that takes 60 + V + 8 for each of the scene's. wave, cycle, laws and sweep have no
// grid of the scene's.
#pragma once

#include "stickslip/model/model.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/result_file.hpp"
#include "stickslip/output/run_file.hpp"

namespace stickslip {

// UsageError where there are more ranks than nodes, or where the memory that is left, on any machine that
// takes part or by a limit of a process (ulimit -v) or control group, is less than nine tenths of what the
// command takes for its nodes, as far as the options tell: of a run at least what rk:5dp takes. main() calls
// it for commands with a grid, except before a restart: that command calls it with the restored options.
// Collective on the ranks that share the scene.
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
