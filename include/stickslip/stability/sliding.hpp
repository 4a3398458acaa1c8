// Steady sliding and the operator linearised about it.
//
// Steady sliding: psi_i with K0 (v - psi) + K1 D2 psi = 0, the state at its steady value for psi_i, and
// eta = B psi + F. Friction does not enter the equation for psi (B and delta are never both non-zero), so it is linear:
// psi = v without held ends, one banded solve for the boundary layers with them.
//
// Perturbations (p, e, t) of (psi, eta, state) that grow like exp(lambda t). Everything but D2 acts node by node, so e
// and t are eliminated node by node, and lambda is an eigenvalue when S(lambda) p = 0 has a solution,
//
//     S(lambda) = lambda^2/A + lambda [beta_i + q_i/(lambda + r_i)] + K0 - K1 D2
//     beta = B + s delta/A + F_psi,   q = F_state g_psi,   r = -g_state
//     t = g_psi p/(lambda + r),       e = (lambda/A + B + F_psi) p + F_state t.
//
// S is banded (folded round a ring), one complex unknown a node, so a factorisation, a solve and a determinant cost
// O(n). The characteristic polynomial of the whole operator is A^n prod(lambda + r_i) det S(lambda) (r only with a
// state). Held nodes carry no unknown. On a ring, between free ends, and at order 2 between held ones, D2 is symmetric
// in the inner product of `weight`, and S is complex symmetric.
//
// Every rank holds the whole line: a spectrum is shared out by shifts and points, not by nodes. Not collective.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "stickslip/numerics/band.hpp"
#include "stickslip/model/scene.hpp"

namespace stickslip {

class Sliding {
 public:
  // Throws Failure where the scene has no steady sliding (a threshold or a contact age at psi = 0).
  explicit Sliding(const Scene& scene);

  Scene scene;
  double A, B, K0, K1, s_delta;

  // Steady sliding at every node; state as stored (friction.hpp), empty without a state law.
  std::vector<double> psi, eta, state;
  double residual = 0;  // largest |psi_t|, |eta_t|, |state_t| over the nodes solved for

  // The linear operator at the nodes solved for, node[0] < node[1] < ...
  std::vector<PetscInt> node;
  std::vector<double> F_psi, F_state, g_psi, r;  // the last three empty without a state law
  std::vector<double> beta;
  std::vector<double> weight;  // inner product: 1, 1/2 at a free end of the continuum
  bool symmetric = true;       // D2 is symmetric in that inner product
  bool uniform = true;         // the same coefficients at every node

  // The operator on `count` nodes from the first'th of those solved for, everything outside held: what a mode trapped
  // there feels. Its scene is that of the whole; it has no steady state of its own.
  Sliding segment(std::size_t first, std::size_t count) const;

  std::size_t size() const { return node.size(); }
  bool has_state() const { return !r.empty(); }
  std::size_t dof() const { return has_state() ? 3 : 2; }
  // The uniform mode with lambda = 0: without K0 and held ends every velocity is a steady one. It is a symmetry, not
  // an instability.
  bool neutral() const { return K0 == 0 && node.size() == std::size_t(scene.n); }

  // Diagonal of S without K0 - K1 D2, and its derivative with respect to lambda.
  Complex pointwise(std::size_t i, Complex lambda) const;
  Complex pointwise_slope(std::size_t i, Complex lambda) const;
  std::vector<Complex> apply(Complex lambda, const std::vector<Complex>& p) const;        // S p
  std::vector<Complex> apply_slope(Complex lambda, const std::vector<Complex>& p) const;  // S' p
  std::vector<Complex> minus_d2(const std::vector<Complex>& p) const;

  // Factors S(lambda); the determinant returned is that of the characteristic polynomial, up to A^n.
  LogDet factor(Complex lambda, BandLU& lu) const;
  // The phase of det S(lambda), turned continuously from 0 at real lambda far to the right. For lambda with
  // Re lambda >= right_of_all(): there S/lambda has a positive real part, or is diagonally dominant, and so have its
  // pivots.
  double phase_right(Complex lambda) const;
  double right_of_all() const;
  // The turn of the phase of det S from one place to another, both well to the right of all eigenvalues, by its pivots,
  // each followed in steps over which it changes by less than half. Empty where that takes too many steps.
  std::optional<double> follow_pivots(Complex from, Complex to) const;
  void solve(const BandLU& lu, std::vector<Complex>& b) const;
  void solve_transposed(const BandLU& lu, std::vector<Complex>& b) const;

  // The whole eigenvector, unknowns of a node together (psi, eta, state), from its psi; and |J x - lambda x|/|x|.
  std::vector<Complex> expand(Complex lambda, const std::vector<Complex>& p) const;
  double mode_residual(Complex lambda, const std::vector<Complex>& p) const;
  // y = (J - sigma)^-1 b, unknowns of a node together, with S(sigma) factored in lu.
  void solve_shifted(Complex sigma, const BandLU& lu, const double* b, Complex* y) const;
  void multiply(const Complex* x, Complex* y) const;  // y = J x
  // The nonzero entries (row, column, value) of J.
  struct Entry {
    std::size_t row, column;
    double value;
  };
  std::vector<Entry> entries() const;
  // Row i of -D2 at the nodes solved for: (column, value).
  std::vector<std::pair<std::size_t, double>> coupling_row(std::size_t i) const;

  // K0 + K1 kappa^2 of a mode's shape, as a weighted mean, and the wavenumber with that symbol, in [0, pi/h].
  double stiffness(const std::vector<Complex>& p) const;
  double wavenumber(const std::vector<Complex>& p) const;
  // Relative error in frequency of a wave of wavenumber k on this grid; 0 in the chain, where the grid is the matter.
  double dispersion_error(double k) const;

  // Roots lambda of the dispersion relation for stiffness K = K0 + K1 kappa^2, with the coefficients given.
  std::vector<Complex> dispersion(double K, double mean_beta, double mean_q, double mean_r) const;
  double mean_beta() const;
  double mean_q() const;
  double mean_r() const;
  // Wavenumbers of all modes where the exact relation applies (`uniform`, and ends that fit), ascending, each with its
  // multiplicity; else empty.
  struct Wave {
    double k;
    int multiplicity;
  };
  std::vector<Wave> exact_waves() const;

  double largest_stiffness() const;  // K0 + K1 times the largest kappa^2 of the grid

  // What no eigenvalue exceeds: |Im| and Re. Rigorous (docs/spectrum.md).
  double imaginary_bound() const;
  double real_bound() const;

 private:
  struct Term {
    int column;
    double value;
  };
  std::vector<int> row_start_;  // -D2 at the nodes solved for, row by row
  std::vector<Term> minus_d2_;
  std::vector<double> row_sum_;  // of those rows: differences psi_j - psi_i keep the digits that 1/h^2 would eat
  std::vector<int> position_;  // place of a node in the folded order
  int band_ = 0;
  Sliding(const Sliding& whole, std::size_t first, std::size_t count);
  void fill(Complex lambda, Complex factor, BandLU& lu) const;  // lu := factor S(lambda)
  void steady_velocity();
};

// Roots of a quadratic or cubic with real coefficients, highest power first.
std::vector<Complex> polynomial_roots(const std::vector<double>& coefficients);

}  // namespace stickslip
