// The equations linearised about steady sliding: how nodes hang together, the state, and S(lambda).
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

// How the nodes that are solved for hang together: -D2 among them, and their order in a banded matrix. Where
// links differ along x (model/medium.hpp) D2 is that of the links over the mean K1, so that K1 times it is
// what couples them.
//
// Held nodes carry no unknown; what couples to them stands in the row sums alone. Local to the process, which
// holds the whole line.
class Coupling {
 public:
  explicit Coupling(const Scene& scene);
  // `count` nodes from the first'th on, everything outside held.
  Coupling segment(std::size_t first, std::size_t count) const;

  // those solved for, node[0] < node[1] < ...; columns below are places in this list
  std::vector<PetscInt> node;
  std::vector<double> weight;  // inner product: 1, 1/2 at a free end of the continuum
  bool symmetric = true;       // D2 is symmetric in that inner product: but for held ends of order 4 and 6
  std::size_t size() const { return node.size(); }

  struct Term {
    std::size_t column;
    double value;  // 1/length^2 in the continuum, a number in the chain
  };
  struct Row {
    const Term *first, *last;
    const Term* begin() const { return first; }
    const Term* end() const { return last; }
  };
  // Row i of -D2. Its product with p is taken by differences, which keep the digits that 1/h^2 would eat.
  Row row(std::size_t i) const { return {terms_.data() + starts_[i], terms_.data() + starts_[i + 1]}; }
  std::vector<Complex> minus_d2(const std::vector<Complex>& p) const { return minus_d2(p, false); }
  // `plain`: of the stencil with equal links, in any case.
  std::vector<Complex> minus_d2(const std::vector<Complex>& p, bool plain) const;
  double largest_row() const;  // sum of |entries|

  // A ring is ordered 0, n-1, 1, n-2, ..., so that neighbours stay near each other in the band.
  std::size_t position(std::size_t i) const;
  int band() const { return band_; }
  // lu += factor (-D2), in that order; solves with the factors of such a matrix, b in the order of the nodes.
  void add_to(BandLU& lu, Complex factor) const;
  void solve(const BandLU& lu, std::vector<Complex>& b, bool transposed = false) const;

 private:
  Coupling() = default;
  void add_link_row(const Scene& scene, PetscInt node);
  void close_row();

  // Values of the rows' terms with equal links, where they are not; and of their sums.
  std::vector<double> plain_, plain_sum_;
  bool folded_ = false;
  int band_ = 0;
  std::vector<std::size_t> starts_{0};
  std::vector<Term> terms_;
  std::vector<double> row_sum_;
};

// Steady sliding: psi_i with K0 (v - psi) + K1 D2 psi = 0, the state at its steady value for psi_i, and eta =
// B psi + F - N D2 psi. Friction does not enter the equation for psi (B and delta are never both non-zero),
// so it is linear: psi = v without held ends, one banded solve for the boundary layers with them.
//
// Every rank holds the whole line. Not collective.
struct SteadySliding {
  // Throws Failure where the scene has no steady sliding (a threshold or a contact age at psi = 0).
  explicit SteadySliding(const Scene& scene);

  Scene scene;
  // At every node, held ones included: psi in length/time; the state as stored (friction.hpp), empty without
  // a state law; and the slopes of friction there.
  std::vector<double> psi, eta, state;
  std::vector<FrictionSlopes> slopes;
  // largest |eta_t|, |state_t| over the nodes solved for (psi_t = 0 by the choice of eta)
  double residual = 0;
};

// The operator J of perturbations of steady sliding.
//
// Perturbations (p, e, t) of (psi, eta, state) that grow like exp(lambda t). Everything but D2 acts node by
// node (model/linear_point.hpp), so e and t are eliminated node by node, and lambda is an eigenvalue when
// S(lambda) p = 0 has a solution,
//
//     S(lambda) = lambda [lambda/A_i + beta_i + q_i/(lambda + r_i)] + K0_i - (K1 + lambda N) D2
//     t = g_psi p/(lambda + r),       e = (lambda/A + B + F_psi - N D2) p + F_state t.
//
// Where a scene's medium differs along x, A and K0 are those of the node, and K1 D2 has links of its
// own; elsewhere they are the same at every node.
//
// S is banded (in bandwidth-reducing order round a ring), one complex unknown a node, so a factorisation, a
// solve and a determinant cost O(n). The characteristic polynomial of J is A^n prod(lambda + r_i) det
// S(lambda) (r only with a state). Held nodes carry no unknown. On a ring, between free ends, and at order 2
// between held ones, D2 is symmetric in the inner product of `weight`, and S is complex symmetric.
//
// Vectors p have one entry a node, vectors x of J `dof` entries a node (psi, eta, state; without mass eta,
// state), a node's together; lambda, growth rates and frequencies are in 1/time. Every rank holds the whole
// line: a spectrum is shared out by shifts and points, not by nodes. Not collective.
class LinearisedOperator {
 public:
  explicit LinearisedOperator(const SteadySliding& steady);
  // About the steady sliding of the scene; throws as that does.
  explicit LinearisedOperator(const Scene& s) : LinearisedOperator(SteadySliding(s)) {}
  // The operator on `count` nodes from the first'th of those solved for, everything outside held: what a mode
  // trapped there feels. Its scene is that of the whole.
  LinearisedOperator segment(std::size_t first, std::size_t count) const;

  Scene scene;
  double A, K0, K1, N;  // of a medium that differs along x the largest A and K0, the mean K1
  double rate;          // of the scene (model/scales.hpp)
  Coupling coupling;    // the nodes solved for
  bool uniform = true;  // the same at every node
  LinearPoint point(std::size_t i) const {
    LinearPoint p = nodes_.empty() ? medium_ : LinearPoint(scene, nodes_[i]);
    p.set(slopes_[i]);
    return p;
  }

  std::size_t size() const { return slopes_.size(); }
  bool symmetric() const { return coupling.symmetric; }
  bool has_state() const { return scene.friction.has_state(); }
  std::size_t fields() const { return has_state() ? 3 : 2; }
  std::size_t dof() const { return fields() - psi_entries(); }
  std::size_t unknowns() const { return size() * dof(); }
  // The uniform mode with lambda = 0: without K0 and held ends every velocity is a steady one. It is a
  // symmetry, not an instability.
  bool neutral() const { return K0 == 0 && size() == std::size_t(scene.n); }

  // ---- S, its factors and its solutions
  std::vector<Complex> apply(Complex lambda, const std::vector<Complex>& p) const;        // S p
  std::vector<Complex> apply_slope(Complex lambda, const std::vector<Complex>& p) const;  // dS/dlambda p
  // lu := factor S(lambda)
  void assemble(Complex lambda, Complex factor, BandLU& lu) const;
  // Factors S(lambda); the determinant returned is that of the characteristic polynomial, up to A^n.
  LogDet factor(Complex lambda, BandLU& lu) const;
  void solve(const BandLU& lu, std::vector<Complex>& b) const { coupling.solve(lu, b); }
  void solve_transposed(const BandLU& lu, std::vector<Complex>& b) const { coupling.solve(lu, b, true); }

  // ---- J
  // the eigenvector, from its psi
  std::vector<Complex> expand(Complex lambda, const std::vector<Complex>& p) const;
  // with psi in any case
  std::vector<Complex> expand_fields(Complex lambda, const std::vector<Complex>& p) const;
  // psi of node i, whose entries of a vector of J stand at x
  Complex psi_of(const Complex* x, std::size_t i) const;
  // |J x - lambda x|/|x| of it, x in the units of balance()
  double mode_residual(Complex lambda, const std::vector<Complex>& p) const;
  std::vector<Complex> multiply(const std::vector<Complex>& x) const;  // J x
  // (J - lambda)^-1 b, with S(lambda) factored in lu.
  std::vector<Complex> resolvent(Complex lambda, const BandLU& lu, const std::vector<Complex>& b) const;
  struct Entry {
    std::size_t row, column;
    double value;
  };
  std::vector<Entry> entries() const;  // of J, those at one place to be added up
  // Units of the `dof` entries of a node in which J is balanced (stickslip::balance), the same at every node.
  std::vector<double> balance() const;

  // ---- waves: shapes of wavenumber k, 1/length
  double spacing() const { return scene.form == Form::chain ? 1 : scene.h(); }
  double symbol(double k) const;                               // of -D2, kappa^2
  double largest_symbol() const;                               // that of the grid scale
  double rate_of(double K) const { return mean_.rate_of(K); }  // LinearPoint; of the mean medium
  double largest_stiffness() const { return K0 + K1 * largest_symbol(); }
  double viscous_rate() const { return A * N * largest_symbol(); }  // at which the shortest wave is damped
  Complex coupling_factor(Complex lambda) const { return K1 + lambda * N; }  // what D2 is multiplied by in S
  // The wavenumber in [0, pi/h] whose symbol is the weighted mean of -D2 over p.
  double wavenumber(const std::vector<Complex>& p) const;
  // Relative error in frequency of a wave of wavenumber k on this grid; 0 in the chain, where the grid is the
  // matter.
  double dispersion_error(double k) const;
  // The medium with the mean coefficients (of F_state and g_psi their product alone); where all nodes are
  // alike, that of the first. At least one node.
  const LinearPoint& mean() const { return mean_; }
  // Whether every mode is a wave of the exact dispersion relation (fastest_wave.hpp): nodes alike, ends that
  // fit.
  bool has_exact_waves() const { return uniform && symmetric() && size() > 0; }
  // Their wavenumbers, ascending, each with its multiplicity; empty where they are not.
  struct Wave {
    double k;
    int multiplicity;
  };
  std::vector<Wave> exact_waves() const;
  // psi of the wave of such a wavenumber at the nodes: travelling round a ring, else standing and fitting the
  // ends.
  std::vector<Complex> wave(double k) const;

  // ---- what no eigenvalue exceeds: |Im| and Re. Rigorous (docs/developers/algorithms.md).
  double imaginary_bound() const;
  double real_bound() const;

 private:
  std::size_t psi_entries() const { return scene.massless() ? 1 : 0; }  // that vectors of J do not have
  NodeVector node_of(const std::vector<Complex>& x, std::size_t i) const;
  void put(const NodeVector& v, std::size_t i, std::vector<Complex>& x) const;
  LinearPoint find_mean() const;
  void refuse_rates_too_large() const;
  std::vector<Entry> massless_entries() const;
  double massless_bound(double stiff, double r, double q) const;
  LinearisedOperator(const LinearisedOperator& whole, std::size_t first, std::size_t count);
  void add_viscous(const std::vector<Complex>& p, std::size_t stride, std::size_t first,
                   std::vector<Complex>& x, double factor = 1) const;

  LinearPoint medium_, mean_;            // medium: without friction
  std::vector<NodeCoefficients> nodes_;  // none where all have those of `medium_`
  std::vector<FrictionSlopes> slopes_;
};

// Units of psi, eta and state in which what drives psi and what psi drives are alike in size: powers of two
// near sqrt(K0/A) for eta and sqrt(|g_psi/(A F_state)|) for the state, 1 for psi. So balanced, the operator
// in any units of length, time and force is the same up to a power of two.
std::array<double, 3> balance(const LinearPoint& medium);

// lambda of the waves with that kappa^2 in a medium alike everywhere: two roots, or three with a state.
std::vector<Complex> dispersion(const LinearPoint& medium, double kappa2);

}  // namespace stickslip
