// The commands: each reads its options, does its work and returns the exit code (0, or that of a signal it
// stopped for). Errors leave as exceptions (error.hpp). All are collective.
#pragma once

#include "stickslip/options/options.hpp"

namespace stickslip {

int run_command(const Options& options);   // advances the scene in time
int wave_command(const Options& options);  // solves for a travelling train, its stability, a branch of trains
int spectrum_command(const Options& options);  // steady sliding and its rightmost eigenvalues
int laws_command(const Options& options);      // tabulates friction laws
int boundary_command(const Options& options);  // where steady sliding loses stability, and stick-slip ends
int cycle_command(const Options& options);     // a periodic oscillation, its stability, a branch of them
int sweep_command(const Options& options);     // any of the others at many values of options
int fit_command(const Options& options);       // parameters of a scene out of a measured course
// error against seconds by many methods, or where each method fails
int chart_command(const Options& options);

}  // namespace stickslip
