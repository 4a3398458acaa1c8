// The numerical abscissa on many nodes, a bound of the eigenvalues: no perturbation grows faster at first in
// the energy norm of transient.hpp, and no eigenvalue has a larger real part. With it the norm itself, which
// the norms of exp(J t) and of the resolvent are taken in as well: by banded matrices and Lanczos' iteration.
// Not collective.
//
// Source: L. N. Trefethen and M. Embree, Spectra and Pseudospectra, Princeton 2005, section 17.
#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>

#include "stickslip/stability/linearised_operator.hpp"

namespace stickslip {

// Whether there is such a norm.
bool has_energy(const LinearisedOperator& J);

// The energy's matrix M = diag(W K/A, W, W), unknowns of a node together; it is applied and inverted by its
// blocks.
class EnergyNorm {
 public:
  using Vector = std::vector<Complex>;
  using Map = std::function<Vector(const Vector&)>;

  // Keeps a reference to J.
  explicit EnergyNorm(const LinearisedOperator& J);
  Vector apply(const Vector& x) const;  // M x
  Vector solve(const Vector& x) const;  // M^-1 x
  double norm(const Vector& x) const;
  // The norm of a linear map given with its transpose (conjugated), by Lanczos' iteration on their product,
  // of at most `most` steps; `start` is the first vector and becomes the right singular vector.
  double norm(const Map& forward, const Map& transposed, Vector& start, double tolerance, int most) const;

 private:
  const LinearisedOperator& J_;
  BandLU stiffness_;  // of K = S(0)
};

// Of a symmetric tridiagonal matrix; `vector`, if asked for, becomes the eigenvector.
double largest_eigenvalue(const Eigen::VectorXd& diagonal, const Eigen::VectorXd& beside,
                          Eigen::VectorXd* vector = nullptr);

// A vector that favours no wave and no place, the same in every run.
std::vector<Complex> any_vector(std::size_t n, bool real);

// The numerical abscissa: the largest eigenvalue mu of H x = mu M x, H = (M J + J^T M)/2, by halving to 1e-10
// of the frequencies: mu M - H is positive definite for every mu beyond it. Re lambda <= mu for every
// eigenvalue lambda of J, as Re (x* M J x) = x* H x.
double band_abscissa(const LinearisedOperator& J);

}  // namespace stickslip
