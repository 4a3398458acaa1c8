// The chain that carries deviations round a cycle for many waves: each link a step by collocation or a jump.
//
// A wave changes the equations y' = J(t) y of a cell's deviations by what a few velocities feed into a few
// rates,
//     y' = J y + sum_ab w_ab u_a psi_b,
// w its weights (`LowRankCoupling`). What does not depend on w is eliminated once for each link; a wave
// leaves a system of as many unknowns as there are psi_b at the stages. Local to the process.
#pragma once

#include <complex>
#include <vector>

#include "stickslip/numerics/collocation.hpp"

namespace stickslip {

// u_a, each as long as the unknowns, and the places of psi_b among them; as many of the one as of the other,
// r. Where psi is no unknown it is a sum over `width` of them from there on, whose factors go with the
// motion: `by` has those of every b at each point of a step in turn.
struct LowRankCoupling {
  std::vector<std::vector<double>> into = {};
  std::vector<std::size_t> of = {};
  std::size_t width = 1;
  std::vector<double> by = {};  // empty: psi_b is the unknown
};

class IntervalPropagator {
 public:
  // A step of length h: J at the five points of `method`, d x d each, of half band `band`. Throws Failure
  // where it is singular.
  IntervalPropagator(const Collocation& method, int d, int band, double h, const double* J,
                     const LowRankCoupling& feed);
  // A matrix, d x d, with a jump that adds w_ab u_a psi_b to it.
  IntervalPropagator(int d, std::vector<double> matrix, const LowRankCoupling& feed);

  // Appends its matrix, d x d, with the weights w, r x r.
  template <class T>
  void carry(const T* w, std::vector<T>& matrices) const;

 private:
  std::size_t d_, r_, points_;  // points_ at which psi_b is fed back
  // row-major: of y at the beginning, of what u_a is given at the points
  std::vector<double> end_, end_of_u_, psi_, psi_of_u_;
};

// Floquet multipliers of a wave, largest first.
template <class T>
std::vector<std::complex<double>> multipliers_of(int d, const std::vector<IntervalPropagator>& links,
                                                 const std::vector<T>& w);

}  // namespace stickslip
