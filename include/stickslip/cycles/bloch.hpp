// Stability of cycles to waves: Floquet-Bloch multipliers over the wavenumber.
//
// A cell's motion repeats on an infinite line or a ring of any number of cells. A deviation that is exp(i
// theta) times as large in the next cell obeys the linearised equations of one cell with its neighbours with
// this Bloch phase; about uniform motion exp(ikx) obeys those of one node with kappa^2(k) for -D2: k^2 in the
// continuum, whatever the grid, and the symbol of the difference in the chain. Each wavenumber has as many
// multipliers as the cell has unknowns. Alike on every rank, nothing communicates. Wavenumbers are 1/length
// (1/block in the chain), growth rates ln|multiplier|/period.
#pragma once

#include <complex>
#include <string>
#include <vector>

#include "stickslip/cycles/smooth_cycle.hpp"
#include "stickslip/cycles/stick_cycle.hpp"

namespace stickslip {

struct BlochPoint {
  double wavenumber = 0;
  std::vector<std::complex<double>> multipliers;  // largest first
  double growth_rate = 0;                         // of the largest
};

struct BlochSpectrum {
  std::vector<BlochPoint> points;  // k > 0, rising
  // The largest growth rate over the wavenumbers from the first of `points` on, those below where they grow,
  // and k = 0 but for the phase mode; the wavenumber that has it. Refined between the points: see
  // src/cycles/bloch.cpp.
  double growth_rate = 0, wavenumber = 0;
  std::complex<double> multiplier = 0;
  // The phase mode of a long wave grows at -diffusion k^2 + O(k^4); unit length^2/time. NaN under a load,
  // which sets the phase.
  double diffusion = 0;
  // Every deviation decays but the phase mode of k = 0, whose branch has a positive diffusion: no rate given
  // here is positive then. `decided`: false where a growth rate that matters is nearer to 0 than its error
  // and none grows.
  bool stable = false, decided = true;
  bool coupled = true;  // false: neighbours do not feel each other, every phase stays as it is
  // growth rate that waves tend to as k grows: of uniform motion of the continuum, else NaN
  double short_waves = 0;
  double largest_at_zero = 0;  // growth rate of the largest multiplier but the phase mode's at k = 0
  // largest growth rate of a wave that is not on the branch of the phase mode, near k = 0
  double largest_of_finite = 0;
};

// Of the waves on the cycle of a cell, `wavenumbers` of which are listed. Throws UsageError where the cell is
// no ring (its ends are not those of one of many).
BlochSpectrum bloch_spectrum(const SmoothCycle& cycle, int wavenumbers);
// With exact stick `course` is what described() says of the cycle. Throws Failure where waves have no linear
// answer: with viscosity between neighbours and nodes that begin to slip at once with a jump in their
// acceleration.
BlochSpectrum bloch_spectrum(const StickCycle& cycle, const Cycle& course, const Scene& cell,
                             int wavenumbers);

// What a branch watches besides the cycles' own multipliers: `long-wave` (the diffusion) and, where long
// waves decay, `wave` (the largest growth rate of a wave of finite length).
Watched watch_waves(const BlochSpectrum& spectrum);

}  // namespace stickslip
