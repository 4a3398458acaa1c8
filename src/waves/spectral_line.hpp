// What a perturbation of a train becomes over one period of the train, as a function of its exponent lambda.
//
// A perturbation exp(lambda t) (P, E[, S])(xi), xi = t - x/V, is exp(Lambda x) Q(xi) with Lambda = lambda/V
// and Q = exp(lambda xi) P: a wave of wavenumber Im Lambda as it is seen at a fixed place. Q varies as slowly
// as the uniform oscillation's perturbations do, however fast the train is, while P turns |lambda| T times a
// period. With the Jacobian J of the oscillator (model/oscillator.hpp), kappa = K1/V^2 and Z = E - kappa P' +
// (2 K1 Lambda/V + s delta/A) P, in the variables of Q,
//     P' = (J00 - 2 c^2 Lambda/(V r2)) P + J01 Z + J02 S
//     Z' = (J10 + K1 Lambda^2) P
//     S' = g_psi P + g_s S
// For V -> infinity at fixed Lambda it becomes the uniform oscillation's Floquet-Bloch problem.
#pragma once

#include <complex>
#include <map>
#include <memory>
#include <vector>

#include "stickslip/numerics/periodic_equations.hpp"
#include "stickslip/waves/train.hpp"

namespace stickslip {

// Logarithms of the multipliers of Q over one period, largest modulus first; imaginary parts within (-pi,
// pi]. A perturbation with Bloch factor exp(i theta) needs ln rho = lambda T + i theta for one of them.
struct Multipliers {
  int count = 0;
  std::complex<double> log_rho[train_max_dim];
};

// C = A (B + F_psi) + s delta over a period of the train, by time: its mean (the shortest waves decay at half
// of it), the largest of -C and the frequency of a free point, beside which large C are peaks, and the mean
// of |dC/dt|.
struct TrainDamping {
  double mean, usual, slope;
};

class TransferMesh;

// The multipliers of a train by collocation (five stages), on the train's mesh with its intervals divided
// where a wave of this lambda is fast: Gauss, and Radau IIA where P follows Z at once. Not collective.
class Transfer {
 public:
  Transfer(const Train& train, int refine);  // refine: every interval is divided into so many pieces at least
  ~Transfer();
  // Throws Failure where too many pieces would be needed.
  Multipliers at(std::complex<double> lambda);
  const Train& train() const { return train_; }
  TrainDamping damping() const;
  double damping_within(double most) const;  // the mean of min(C, most)
  // c times a wavenumber beyond which no wave grows faster than `growth` > -mean C/2: see transfer.cpp.
  double top_frequency(double growth) const;

 private:
  const TransferMesh& mesh_for(double frequency);
  const Train& train_;
  int refine_;
  std::map<int, std::unique_ptr<TransferMesh>> meshes_;  // for frequencies c |Lambda| up to 2^key
};

// The multipliers of a train's perturbations along a vertical line of the plane of lambda, and the curves on
// which the spectrum right of it lies.
//
// With y(lambda) = rho exp(-lambda T) for each multiplier rho (Transfer), lambda belongs to the ring of n
// pulses where y = exp(2 pi i M/n) for an integer M, and to the infinite train where |y| = 1. By the argument
// principle the number of ring modes right of the line is that of the turns of det(Y - x) along
// it, and these are made where |y| > 1: every stretch (arc) of the line on which one of the y stands outside
// the unit circle carries as many modes as its phase passes multiples of 2 pi/n downwards. Nothing is said
// about frequencies between samples that a finer sampling would change: neighbours are matched, and samples
// added until they match.
//
// The modes themselves lie on curves |y| = 1 right of the line, which begin and end where arcs do (below).

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
  // With viscosity: no multiplier was seen to meet the one that is left out, on the real axis
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

// The curves on which the spectrum of the infinite train lies right of a line, |y| = 1
// (waves/spectral_line.hpp).
//
// A curve leaves the line where one of its arcs begins and comes back where one ends: its own, unless
// multipliers meet right of the line. Along it ln y turns steadily, so that Newton's method goes from phase
// to phase; its steps are as short as it takes for each to lead where the slopes at its ends say. The curves
// are all there are where each arc is the beginning of one and the end of one, and where their phases
// together turn by as much as those of the arcs: by the argument principle nothing lies right of the line
// besides.

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
