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

#include "stickslip/waves/train.hpp"
#include "stickslip/numerics/periodic_mesh.hpp"

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

}  // namespace stickslip
