// Spectral stability of a train of pulses, on its ring and on the endless line.
//
// In the frame of the train, xi = t - x/V, perturbations exp(lambda t) (P, E[, S])(xi) of (psi, eta[, state]) obey,
// with Z = E - (K1/V^2) P' + (s delta/A) P and kappa = K1/V^2,
//     r2 P' = A [Z - (Bd + F_psi) P - F_s S] - lambda P
//     Z'    = -K0 P - lambda (Z + kappa P')
//     S'    = g_psi P + g_s S - lambda S
// over one period, closed by P(T) = exp(i theta) P(0) and so on. theta = 2 pi m/n, m = 0..n-1, are all perturbations
// of a ring with n pulses, for they split by their symmetry; any theta, those of the endless train. With Gauss
// collocation this is K y = lambda M y, whose eigenvalues near given shifts SLEPc finds (shift-and-invert by one
// cyclic elimination, complex numbers as pairs of reals). Each is then computed again on a mesh twice as fine, by
// Newton's method on det[Y(lambda) - exp(i theta)] with Y the matrix that carries (P, Z, S) round a period; where the
// two disagree the eigenvalue is marked as not resolved.
//
// The same determinant, followed along a vertical line, counts the eigenvalues to the right of it (short waves decay
// at half the mean of C = A (B + F_psi) + s delta, which is positive on an attracting orbit, so that the count needs
// a finite piece of the line only): the check that none is missing. No theta has an eigenvalue right of a line on
// which both eigenvalues of Y lie inside the unit circle: the endless train.
#pragma once

#include <complex>
#include <string>
#include <vector>

#include "stickslip/wave.hpp"

namespace stickslip {

struct TrainMode {
  std::complex<double> lambda;
  double residual = 0;    // of the eigenproblem, relative
  PetscInt bloch = 0;     // m
  double wavenumber = 0;  // -2 pi m/L to the right, 2 pi m/L to the left, m taken between -n/2 and n/2
  bool resolved = false;
  bool translation = false;  // the derivative of the train itself: lambda = 0 exactly
};

struct TrainSpectrum {
  std::vector<TrainMode> modes;   // sorted by real part, rightmost first; at most `count`
  double translation_error = 0;   // |lambda| of the translation mode as computed
  double growth_rate = 0;         // largest real part, the translation mode excepted
  bool stable = false;            // growth_rate below minus its error
  bool complete = false;          // the count along a line agrees with what was found right of it
  std::string completeness_check;
  // The endless train: largest growth rate over all wavelengths and where it is reached (0, 0 where nothing grows).
  double endless_growth = 0, endless_wavenumber = 0, endless_frequency = 0;
  bool endless_stable = false;
};

// Spectrum of the ring's train: the `count` rightmost eigenvalues. `library_options`: EPS listens to -eps_ options.
// Throws Failure where V is so near to c that the waves running with the train cannot be resolved.
TrainSpectrum train_spectrum(const Train& train, int count, bool library_options = false);

// The endless train alone, which is quicker: fills the members named so.
TrainSpectrum endless_stability(const Train& train);

// How many eigenvalues lie right of Re lambda = 1e-5 for each theta = 2 pi m/n, m = 0..n/2 (those of n - m are their
// conjugates), by the argument of the determinant alone; all 1 where waves of any short length grow.
std::vector<int> growing_modes(const Train& train);

// Eigenvalues of Y(lambda): the Bloch factors that lambda belongs to.
std::vector<std::complex<double>> bloch_factors(const Train& train, std::complex<double> lambda);

}  // namespace stickslip
