#include "stability/numerical_abscissa.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "base/broadcast.hpp"
#include "stability/modes.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/transient.hpp"

namespace stickslip {

// Of unequal masses psi has none: A (K0 - K1 D2) is not symmetric.
bool has_energy(const LinearisedOperator& J) {
  return J.symmetric() && !J.neutral() && !J.scene.massless() && !J.scene.medium.profile("model_m");
}

EnergyNorm::EnergyNorm(const LinearisedOperator& J) : J_(J) { J.factor(0, stiffness_); }

namespace {

Eigen::Map<Eigen::VectorXcd> view(std::vector<Complex>& x) { return {x.data(), Eigen::Index(x.size())}; }
// Of unknowns: a column a node, psi its first entry.
Eigen::Map<Eigen::MatrixXcd> by_nodes(std::vector<Complex>& x, const LinearisedOperator& J) {
  return {x.data(), Eigen::Index(J.dof()), Eigen::Index(J.size())};
}
auto weights(const LinearisedOperator& J) { return Eigen::VectorXd::Map(J.coupling.weight.data(), J.size()); }

}  // namespace

EnergyNorm::Vector EnergyNorm::apply(const Vector& x) const {
  Vector p(J_.size()), y = x;
  view(p) = by_nodes(y, J_).row(0);
  p = J_.apply(0, p);
  by_nodes(y, J_).row(0) = view(p) / J_.A;
  by_nodes(y, J_) *= weights(J_).asDiagonal();
  return y;
}

EnergyNorm::Vector EnergyNorm::solve(const Vector& x) const {
  Vector p(J_.size()), y = x;
  by_nodes(y, J_) *= weights(J_).cwiseInverse().asDiagonal();
  view(p) = J_.A * by_nodes(y, J_).row(0);
  J_.solve(stiffness_, p);
  by_nodes(y, J_).row(0) = view(p);
  return y;
}

double EnergyNorm::norm(const Vector& x) const { return std::sqrt(std::max(0., inner(x, apply(x)).real())); }

double largest_eigenvalue(const Eigen::VectorXd& diagonal, const Eigen::VectorXd& beside,
                          Eigen::VectorXd* vector) {
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(diagonal, beside,
                                vector ? Eigen::ComputeEigenvectors : Eigen::EigenvaluesOnly);
  if (solver.info() != Eigen::Success) throw Failure("no eigenvalues of a symmetric matrix were found");
  if (vector) *vector = solver.eigenvectors().rightCols(1);
  return solver.eigenvalues().maxCoeff();
}

double EnergyNorm::norm(const Map& forward, const Map& transposed, Vector& start, double tolerance,
                        int most) const {
  std::vector<Vector> basis, images;  // M-orthonormal, and M times them
  Eigen::VectorXd diagonal(most), beside(most), ritz;
  Vector x = start;
  double size = norm(x), value = 0;
  for (int k = 0; k < most; ++k) {
    view(x) /= size;
    basis.push_back(x);
    images.push_back(apply(x));
    x = solve(transposed(apply(forward(x))));
    diagonal[k] = inner(images.back(), x).real();
    for (int twice = 0; twice < 2; ++twice)
      for (std::size_t j = 0; j < basis.size(); ++j) view(x) -= inner(images[j], x) * view(basis[j]);
    size = norm(x);
    value = largest_eigenvalue(diagonal.head(k + 1), beside.head(k), &ritz);
    if (size * std::abs(ritz[k]) <= tolerance * value || size <= 1e-14 * value) break;
    beside[k] = size;
  }
  view(start).setZero();
  for (std::size_t j = 0; j < basis.size(); ++j) view(start) += ritz[j] * view(basis[j]);
  return std::sqrt(std::max(0., value));
}

std::vector<Complex> any_vector(std::size_t n, bool real) {
  std::vector<Complex> x(n);
  Noise noise;
  for (Complex& z : x) {
    const double re = noise.next();
    z = {re, real ? 0 : noise.next()};
  }
  return x;
}

double band_abscissa(const LinearisedOperator& J) {
  const std::size_t n = J.size(), d = J.dof();
  struct Term {
    std::size_t row, column;  // of the lower triangle
    double H, M;
  };
  std::vector<Term> terms;
  std::size_t band = 0;
  const auto add = [&](std::size_t i, std::size_t c, std::size_t j, std::size_t e, double H, double M = 0) {
    const std::size_t row = J.coupling.position(i) * d + c, column = J.coupling.position(j) * d + e;
    if (column > row) return;
    band = std::max(band, row - column);
    terms.push_back({row, column, H, M});
  };
  // the waves cancel in H: what is left of a node's block without K0 and K1
  std::vector<NodeBlock> block;
  for (std::size_t i = 0; i < n; ++i) {
    LinearPoint p = J.point(i);
    p.K0 = p.K1 = 0;
    block.push_back(p.block(Part::full));
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double w = J.coupling.weight[i];
    const auto coupled = [&](std::size_t j, double K) {  // K = (K0 - K1 D2)_ij
      const double M = w * K / J.A;
      add(i, 0, j, 0, M * (block[i].psi_psi + block[j].psi_psi) / 2, M);
      if (d < 3) return;
      add(i, 0, j, 2, M * block[j].psi_state / 2);
      add(j, 2, i, 0, M * block[j].psi_state / 2);
    };
    coupled(i, J.point(i).K0);
    for (const Coupling::Term& t : J.coupling.row(i)) coupled(t.column, J.K1 * t.value);
    add(i, 1, i, 0, w * block[i].eta_psi / 2);
    add(i, 1, i, 1, w * block[i].eta_eta, w);
    if (d < 3) continue;
    add(i, 2, i, 0, w * block[i].state_psi / 2);
    add(i, 2, i, 1, w * block[i].eta_state / 2);
    add(i, 2, i, 2, w * block[i].state_state, w);
  }
  std::vector<double> a;
  const auto beyond = [&](double mu) {
    a.assign(n * d * (band + 1), 0.);
    for (const Term& t : terms) a[t.row * (band + 1) + (t.column + band - t.row)] += mu * t.M - t.H;
    return positive_definite(a, n * d, band);
  };
  const double unit = std::sqrt(J.A * J.K0) + 1e-3 * std::sqrt(J.A * J.largest_stiffness());
  double low = -unit, high = unit;
  while (!beyond(high)) low = high, high *= 4;
  for (double step = unit; low == -step && beyond(low); low = -(step *= 4)) high = low;
  return last_place(beyond, high, low, 1e-10 * (unit + std::abs(low)));
}

// ---- the resolvent
// ------------------------------------------------------------------------------------------------

namespace {

double resolvent_norm_with(const LinearisedOperator& J, const EnergyNorm& energy, Complex z) {
  BandLU lu;
  J.factor(z, lu);
  const auto conjugated = [](std::vector<Complex> v) {
    view(v) = view(v).conjugate().eval();
    return v;
  };
  std::vector<Complex> x = any_vector(J.unknowns(), false);
  // J is real: the adjoint at z is the conjugate of the transposed at z
  return energy.norm([&](const auto& v) { return J.resolvent(z, lu, v); },
                     [&](const auto& v) { return conjugated(J.resolvent_transposed(z, lu, conjugated(v))); },
                     x, 1e-4, 40);
}

// The same where waves are exact, in closed form: the largest over the waves of the norm of a 2x2 matrix, in
// the energy's own unknowns sqrt(K/A) p and e. A state makes it 3x3, which is left to the iteration.
class WaveNorms {
 public:
  explicit WaveNorms(const LinearisedOperator& J) {
    if (J.dof() != 2) return;
    for (const LinearisedOperator::Wave& wave : J.exact_waves()) {
      const double kappa2 = J.symbol(wave.k), root = std::sqrt(J.point(0).stiffness(kappa2) / J.point(0).A);
      double rows[4];
      J.point(0).block(Part::full, kappa2).write(2, rows);
      blocks_.push_back({rows[0], rows[1] * root, rows[2] / root, rows[3]});
    }
  }
  bool known() const { return !blocks_.empty(); }
  // sigma_max(z - M)/|det(z - M)|
  double resolvent(Complex z) const {
    double largest = 0;
    for (const auto& [a, b, c, d] : blocks_) {
      const double determinant = std::norm((z - a) * (z - d) - b * c);
      const double squares = std::norm(z - a) + std::norm(z - d) + b * b + c * c;
      const double sigma = 0.5 * (squares + std::sqrt(std::max(0., squares * squares - 4 * determinant)));
      largest = std::max(largest, sigma / determinant);
    }
    return std::sqrt(largest);
  }

 private:
  std::vector<std::array<double, 4>> blocks_;
};

}  // namespace

double resolvent_norm(const LinearisedOperator& J, Complex z) {
  return has_energy(J) ? resolvent_norm_with(J, EnergyNorm(J), z) : std::nan("");
}

std::vector<double> pseudospectrum(MPI_Comm comm, const LinearisedOperator& J, const std::vector<double>& re,
                                   const std::vector<double>& im, const std::function<void(double)>& told) {
  if (!has_energy(J)) return {};
  const int ranks = ranks_in(comm), rank = rank_in(comm);
  const EnergyNorm energy(J);
  std::vector<double> norms(re.size() * im.size(), 0.);
  const WaveNorms waves(J);
  for (std::size_t k = rank; k < norms.size(); k += ranks) {
    const Complex z(re[k % re.size()], im[k / re.size()]);
    norms[k] = waves.known() ? waves.resolvent(z) : resolvent_norm_with(J, energy, z);
    if (told) told(double(k + 1) / double(norms.size()));
  }
  sum_over(comm, norms.data(), int(norms.size()));
  return norms;
}

}  // namespace stickslip
