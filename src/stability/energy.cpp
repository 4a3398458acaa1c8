#include "stability/energy.hpp"

#include <petscsys.h>
// after petscsys.h
#include <petscblaslapack.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "stability/modes.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/transient.hpp"

namespace stickslip {

bool has_energy(const LinearisedOperator& J) { return J.symmetric() && !J.neutral() && !J.scene.massless(); }

EnergyNorm::EnergyNorm(const LinearisedOperator& J) : J_(J) { J.factor(0, stiffness_); }

EnergyNorm::Vector EnergyNorm::apply(const Vector& x) const {
  const std::size_t n = J_.size(), d = J_.dof();
  Vector p(n), y(x.size());
  for (std::size_t i = 0; i < n; ++i) p[i] = x[i * d];
  p = J_.apply(0, p);
  for (std::size_t i = 0; i < n; ++i) {
    const double w = J_.coupling.weight[i];
    y[i * d] = w * p[i] / J_.A;
    for (std::size_t c = 1; c < d; ++c) y[i * d + c] = w * x[i * d + c];
  }
  return y;
}

EnergyNorm::Vector EnergyNorm::solve(const Vector& x) const {
  const std::size_t n = J_.size(), d = J_.dof();
  Vector p(n), y(x.size());
  for (std::size_t i = 0; i < n; ++i) p[i] = J_.A * x[i * d] / J_.coupling.weight[i];
  J_.solve(stiffness_, p);
  for (std::size_t i = 0; i < n; ++i) {
    y[i * d] = p[i];
    for (std::size_t c = 1; c < d; ++c) y[i * d + c] = x[i * d + c] / J_.coupling.weight[i];
  }
  return y;
}

double EnergyNorm::norm(const Vector& x) const { return std::sqrt(std::max(0., inner(x, apply(x)).real())); }

namespace {

// The largest eigenvalue of a symmetric tridiagonal matrix, and its eigenvector.
double largest_ritz(const std::vector<double>& diagonal, const std::vector<double>& beside,
                    std::vector<double>& vector) {
  const std::size_t m = diagonal.size();
  std::vector<double> T(m * m, 0.), values(m), work(8 * m);
  for (std::size_t i = 0; i < m; ++i) {
    T[i * m + i] = diagonal[i];
    if (i > 0) T[(i - 1) * m + i] = beside[i - 1];
  }
  const PetscBLASInt size = PetscBLASInt(m), room = 8 * size;
  PetscBLASInt info = 0;
  LAPACKsyev_("V", "L", &size, T.data(), &size, values.data(), work.data(), &room, &info);
  if (info != 0) throw Failure("LAPACK found no eigenvalues in Lanczos' iteration");
  vector.assign(T.end() - long(m), T.end());
  return values.back();
}

}  // namespace

double EnergyNorm::norm(const Map& forward, const Map& transposed, Vector& start, double tolerance,
                        int most) const {
  std::vector<Vector> basis, images;  // M-orthonormal, and M times them
  std::vector<double> diagonal, beside, ritz;
  Vector x = start;
  double size = norm(x), value = 0;
  for (int k = 0; k < most; ++k) {
    for (Complex& z : x) z /= size;
    basis.push_back(x);
    images.push_back(apply(x));
    x = solve(transposed(apply(forward(x))));
    diagonal.push_back(inner(images.back(), x).real());
    for (int twice = 0; twice < 2; ++twice)
      for (std::size_t j = 0; j < basis.size(); ++j) {
        const Complex part = inner(images[j], x);
        for (std::size_t i = 0; i < x.size(); ++i) x[i] -= part * basis[j][i];
      }
    size = norm(x);
    value = largest_ritz(diagonal, beside, ritz);
    if (size * std::abs(ritz.back()) <= tolerance * value || size <= 1e-14 * value) break;
    beside.push_back(size);
  }
  std::fill(start.begin(), start.end(), Complex(0));
  for (std::size_t j = 0; j < basis.size(); ++j)
    for (std::size_t i = 0; i < start.size(); ++i) start[i] += ritz[j] * basis[j][i];
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
    coupled(i, J.K0);
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
    for (Complex& entry : v) entry = std::conj(entry);
    return v;
  };
  std::vector<Complex> x = any_vector(J.size() * J.dof(), false);
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
  int ranks = 1, rank = 0;
  MPI_Comm_size(comm, &ranks);
  MPI_Comm_rank(comm, &rank);
  const EnergyNorm energy(J);
  std::vector<double> norms(re.size() * im.size(), 0.);
  const WaveNorms waves(J);
  for (std::size_t k = std::size_t(rank); k < norms.size(); k += std::size_t(ranks)) {
    const Complex z(re[k % re.size()], im[k / re.size()]);
    norms[k] = waves.known() ? waves.resolvent(z) : resolvent_norm_with(J, energy, z);
    if (told) told(double(k + 1) / double(norms.size()));
  }
  SS_TRY(MPI_Allreduce(MPI_IN_PLACE, norms.data(), int(norms.size()), MPI_DOUBLE, MPI_SUM, comm));
  return norms;
}

}  // namespace stickslip
