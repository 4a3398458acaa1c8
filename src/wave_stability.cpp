#include "stickslip/wave_stability.hpp"

#include <slepceps.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "stickslip/cyclic.hpp"
#include "stickslip/error.hpp"
#include "stickslip/handle.hpp"

namespace stickslip {

namespace {

using Complex = std::complex<double>;
constexpr int stages = 5, max_dim = 3;
constexpr size_t most_intervals = 40000;

// The linearised problem on a mesh that resolves the profile and waves of frequencies up to `omega`.
class Linearisation {
 public:
  Linearisation(const Train& train, double omega, int refine) : d_(train.oscillator->dim()), T_(train.period) {
    const Oscillator& o = *train.oscillator;
    r2_ = train.r2;
    const double cV = std::sqrt(1 - r2_);  // c/|V|
    kappa_ = (1 - r2_) / o.A();            // K1/V^2
    // the slower of the two waves has the local wavenumber omega/(1 - c/V) = omega (1 + c/V)/r2
    const double local = omega * T_ * (1 + cV) / r2_;
    mesh_.push_back(0);
    for (size_t i = 0; i < train.intervals(); ++i) {
      const double h = train.mesh[i + 1] - train.mesh[i];
      const int pieces = refine * std::max(1, int(std::ceil(h * local / 1.5)));
      for (int k = 1; k <= pieces; ++k)
        mesh_.push_back(k == pieces ? train.mesh[i + 1] : train.mesh[i] + h * k / pieces);
      if (mesh_.size() > most_intervals * size_t(refine))
        throw Failure("the spectrum needs too fine a mesh: V/c - 1 = " + std::to_string(1 / cV - 1) +
                      " is so small that waves running with the train are too short");
    }
    for (size_t i = 0; i + 1 < mesh_.size(); ++i)
      for (double c : train_tableau().c) {
        double y[max_dim], dy[max_dim], J[max_dim * max_dim];
        train.at(mesh_[i] + (mesh_[i + 1] - mesh_[i]) * c, y);
        o.rhs(r2_, y, dy, J);
        J_.insert(J_.end(), J, J + d_ * d_);
      }
    train_dense().weights(1, end_);
    for (int j = 0; j < stages; ++j) {
      double w[stages + 1];
      train_dense().derivative_weights(train_tableau().c[size_t(j)], w);
      std::copy(w, w + stages + 1, slope_ + j * (stages + 1));
    }
  }

  int dim() const { return d_; }
  size_t intervals() const { return mesh_.size() - 1; }
  double r2() const { return r2_; }
  double kappa() const { return kappa_; }
  double step(size_t i) const { return (mesh_[i + 1] - mesh_[i]) * T_; }
  const double* end() const { return end_; }
  // Row j: derivative with respect to the local coordinate in [0, 1] at Gauss point j.
  const double* slope(int j) const { return slope_ + j * (stages + 1); }

  // The matrix of y' = M y at Gauss point j of interval i: M = J - lambda C1 + lambda^2 C2.
  void matrix(size_t i, int j, Complex lambda, Complex* M) const {
    const double* J = &J_[(i * stages + size_t(j)) * size_t(d_ * d_)];
    for (int a = 0; a < d_ * d_; ++a) M[a] = J[a];
    for (int b = 0; b < d_; ++b) M[d_ + b] -= lambda * kappa_ * J[b];
    M[0] -= lambda / r2_;
    M[d_ + 1] -= lambda;
    M[d_] += lambda * lambda * kappa_ / r2_;
    if (d_ == 3) M[8] -= lambda;
  }

  // I - h A (x) M of interval i.
  void collocation(size_t i, Complex lambda, Complex* out) const {
    const int n = stages * d_;
    Complex M[stages * max_dim * max_dim];
    for (int j = 0; j < stages; ++j) matrix(i, j, lambda, M + j * d_ * d_);
    for (int j = 0; j < stages; ++j)
      for (int a = 0; a < d_; ++a)
        for (int k = 0; k < stages; ++k)
          for (int b = 0; b < d_; ++b)
            out[(j * d_ + a) * n + k * d_ + b] = (j == k && a == b ? 1. : 0.) -
                                                 step(i) * train_tableau().a[size_t(j * stages + k)] *
                                                     M[(k * d_ + a) * d_ + b];
  }

  // Y(lambda), the product of the intervals' transfer matrices.
  void monodromy(Complex lambda, Complex* Y) const {
    const int d = d_, n = stages * d;
    for (int a = 0; a < d * d; ++a) Y[a] = a % (d + 1) == 0 ? 1. : 0.;
    Complex M[stages * max_dim * stages * max_dim], R[stages * max_dim * max_dim], phi[max_dim * max_dim];
    for (size_t i = 0; i < intervals(); ++i) {
      collocation(i, lambda, M);
      for (int j = 0; j < n; ++j)
        for (int b = 0; b < d; ++b) R[j * d + b] = j % d == b ? 1. : 0.;
      solve_dense(n, M, d, R);
      for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b) {
          phi[a * d + b] = a == b ? end_[0] : 0.;
          for (int j = 0; j < stages; ++j) phi[a * d + b] += end_[j + 1] * R[(j * d + a) * d + b];
        }
      Complex next[max_dim * max_dim];
      for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b) {
          next[a * d + b] = 0;
          for (int k = 0; k < d; ++k) next[a * d + b] += phi[a * d + k] * Y[k * d + b];
        }
      std::copy(next, next + d * d, Y);
    }
  }

  // Mean over a period of C = A (B + F_psi) + s delta; short waves decay at half of it. And its largest size.
  void damping(double& mean, double& largest) const {
    mean = largest = 0;
    for (size_t i = 0; i < intervals(); ++i)
      for (size_t j = 0; j < stages; ++j) {
        const double C = -r2_ * J_[(i * stages + j) * size_t(d_ * d_)];
        mean += (mesh_[i + 1] - mesh_[i]) * train_tableau().b[j] * C;
        largest = std::max(largest, std::abs(C));
      }
  }

 private:
  int d_;
  double T_, r2_, kappa_;
  std::vector<double> mesh_, J_;
  double end_[stages + 1], slope_[stages * (stages + 1)];
};

// Linearisations on meshes for frequencies up to 1, 2, 4, ..., made when first needed.
class Levels {
 public:
  Levels(const Train& train, int refine) : train_(train), refine_(refine) {}
  const Linearisation& at(Complex lambda) {
    const int level = std::max(0, int(std::ceil(std::log2(std::max(std::abs(lambda), 1e-3)))));
    auto& slot = made_[level];
    if (!slot) slot = std::make_unique<Linearisation>(train_, std::ldexp(1., level), refine_);
    return *slot;
  }

 private:
  const Train& train_;
  int refine_;
  std::map<int, std::unique_ptr<Linearisation>> made_;
};

// det(Y - x) = (-1)^d [x^d - p1 x^(d-1) + ...]: the coefficients of the bracket after x^d.
struct Characteristic {
  int d;
  Complex p[max_dim];
  Complex at(Complex x) const {
    Complex sum = 1;
    for (int k = 0; k < d; ++k) sum = sum * x + p[k];
    return sum;
  }
};

Characteristic characteristic(const Linearisation& l, Complex lambda) {
  Complex Y[max_dim * max_dim];
  l.monodromy(lambda, Y);
  if (l.dim() == 2) return {2, {-(Y[0] + Y[3]), Y[0] * Y[3] - Y[1] * Y[2], 0}};
  const Complex minors = Y[0] * Y[4] - Y[1] * Y[3] + Y[0] * Y[8] - Y[2] * Y[6] + Y[4] * Y[8] - Y[5] * Y[7];
  const Complex det = Y[0] * (Y[4] * Y[8] - Y[5] * Y[7]) - Y[1] * (Y[3] * Y[8] - Y[5] * Y[6]) +
                      Y[2] * (Y[3] * Y[7] - Y[4] * Y[6]);
  return {3, {-(Y[0] + Y[4] + Y[8]), minors, -det}};
}

// Roots of the characteristic polynomial, largest modulus first.
std::vector<Complex> factors(const Characteristic& c) {
  std::vector<Complex> roots;
  if (c.d == 2) {
    const Complex half = -c.p[0] / 2., root = std::sqrt(half * half - c.p[1]);
    const Complex big = std::abs(half + root) > std::abs(half - root) ? half + root : half - root;
    roots = {big, std::abs(big) > 0 ? c.p[1] / big : 0.};
  } else {
    roots = {{.4, .9}, {1, 0}, {-.65, .72}};  // Durand and Kerner
    for (int it = 0; it < 200; ++it)
      for (size_t i = 0; i < 3; ++i) {
        Complex q = 1;
        for (size_t k = 0; k < 3; ++k)
          if (k != i) q *= roots[i] - roots[k];
        if (std::abs(q) > 0) roots[i] -= c.at(roots[i]) / q;
      }
  }
  std::sort(roots.begin(), roots.end(), [](Complex a, Complex b) { return std::abs(a) > std::abs(b); });
  return roots;
}

// The root of det(Y(lambda) - exp(i theta)) near a guess, by the secant method. False where it wanders off.
bool polish(Levels& levels, double theta, Complex guess, Complex& root, double reach = .1) {
  const Complex x = std::polar(1., theta);
  Complex a = guess, b = guess + Complex(1e-5, 1e-5);
  const Linearisation& l = levels.at(std::abs(guess) * 1.05 + .05);
  Complex fa = characteristic(l, a).at(x), fb = characteristic(l, b).at(x);
  for (int k = 0; k < 30; ++k) {
    if (fa == fb) break;
    Complex step = -fb * (b - a) / (fb - fa);
    if (std::abs(step) > reach) step *= reach / std::abs(step);
    a = b;
    fa = fb;
    b += step;
    if (!(std::abs(b - guess) < 3 * reach)) return false;
    if (std::abs(step) < 1e-13 * (1 + std::abs(b))) break;
    fb = characteristic(l, b).at(x);
  }
  root = b;
  return std::isfinite(b.real());
}

// ---- the eigenproblem of one Bloch factor by SLEPc ----------------------------------------------------------------

// y = (K - sigma M)^{-1} M x for complex vectors stored as real part, then imaginary part. Points: node and Gauss
// points of each interval.
class ShiftInvert {
 public:
  ShiftInvert(const Linearisation& l, Complex twist, Complex sigma) : l_(l), twist_(twist), sigma_(sigma) {
    const int d = l.dim(), n = stages * d;
    const size_t N = l.intervals();
    inverse_.resize(N * size_t(n * n));
    std::vector<Complex> phi(N * size_t(d * d)), M(size_t(n * n));
    for (size_t i = 0; i < N; ++i) {
      l.collocation(i, sigma, M.data());
      Complex* inverse = &inverse_[i * size_t(n * n)];
      for (int a = 0; a < n * n; ++a) inverse[a] = a % (n + 1) == 0 ? 1. : 0.;
      if (!solve_dense(n, M.data(), n, inverse)) throw Failure("the linearised equations of an interval are singular");
      for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b) {
          Complex sum = a == b ? l.end()[0] : 0.;
          for (int j = 0; j < stages; ++j)
            for (int k = 0; k < stages; ++k) sum += l.end()[j + 1] * inverse[(j * d + a) * n + k * d + b];
          phi[i * size_t(d * d) + size_t(a * d + b)] = sum;
        }
    }
    chain_ = std::make_unique<CyclicChain<Complex>>(d, N, phi);
  }

  size_t points() const { return l_.intervals() * (stages + 1); }
  size_t size() const { return points() * size_t(l_.dim()); }

  void apply(const Complex* x, Complex* y) const {
    const int d = l_.dim(), n = stages * d;
    const size_t N = l_.intervals(), block = size_t(d) * (stages + 1);
    std::vector<Complex> forced(N * size_t(n)), rhs(N * size_t(d));
    for (size_t i = 0; i < N; ++i) {
      const Complex* u = x + i * block;
      const double h = l_.step(i);
      Complex g[stages * max_dim], r[stages * max_dim];
      for (int j = 0; j < stages; ++j) {
        const Complex* at = u + (j + 1) * d;
        Complex slope = 0;
        for (int k = 0; k <= stages; ++k) slope += l_.slope(j)[k] * u[k * d];
        const Complex bP = at[0] / l_.r2(), bZ = at[1] + l_.kappa() * slope / h;
        g[j * d] = -bP;
        g[j * d + 1] = -bZ + sigma_ * l_.kappa() * bP;
        if (d == 3) g[j * d + 2] = -at[2];
      }
      for (int j = 0; j < stages; ++j)
        for (int a = 0; a < d; ++a) {
          r[j * d + a] = 0;
          for (int k = 0; k < stages; ++k) r[j * d + a] += h * train_tableau().a[size_t(j * stages + k)] * g[k * d + a];
        }
      Complex* f = &forced[i * size_t(n)];
      const Complex* inverse = &inverse_[i * size_t(n * n)];
      for (int a = 0; a < n; ++a) {
        f[a] = 0;
        for (int b = 0; b < n; ++b) f[a] += inverse[a * n + b] * r[b];
      }
      for (int a = 0; a < d; ++a) {
        Complex sum = 0;
        for (int j = 0; j < stages; ++j) sum += l_.end()[j + 1] * f[j * d + a];
        rhs[i * size_t(d) + size_t(a)] = sum;
      }
    }
    std::vector<Complex> y0 = chain_->reduce(1, rhs), closure = chain_->closure(twist_);
    if (!solve_dense(d, closure.data(), 1, y0.data())) throw Failure("the shift is an eigenvalue");
    const Complex one = 1;
    const std::vector<Complex> nodes = chain_->expand(1, rhs, &one, y0.data(), twist_);
    for (size_t i = 0; i < N; ++i) {
      const Complex* node = &nodes[i * size_t(d)];
      Complex* to = y + i * block;
      const Complex* inverse = &inverse_[i * size_t(n * n)];
      for (int a = 0; a < d; ++a) to[a] = node[a];
      for (int a = 0; a < n; ++a) {
        Complex sum = forced[i * size_t(n) + size_t(a)];
        for (int k = 0; k < stages; ++k)
          for (int b = 0; b < d; ++b) sum += inverse[a * n + k * d + b] * node[b];
        to[d + a] = sum;
      }
    }
  }

 private:
  const Linearisation& l_;
  Complex twist_, sigma_;
  std::vector<Complex> inverse_;
  std::unique_ptr<CyclicChain<Complex>> chain_;
};

PetscErrorCode apply_shell(Mat A, Vec x, Vec y) {
  return guarded([&] {
    void* context;
    SS_TRY(MatShellGetContext(A, &context));
    const auto* op = static_cast<const ShiftInvert*>(context);
    const size_t n = op->size();
    const PetscScalar* in;
    PetscScalar* out;
    SS_TRY(VecGetArrayRead(x, &in));
    std::vector<Complex> u(n), w(n);
    for (size_t i = 0; i < n; ++i) u[i] = {in[i], in[n + i]};
    SS_TRY(VecRestoreArrayRead(x, &in));
    op->apply(u.data(), w.data());
    SS_TRY(VecGetArray(y, &out));
    for (size_t i = 0; i < n; ++i) {
      out[i] = w[i].real();
      out[n + i] = w[i].imag();
    }
    SS_TRY(VecRestoreArray(y, &out));
  });
}

struct Found {
  Complex lambda;
  double residual;
};

// Eigenvalues lambda nearest to sigma for the Bloch factor exp(i theta).
std::vector<Found> nearest(const Linearisation& l, double theta, Complex sigma, int count, bool library_options) {
  const ShiftInvert op(l, std::polar(1., theta), sigma);
  const PetscInt n = PetscInt(2 * op.size());
  MatHandle A;
  EpsHandle eps;
  SS_TRY(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, const_cast<ShiftInvert*>(&op), A.out()));
  SS_TRY(MatShellSetOperation(A, MATOP_MULT, reinterpret_cast<void (*)()>(apply_shell)));
  SS_TRY(EPSCreate(PETSC_COMM_SELF, eps.out()));
  SS_TRY(EPSSetOperators(eps, A, nullptr));
  SS_TRY(EPSSetProblemType(eps, EPS_NHEP));
  SS_TRY(EPSSetWhichEigenpairs(eps, EPS_LARGEST_MAGNITUDE));
  SS_TRY(EPSSetDimensions(eps, 2 * count, std::min<PetscInt>(n, 4 * count + 16), PETSC_DEFAULT));
  SS_TRY(EPSSetTolerances(eps, 1e-9, 200));
  // a start that is the same every time and on every rank
  VecHandle start, xr, xi;
  SS_TRY(MatCreateVecs(A, start.out(), nullptr));
  SS_TRY(VecDuplicate(start, xr.out()));
  SS_TRY(VecDuplicate(start, xi.out()));
  PetscScalar* s;
  SS_TRY(VecGetArray(start, &s));
  for (PetscInt i = 0; i < n; ++i) s[i] = std::sin(1 + double(i) * double(i % 97));
  SS_TRY(VecRestoreArray(start, &s));
  Vec initial[1] = {start};
  SS_TRY(EPSSetInitialSpace(eps, 1, initial));
  if (library_options) SS_TRY(EPSSetFromOptions(eps));
  SS_TRY(EPSSolve(eps));
  PetscInt converged;
  SS_TRY(EPSGetConverged(eps, &converged));
  std::vector<Found> found;
  for (PetscInt i = 0; i < converged; ++i) {
    PetscScalar kr, ki;
    SS_TRY(EPSGetEigenpair(eps, i, &kr, &ki, xr, xi));
    // (a, b) with complex a, b solves the doubled problem; u = a + i b is the eigenvector of ours, and vanishes where
    // the eigenvalue belongs to the complex conjugate problem
    const PetscScalar *r, *im;
    SS_TRY(VecGetArrayRead(xr, &r));
    SS_TRY(VecGetArrayRead(xi, &im));
    double norm = 0, all = 0;
    const size_t half = size_t(n) / 2;
    for (size_t k = 0; k < half; ++k) {
      const Complex a(r[k], im[k]), b(r[half + k], im[half + k]);
      norm += std::norm(a + Complex(0, 1) * b);
      all += std::norm(a) + std::norm(b);
    }
    SS_TRY(VecRestoreArrayRead(xr, &r));
    SS_TRY(VecRestoreArrayRead(xi, &im));
    if (norm < 1e-8 * all) continue;
    double error;
    SS_TRY(EPSComputeError(eps, i, EPS_ERROR_RELATIVE, &error));
    const Complex lambda = sigma + 1. / Complex(kr, ki);
    bool again = false;
    for (const Found& f : found) again = again || std::abs(f.lambda - lambda) < 1e-7 * (1 + std::abs(lambda));
    if (!again) found.push_back({lambda, error});
  }
  return found;
}

// ---- along a vertical line ----------------------------------------------------------------------------------------

// Characteristic polynomials of Y at sigma + i omega, omega from 0 to `top`.
struct Line {
  double sigma, top;
  std::vector<double> omega;
  std::vector<Characteristic> at;
};

Line along_line(Levels& levels, const Train& train, double sigma) {
  Line line{sigma, 0, {}, {}};
  double mean, largest;
  levels.at(1).damping(mean, largest);
  // Beyond this frequency the damping only modulates waves that decay at half its mean: its square over the
  // frequency is small against it. Uniform motion of wavelength c/k has frequency k V in this frame, hence c/V.
  const double V = 1 / std::sqrt(std::max(1 - train.r2, 1e-4));
  const double own = std::sqrt(train.oscillator->A() * train.oscillator->K0());
  line.top = std::min(2. * largest + 4 * own, 8 * own + largest) * std::max(1., std::min(V, 3.));
  const double spacing = .7 / train.period;
  const int count = int(std::ceil(line.top / spacing));
  for (int k = 0; k <= count; ++k) line.omega.push_back(line.top * k / count);
  for (double omega : line.omega) {
    const Complex lambda(sigma, omega);
    line.at.push_back(characteristic(levels.at(lambda), lambda));
  }
  return line;
}

// det(Y - exp(i theta)) turns so many times round 0 along the line from -i top to i top: minus that is the number of
// eigenvalues to the right. Refines the samples where it turns fast.
int count_right(Levels& levels, Line& line, double theta) {
  const Complex x = std::polar(1., theta);
  double turned = 0;
  // the lower half of the line is the conjugate of the upper half for -theta
  for (const Complex& factor : {x, std::conj(x)}) {
    size_t k = 0;
    while (k + 1 < line.omega.size()) {
      const Complex a = line.at[k].at(factor), b = line.at[k + 1].at(factor);
      const double angle = std::arg(b / a);
      const bool fast = std::abs(angle) > .8 || std::abs(std::log(std::abs(b / a))) > 1.2;
      if (fast && line.omega[k + 1] - line.omega[k] > 1e-10) {
        const double mid = (line.omega[k] + line.omega[k + 1]) / 2;
        line.omega.insert(line.omega.begin() + long(k) + 1, mid);
        const Complex lambda(line.sigma, mid);
        line.at.insert(line.at.begin() + long(k) + 1, characteristic(levels.at(lambda), lambda));
        continue;
      }
      turned += angle;
      ++k;
    }
    // from the end of the line to infinity the determinant goes to that of Y = 0 without turning further
    const Complex last = line.at.back().at(factor), limit = std::pow(factor, double(line.at.back().d));
    turned += std::arg(limit / last);
  }
  return int(std::lround(-turned / (2 * M_PI)));
}

// A factor exp(i theta) over a period T of xi = t - x/V is one of exp(-i theta) over x = V T: k = -theta/(V T).
double wavenumber_of(double theta, const Train& train) {
  return std::remainder(-theta, 2 * M_PI) / (train.speed * train.period) + 0.;  // no negative zero
}

// Where the spectrum of the endless train reaches furthest right: from every peak of the larger factor along the
// line, uphill in theta.
void endless(Levels& levels, const Train& train, Line& line, TrainSpectrum& out) {
  std::vector<double> size;
  for (const Characteristic& c : line.at) size.push_back(std::abs(factors(c)[0]));
  out.endless_growth = 0;
  out.endless_stable = true;
  for (size_t k = 0; k < size.size(); ++k) {
    const bool peak = (k == 0 || size[k] >= size[k - 1]) && (k + 1 == size.size() || size[k] >= size[k + 1]);
    if (!peak || size[k] < 1) continue;
    out.endless_stable = false;
    const Complex factor = factors(line.at[k])[0];
    double theta = std::arg(factor), step = .1;
    Complex best;
    // the factor's size says how far right the curve lies: |factor| = exp(Re lambda T_eff) about
    if (!polish(levels, theta, {line.sigma + std::log(size[k]) / train.period, line.omega[k]}, best, .3)) continue;
    for (int it = 0; it < 60 && std::abs(step) > 1e-5; ++it) {
      Complex next;
      if (polish(levels, theta + step, best, next, .1) && next.real() > best.real()) {
        theta += step;
        best = next;
        step *= 1.5;
      } else {
        step *= -.4;
      }
    }
    if (best.real() > out.endless_growth) {
      out.endless_growth = best.real();
      out.endless_frequency = best.imag();
      out.endless_wavenumber = wavenumber_of(theta, train);
    }
  }
}

constexpr double line_at = 1e-5;

// A train whose short waves grow: it is unstable and has infinitely many modes that say so. True where it is one.
bool short_waves_grow(Levels& levels, TrainSpectrum& out) {
  double mean, largest;
  levels.at(1).damping(mean, largest);
  if (mean > 0) return false;
  out.growth_rate = out.endless_growth = -mean / 2;
  out.completeness_check = "waves of any short length grow at " + std::to_string(-mean / 2) + ": no list is complete";
  return true;
}

}  // namespace

std::vector<Complex> bloch_factors(const Train& train, Complex lambda) {
  const Linearisation l(train, std::abs(lambda) + 1, 1);
  return factors(characteristic(l, lambda));
}

std::vector<int> growing_modes(const Train& train) {
  TrainSpectrum out;
  Levels levels(train, 1);
  std::vector<int> counts(std::size_t(train.pulses / 2 + 1), 1);
  if (short_waves_grow(levels, out)) return counts;
  Line line = along_line(levels, train, line_at);
  for (std::size_t m = 0; m < counts.size(); ++m)
    counts[m] = count_right(levels, line, 2 * M_PI * double(m) / double(train.pulses));
  return counts;
}

TrainSpectrum endless_stability(const Train& train) {
  TrainSpectrum out;
  Levels levels(train, 1);
  if (short_waves_grow(levels, out)) return out;
  Line line = along_line(levels, train, line_at);
  endless(levels, train, line, out);
  return out;
}

TrainSpectrum train_spectrum(const Train& train, int count, bool library_options) {
  TrainSpectrum out;
  Levels levels(train, 1), finer(train, 2);
  if (short_waves_grow(levels, out)) return out;
  Line line = along_line(levels, train, line_at);
  const PetscInt n = train.pulses;
  std::vector<TrainMode> modes;
  int counted = 0;
  for (PetscInt m = 0; 2 * m <= n; ++m) {
    const double theta = 2 * M_PI * double(m) / double(n);
    const bool real_problem = m == 0 || 2 * m == n;  // its eigenvalues come in conjugate pairs
    counted += count_right(levels, line, theta) * (real_problem ? 1 : 2);
    // shifts: 0, and where the determinant dips on the line (both halves of it)
    std::vector<Complex> shifts{{.05, .02}};
    for (int side : {1, -1}) {
      if (side < 0 && real_problem) continue;
      const Complex x = std::polar(1., side * theta);
      std::vector<double> size;
      for (const Characteristic& c : line.at) size.push_back(std::abs(c.at(x)));
      for (size_t k = 1; k + 1 < size.size(); ++k)
        if (size[k] < .7 && size[k] <= size[k - 1] && size[k] <= size[k + 1] && line.omega[k] > .1) {
          const Complex shift(.05, side * line.omega[k]);
          bool near = false;
          for (const Complex& s : shifts) near = near || std::abs(s - shift) < .5 / train.period;
          if (!near) shifts.push_back(shift);
        }
    }
    std::vector<TrainMode> here;
    for (const Complex& sigma : shifts) {
      const bool first = &sigma == &shifts[0];
      const Linearisation& l = levels.at(std::abs(sigma) + 1);
      for (const Found& f : nearest(l, theta, sigma, first ? std::min(count, 8) : 3, library_options)) {
        TrainMode mode;
        mode.residual = f.residual;
        mode.bloch = m;
        mode.wavenumber = wavenumber_of(theta, train);
        Complex exact;
        const bool same = polish(finer, theta, f.lambda, exact) && std::abs(exact - f.lambda) < .05;
        mode.lambda = same ? exact : f.lambda;
        mode.resolved = same && std::abs(exact - f.lambda) < 1e-6 * (1 + std::abs(exact));
        bool again = false;
        for (const TrainMode& other : here)
          again = again || std::abs(other.lambda - mode.lambda) < 1e-6 * (1 + std::abs(mode.lambda));
        if (!again) here.push_back(mode);
      }
    }
    if (m == 0) {
      size_t zero = 0;
      for (size_t k = 0; k < here.size(); ++k)
        if (std::abs(here[k].lambda) < std::abs(here[zero].lambda)) zero = k;
      if (!here.empty() && std::abs(here[zero].lambda) < 1e-4) {
        here[zero].translation = true;
        out.translation_error = std::abs(here[zero].lambda);
      } else {
        out.translation_error = here.empty() ? 1 : std::abs(here[zero].lambda);
        warn("the translation mode of the train was not found: its spectrum is not to be trusted");
      }
    }
    for (const TrainMode& mode : here) {
      modes.push_back(mode);
      if (!real_problem) {  // exp(-i theta) has the conjugate spectrum
        TrainMode mirrored = mode;
        mirrored.lambda = std::conj(mode.lambda);
        mirrored.bloch = n - m;
        mirrored.wavenumber = -mode.wavenumber;
        modes.push_back(mirrored);
      } else if (std::abs(mode.lambda.imag()) > 1e-9) {
        bool there = false;
        for (const TrainMode& other : here)
          there = there || std::abs(other.lambda - std::conj(mode.lambda)) < 1e-6 * (1 + std::abs(mode.lambda));
        if (!there) {
          TrainMode mirrored = mode;
          mirrored.lambda = std::conj(mode.lambda);
          modes.push_back(mirrored);
        }
      }
    }
  }
  std::sort(modes.begin(), modes.end(), [](const TrainMode& a, const TrainMode& b) {
    return a.lambda.real() != b.lambda.real() ? a.lambda.real() > b.lambda.real() : a.lambda.imag() > b.lambda.imag();
  });
  int right = 0;
  out.growth_rate = -1e300;
  for (const TrainMode& mode : modes) {
    right += mode.lambda.real() > line_at && !mode.translation;
    if (!mode.translation && mode.resolved) out.growth_rate = std::max(out.growth_rate, mode.lambda.real());
  }
  out.complete = right == counted;
  out.completeness_check = "argument of the determinant along Re = 1e-5: " + std::to_string(counted) +
                           " eigenvalues to the right, " + std::to_string(right) + " found";
  const double error = std::max(10 * out.translation_error, 1e-9);
  out.stable = out.complete && counted == 0 && out.growth_rate < -error;
  if (!out.complete) warn("the spectrum of the train is not complete: " + out.completeness_check);
  endless(levels, train, line, out);
  if (modes.size() > size_t(count)) modes.resize(size_t(count));
  out.modes = std::move(modes);
  return out;
}

}  // namespace stickslip
