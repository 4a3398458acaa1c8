// The curves on which the spectrum of the infinite train lies right of a line, |y| = 1
// (waves/spectral_line.hpp).
//
// A curve leaves the line where one of its arcs begins and comes back where one ends: its own, unless
// multipliers meet right of the line. Along it ln y turns steadily, so that Newton's method goes from phase
// to phase; its steps are as short as it takes for each to lead where the slopes at its ends say. The curves
// are all there are where each arc is the beginning of one and the end of one, and where their phases
// together turn by as much as those of the arcs: by the argument principle nothing lies right of the line
// besides.
#pragma once

#include "waves/spectral_line.hpp"

namespace stickslip {

// A point of a curve of the spectrum: ln rho there with its derivative; its phase is Im(ln rho - lambda T).
struct CurvePoint {
  std::complex<double> lambda, log_rho, slope;
  double phase(double period) const { return log_rho.imag() - lambda.imag() * period; }
};

// Moves along the curve to another phase, Re ln y = 0 to `tolerance`. False (p unchanged) where it is lost.
bool follow(Transfer& transfer, CurvePoint& p, double phase, double tolerance);

struct SpectralCurve {
  std::vector<CurvePoint> points;  // the phase falls; with every summit of the growth rate among them
  // its mirror image at the frequencies of other sign is another curve, not in the list
  bool has_image = false;

  ModeRange modes(double period, PetscInt pulses) const;
  // The place of mode M by interpolation, and the point next to it.
  std::complex<double> lambda_near(double phase, double period, std::size_t& nearest) const;
  bool is_summit(std::size_t k) const;
};

struct SpectralCurves {
  std::vector<SpectralCurve> list;  // those that were followed to their end
  bool whole = false;               // nothing lies right of the line that is not on one of them
};

SpectralCurves curves_of(Transfer& transfer, const SpectralLine& line);

}  // namespace stickslip
