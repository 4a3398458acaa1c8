// The multipliers of a train's perturbations along a vertical line of the plane of lambda, and the curves on
// which the spectrum right of it lies.
//
// With y(lambda) = rho exp(-lambda T) for each multiplier rho (waves/transfer.hpp), lambda belongs to the
// ring of n pulses where y = exp(2 pi i M/n) for an integer M, and to the infinite train where |y| = 1. By
// the argument principle the number of ring modes right of the line is that of the turns of det(Y - x) along
// it, and these are made where |y| > 1: every stretch (arc) of the line on which one of the y stands outside
// the unit circle carries as many modes as its phase passes multiples of 2 pi/n downwards. Nothing is said
// about frequencies between samples that a finer sampling would change: neighbours are matched, and samples
// added until they match.
//
// The modes themselves lie on curves |y| = 1 right of the line, which begin and end where arcs do:
// waves/spectral_curves.hpp.
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
  // With viscosity: no multiplier was seen to meet the one that is left out (transfer.hpp), on the real axis
  // right of the line. Where they meet, the phases of an arc are not those of its curve.
  // No wave beyond the samples was seen to grow faster than the line, and all samples matched their
  // neighbours.
  bool closed() const { return closed_; }
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
  ArcPoint crossing(const Sample& a, int i, const Sample& b, int j);
  void trace_arcs();

  Transfer& transfer_;
  double sigma_, top_, period_;
  bool closed_ = true;
  std::vector<Sample> samples_;
  std::vector<Arc> arcs_;
};

// Integers M with lo <= M <= hi: the modes y = exp(2 pi i M/pulses) on the way of the phase down from `first`
// to `last` (hi < lo: none), or of an arc.
struct ModeRange {
  long long lo, hi;
};
ModeRange modes_between(double first, double last, PetscInt pulses);
ModeRange modes_of(const Arc& arc, PetscInt pulses);

// The difference of two logarithms, its imaginary part within [-pi, pi].
std::complex<double> apart(std::complex<double> a, std::complex<double> b);
// The multiplier nearest to `log_rho`; how near it and the next nearest are.
int nearest(const Multipliers& m, std::complex<double> log_rho, double& distance, double& second);
int nearest(const Multipliers& m, std::complex<double> log_rho);

}  // namespace stickslip
