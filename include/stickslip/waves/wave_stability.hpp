// Spectral stability of a train of pulses, on its ring and on the infinite line.
//
// In the frame of the train, xi = t - x/V, perturbations exp(lambda t) (P, E[, S])(xi) of (psi, eta[, state])
// obey, with Z = E - (K1/V^2) P' + (s delta/A) P and kappa = K1/V^2,
//     r2 P' = A [Z - (Bd + F_psi) P - F_s S] - lambda P
//     Z'    = -K0 P - lambda (Z + kappa P')
//     S'    = g_psi P + g_s S - lambda S
// over one period, closed by P(T) = exp(i theta) P(0) and so on. theta = 2 pi m/n, m = 0..n-1, are all
// perturbations of a ring with n pulses, for they split by their symmetry; any theta, those of the endless
// train.
//
// The equations are solved for Q = exp(lambda xi) P, which varies no faster than waves of wavenumber Im
// lambda/V in a medium at rest do: a fast train is seen as the uniform oscillation that it nearly is, with
// eigenvalues measured from the carrier frequency V k. lambda is an eigenvalue where ln rho(lambda) = lambda
// T + i theta for a multiplier rho of Q over a period. The argument of the determinant along a vertical line,
// from -i infinity to i infinity, counts the eigenvalues to the right of it, for every theta at once; they
// lie on the curves |rho exp(-lambda T)| = 1, one for each stretch of the line that counts, and are found
// there by Newton's method, phase by phase, on two meshes (the curves account for every mode counted, or the
// list is not called whole: src/waves/spectral_line.hpp); where these disagree the eigenvalue is marked as
// not resolved. Short waves decay at half the mean of C = A (B + F_psi) + s delta, which is positive on an
// attracting orbit, so that a line right of that has finitely many to its right and needs to be followed to a
// finite frequency only.
//
// Source: the argument principle for an Evans function with Bloch factors, R. A. Gardner, J. Math. Pures
// Appl. 72 (1993) 415-439; the Q form: this program. Everything here is computed alike on every rank.
#pragma once

#include <complex>
#include <string>
#include <vector>

#include "stickslip/waves/train.hpp"

namespace stickslip {

struct TrainMode {
  std::complex<double> lambda;
  double residual = 0;    // change on a mesh twice as fine, relative to 1 + c |lambda/V|
  PetscInt bloch = 0;     // m
  double wavenumber = 0;  // -2 pi m/L to the right, 2 pi m/L to the left, m taken between -n/2 and n/2
  bool resolved = false;
  bool translation = false;  // the derivative of the train itself: lambda = 0 exactly
};

struct TrainSpectrum {
  std::vector<TrainMode> modes;  // the rightmost, sorted by real part; at most `count`
  double translation_error = 0;  // |lambda| of the translation mode as computed
  // Largest real part, the translation mode excepted; NaN where no other mode was found. `growth_bound`: none
  // is larger, if the list is complete.
  double growth_rate = 0, growth_bound = 0;
  bool growth_known = true;  // false: of a list that is not complete, beside which others may grow faster
  // `known`: whether the train is stable; it is where the list is complete and growth_bound below minus its
  // error, and is not where a mode grows by more than that.
  bool stable = false, known = false;
  // None is missing right of the last one listed, and none is listed twice: all the modes counted right of a
  // line were found, or, where they are more than asked for, the curves on which they lie were followed from
  // end to end, account for every one counted, and the rightmost were found on them; the translation mode is
  // among them unless as many grow.
  bool complete = false;
  std::string completeness_check;
  // The infinite train: largest growth rate over all wavelengths and where it is reached (0, 0 where nothing
  // grows; NaN where nothing was found that grows, and not all was seen: infinite_known is false).
  double infinite_growth = 0, infinite_wavenumber = 0, infinite_frequency = 0;
  bool infinite_stable = false, infinite_known = false;
};

// Spectrum of the ring's train: the `count` rightmost eigenvalues, fewer where fewer lie right of half the
// decay rate of short waves. For V/c - 1 below 1e-7 nothing is computed: `complete` is false,
// `completeness_check` gives the reason, and the rates are NaN.
TrainSpectrum train_spectrum(const Train& train, int count);

// The infinite train alone, which is quicker: fills the members named so.
TrainSpectrum infinite_train_stability(const Train& train);

// Takes the eigenvalue of a mode to another train of as many pulses near by, at the same Bloch factor, by
// Newton's method. False where it is lost.
bool follow_mode(const Train& train, TrainMode& mode);

// How many eigenvalues lie right of Re lambda = 1e-5 for each theta = 2 pi m/n, m = 0..n/2 (those of n - m
// are their conjugates), by the argument of the determinant alone; all 1 where waves of any short length
// grow. Where a kink of the friction leaves the translation mode further right, right of that. Throws Failure
// where the count is not known, as for V/c - 1 below 1e-7.
std::vector<int> growing_modes(const Train& train);

// Eigenvalues of Y(lambda): the Bloch factors that lambda belongs to.
std::vector<std::complex<double>> bloch_factors(const Train& train, std::complex<double> lambda);

}  // namespace stickslip
