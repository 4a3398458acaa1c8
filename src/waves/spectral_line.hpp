// The multipliers of a train's perturbations along a vertical line of the plane of lambda, and the curves on which the
// spectrum right of it lies.
//
// With y(lambda) = rho exp(-lambda T) for each multiplier rho (waves/transfer.hpp), lambda belongs to the ring of n
// pulses where y = exp(2 pi i M/n) for an integer M, and to the endless train where |y| = 1. By the argument principle
// the number of ring modes right of the line is that of the turns of det(Y - x) along it, and these are made where
// |y| > 1: every stretch (arc) of the line on which one of the y stands outside the unit circle carries as many modes
// as its phase passes multiples of 2 pi/n downwards. Nothing is said about frequencies between samples that a finer
// sampling would change: neighbours are matched, and samples added until they match.
//
// Each arc is the shadow of a curve |y| = 1 right of the line, which begins and ends where the arc does, and along
// which the phase takes the same values: the spectrum of the endless train. Followed by Newton's method from value to value.
#pragma once

#include <vector>

#include "waves/transfer.hpp"

namespace stickslip {

// ln y at a point of the line; its imaginary part goes on continuously along an arc.
struct ArcPoint {
  double omega;
  std::complex<double> log_y;
};
using Arc = std::vector<ArcPoint>;  // omega rising; the first and last point have |y| = 1

class SpectralLine {
 public:
  // Throws Failure where the multipliers cannot be computed.
  SpectralLine(Transfer& transfer, double sigma);
  double sigma() const { return sigma_; }
  double top() const { return top_; }  // samples reach from -top to top (Im lambda)
  // With viscosity: no multiplier was seen to meet the one that is left out (transfer.hpp), on the real axis right of the
  // line. Where they meet, the phases of an arc are not those of its curve.
  bool separate() const { return separate_; }
  bool closed() const { return closed_; }  // no wave beyond the samples was seen to grow faster than the line
  const std::vector<Arc>& arcs() const { return arcs_; }
  // Modes of a ring of `pulses` right of the line: all, and those of Bloch factor exp(2 pi i m/pulses).
  long long count(PetscInt pulses) const;
  long long count(PetscInt pulses, PetscInt m) const;

 private:
  struct Sample {
    double omega;
    Multipliers m;
  };
  Sample sample(double omega);
  double size(const Sample& s, int j) const;  // ln |y_j|
  bool matched(const Sample& a, const Sample& b) const;
  void scan();
  bool quiet_beyond(double& louder);
  bool seen_separate();
  ArcPoint crossing(const Sample& a, int i, const Sample& b, int j);
  void trace_arcs();

  Transfer& transfer_;
  double sigma_, top_, period_;
  bool closed_ = true, separate_ = true;
  std::vector<Sample> samples_;
  std::vector<Arc> arcs_;
};

// A point of a curve of the spectrum: ln rho there with its derivative; its phase is Im(ln rho - lambda T).
struct CurvePoint {
  std::complex<double> lambda, log_rho, slope;
  double phase(double period) const { return log_rho.imag() - lambda.imag() * period; }
};

// Moves along the curve to another phase, Re ln y = 0 to `tolerance`. False (p unchanged) where it is lost.
bool follow(Transfer& transfer, CurvePoint& p, double phase, double tolerance);

// The curve of an arc at the phases of its points. Shorter than the arc where it is lost on the way.
std::vector<CurvePoint> curve_of(Transfer& transfer, const Arc& arc, double sigma);

// Integers M with lo <= M <= hi: the modes y = exp(2 pi i M/pulses) of an arc (hi < lo: none).
struct ModeRange {
  long long lo, hi;
};
ModeRange modes_of(const Arc& arc, PetscInt pulses);

}  // namespace stickslip
