// The start from a file: a frame of a run, an eigenvector added to steady sliding, a NetCDF-4 or HDF5 file of
// anybody, or text in columns. Collective.
#pragma once

#include "stickslip/model/scene.hpp"
#include "stickslip/options/options.hpp"
#include "stickslip/output/reader.hpp"

namespace stickslip {

// Fields psi, eta and, where the scene has one, the state (as files show it) at every node of the scene, of
// init_type `file` (init_file, init_frame) or `text`. Where the points of the file are not the nodes, values
// between them lie on the cubic through the four nearest points, the state's on that of its logarithm where
// it is an age; a warning says so. Throws UsageError where the file cannot be read, does not reach over the
// scene or holds too little.
Frame start_frame(const Scene& scene, const Options& options);

// Whether init_file is one of `spectrum`; then start_frame() gives steady sliding with init_amplitude times
// the real part of eigenvector init_mode.
bool starts_from_eigenvector(const Options& options);

}  // namespace stickslip
