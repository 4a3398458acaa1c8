#include "stickslip/spectrum.hpp"

#include <slepceps.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "stickslip/error.hpp"
#include "stickslip/handle.hpp"
#include "stickslip/phase_tree.hpp"
#include "stickslip/stencil.hpp"

namespace stickslip {

namespace {

constexpr double epsilon = std::numeric_limits<double>::epsilon();
constexpr std::size_t many_nodes = 5000;  // beyond, the search is frugal: what it misses the count points at

Complex inner(const std::vector<Complex>& a, const std::vector<Complex>& b) {
  Complex sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::conj(a[i]) * b[i];
  return sum;
}

void normalise(std::vector<Complex>& p) {
  Complex largest = 0;
  for (const Complex& x : p)
    if (std::norm(x) > std::norm(largest) * (1 + 1e-9)) largest = x;
  if (largest == Complex(0)) return;
  for (Complex& x : p) x /= largest;
}

// Round-off in an eigenvalue: that of the stiffest entry, felt through dS/dlambda.
double rounding(const Sliding& s, Complex lambda) {
  const double scale = std::max(std::abs(lambda), std::sqrt(s.A * s.K0) + 1e-3);
  return 20 * epsilon * (scale + s.A * s.largest_stiffness() / scale);
}

}  // namespace

// It is known where D2 is symmetric: p times the weight, or its conjugate where all nodes are alike (a travelling wave).
std::vector<Complex> left_vector(const Sliding& s, const Mode& mode) {
  std::vector<Complex> w = mode.psi;
  if (s.symmetric) {
    for (std::size_t i = 0; i < w.size(); ++i) w[i] = s.weight[i] * (s.uniform ? std::conj(w[i]) : w[i]);
    return w;
  }
  BandLU lu;
  s.factor(mode.value, lu);
  for (int k = 0; k < 2; ++k) {
    s.solve_transposed(lu, w);
    normalise(w);
  }
  return w;
}

namespace {

// lambda with w S(lambda) p = 0, w the left eigenvector: an error of p enters squared, and D2 is taken by differences,
// so that round-off of size 1/h^2 stays out.
Complex stationary_value(const Sliding& s, const Mode& mode) {
  if (!s.symmetric) return mode.value;
  const std::vector<Complex>& p = mode.psi;
  const std::vector<Complex> w = left_vector(s, mode);
  Complex lambda = mode.value;
  for (int k = 0; k < 2; ++k) {
    const std::vector<Complex> r = s.apply(lambda, p), slope = s.apply_slope(lambda, p);
    Complex above = 0, below = 0;
    double size = 0;
    for (std::size_t i = 0; i < p.size(); ++i) {
      above += w[i] * r[i];
      below += w[i] * slope[i];
      size += std::abs(w[i] * p[i] * (2. * lambda / s.A));
    }
    if (std::abs(below) < 0.1 * size) return mode.value;  // nearly double: not to be trusted
    lambda -= above / below;
  }
  return std::abs(lambda - mode.value) < 1e-6 * (1 + std::abs(lambda)) ? lambda : mode.value;
}

}  // namespace

bool polish(const Sliding& s, Mode& mode, int steps) {
  BandLU lu;
  bool converged = false;
  normalise(mode.psi);
  double last = std::numeric_limits<double>::infinity();
  for (int k = 0; k < steps && !converged; ++k) {
    s.factor(mode.value, lu);
    std::vector<Complex> y = s.apply_slope(mode.value, mode.psi);
    s.solve(lu, y);
    const Complex step = inner(mode.psi, mode.psi) / inner(mode.psi, y);
    if (!std::isfinite(std::abs(step))) break;
    mode.value -= step;
    mode.psi = std::move(y);
    normalise(mode.psi);
    const double size = std::abs(step);
    converged = size <= rounding(s, mode.value) || (size > 0.3 * last && size < 1e-9 * (1 + std::abs(mode.value)));
    last = size;
  }
  mode.value = stationary_value(s, mode);
  if (mode.value.imag() < 0) {
    mode.value = std::conj(mode.value);
    for (Complex& x : mode.psi) x = std::conj(x);
  }
  if (mode.value.imag() <= rounding(s, mode.value)) {
    // A real eigenvalue has a real eigenvector; a pair that is almost double keeps its imaginary part otherwise.
    Mode real = mode;
    real.value = mode.value.real();
    double re = 0, im = 0;
    for (const Complex& x : mode.psi) {
      re += x.real() * x.real();
      im += x.imag() * x.imag();
    }
    for (Complex& x : real.psi) x = re >= im ? x.real() : x.imag();
    normalise(real.psi);
    if (s.mode_residual(real.value, real.psi) <= 10 * s.mode_residual(mode.value, mode.psi) + rounding(s, mode.value))
      mode = std::move(real);
  }
  mode.residual = s.mode_residual(mode.value, mode.psi);
  mode.wavenumber = s.wavenumber(mode.psi);
  return converged;
}

namespace {

// A fixed vector that favours no wave, so that every rank and every run finds the same.
class Noise {
 public:
  double next() {
    seed_ = seed_ * 6364136223846793005u + 1442695040888963407u;
    return double(seed_ >> 11) * 0x1p-53 - 0.5;
  }

 private:
  std::uint64_t seed_ = 0x9e3779b97f4a7c15u;
};

// The eigenvector nearest to z, by inverse iteration; not polished.
Mode mode_near(const Sliding& s, Complex z) {
  Mode mode;
  mode.value = z;
  mode.psi.resize(s.size());
  Noise noise;
  for (Complex& x : mode.psi) x = noise.next();
  BandLU lu;
  s.factor(z, lu);
  for (int k = 0; k < 3; ++k) {
    std::vector<Complex> y = s.apply_slope(z, mode.psi);
    s.solve(lu, y);
    mode.psi = std::move(y);
    normalise(mode.psi);
  }
  return mode;
}

}  // namespace

// ---- dense --------------------------------------------------------------------------------------------------------

std::vector<Mode> dense_modes(const Sliding& s, PetscInt count) {
  const PetscInt n = PetscInt(s.size() * s.dof());
  MatHandle J;
  SS_TRY(MatCreateSeqDense(PETSC_COMM_SELF, n, n, nullptr, J.out()));
  for (const Sliding::Entry& e : s.entries())
    SS_TRY(MatSetValue(J, PetscInt(e.row), PetscInt(e.column), e.value, ADD_VALUES));
  SS_TRY(MatAssemblyBegin(J, MAT_FINAL_ASSEMBLY));
  SS_TRY(MatAssemblyEnd(J, MAT_FINAL_ASSEMBLY));
  EpsHandle eps;
  SS_TRY(EPSCreate(PETSC_COMM_SELF, eps.out()));
  SS_TRY(EPSSetOperators(eps, J, nullptr));
  SS_TRY(EPSSetProblemType(eps, EPS_NHEP));
  SS_TRY(EPSSetType(eps, EPSLAPACK));
  SS_TRY(EPSSetWhichEigenpairs(eps, EPS_LARGEST_REAL));
  SS_TRY(EPSSolve(eps));
  PetscInt found = 0;
  SS_TRY(EPSGetConverged(eps, &found));
  VecHandle re, im;
  SS_TRY(MatCreateVecs(J, re.out(), im.out()));
  std::vector<Mode> modes;
  PetscInt eigenvalues = 0;
  for (PetscInt j = 0; j < found; ++j) {
    PetscScalar a, b;
    SS_TRY(EPSGetEigenvalue(eps, j, &a, &b));
    if (b < 0) continue;
    Mode mode;
    mode.value = {a, b};
    if (eigenvalues < count) {
      SS_TRY(EPSGetEigenvector(eps, j, re, im));
      const PetscScalar *x, *y;
      SS_TRY(VecGetArrayRead(re, &x));
      SS_TRY(VecGetArrayRead(im, &y));
      mode.psi.resize(s.size());
      for (std::size_t i = 0; i < s.size(); ++i) mode.psi[i] = {x[i * s.dof()], b == 0 ? 0. : y[i * s.dof()]};
      SS_TRY(VecRestoreArrayRead(re, &x));
      SS_TRY(VecRestoreArrayRead(im, &y));
      eigenvalues += b > 0 ? 2 : 1;
    }
    modes.push_back(std::move(mode));
  }
  return modes;
}

// ---- krylov -------------------------------------------------------------------------------------------------------

namespace {

struct ShiftedInverse {
  const Sliding* sliding;
  Complex sigma;
  BandLU lu;
  std::vector<Complex> y;
};

// y = Re (J - sigma)^-1 x: real, with the eigenvectors of J, largest for eigenvalues near sigma and its conjugate.
PetscErrorCode apply_shifted_inverse(Mat M, Vec x, Vec y) {
  return guarded([&] {
    ShiftedInverse* op = nullptr;
    SS_TRY(MatShellGetContext(M, &op));
    const PetscScalar* in;
    PetscScalar* out;
    SS_TRY(VecGetArrayRead(x, &in));
    SS_TRY(VecGetArrayWrite(y, &out));
    op->sliding->solve_shifted(op->sigma, op->lu, in, op->y.data());
    for (std::size_t i = 0; i < op->y.size(); ++i) out[i] = op->y[i].real();
    SS_TRY(VecRestoreArrayWrite(y, &out));
    SS_TRY(VecRestoreArrayRead(x, &in));
  });
}

}  // namespace

std::vector<Mode> krylov_modes(const Sliding& s, Complex sigma, PetscInt count) {
  const PetscInt n = PetscInt(s.size() * s.dof());
  ShiftedInverse op{&s, sigma, {}, std::vector<Complex>(std::size_t(n))};
  s.factor(sigma, op.lu);
  MatHandle M;
  SS_TRY(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, &op, M.out()));
  SS_TRY(MatShellSetOperation(M, MATOP_MULT, reinterpret_cast<void (*)()>(apply_shifted_inverse)));
  EpsHandle eps;
  SS_TRY(EPSCreate(PETSC_COMM_SELF, eps.out()));
  SS_TRY(EPSSetOperators(eps, M, nullptr));
  SS_TRY(EPSSetProblemType(eps, EPS_NHEP));
  SS_TRY(EPSSetWhichEigenpairs(eps, EPS_LARGEST_MAGNITUDE));
  const PetscInt nev = std::min<PetscInt>(count, n), ncv = std::min<PetscInt>(n, 2 * nev + 12);
  SS_TRY(EPSSetDimensions(eps, nev, ncv, PETSC_DEFAULT));
  SS_TRY(EPSSetTolerances(eps, 1e-9, s.size() > many_nodes ? 12 : 60));
  VecHandle start, im;
  SS_TRY(MatCreateVecs(M, start.out(), im.out()));
  {
    PetscScalar* x;
    SS_TRY(VecGetArrayWrite(start, &x));
    Noise noise;
    for (PetscInt i = 0; i < n; ++i) x[i] = noise.next();
    SS_TRY(VecRestoreArrayWrite(start, &x));
  }
  Vec first = start;
  SS_TRY(EPSSetInitialSpace(eps, 1, &first));
  SS_TRY(EPSSetFromOptions(eps));
  SS_TRY(EPSSolve(eps));
  PetscInt found = 0;
  SS_TRY(EPSGetConverged(eps, &found));
  std::vector<Mode> modes;
  for (PetscInt j = 0; j < found; ++j) {
    PetscScalar a, b;
    SS_TRY(EPSGetEigenpair(eps, j, &a, &b, start, im));
    if (b > 0) continue;  // mu is conjugate to lambda, roughly; either member of a pair gives both
    const PetscScalar *x, *y;
    SS_TRY(VecGetArrayRead(start, &x));
    SS_TRY(VecGetArrayRead(im, &y));
    std::vector<Complex> vector(std::size_t(n), Complex(0)), image(std::size_t(n), Complex(0));
    for (std::size_t i = 0; i < vector.size(); ++i) vector[i] = {x[i], b == 0 ? 0. : y[i]};
    SS_TRY(VecRestoreArrayRead(start, &x));
    SS_TRY(VecRestoreArrayRead(im, &y));
    s.multiply(vector.data(), image.data());
    Mode mode;
    mode.value = inner(vector, image) / inner(vector, vector);
    mode.psi.resize(s.size());
    for (std::size_t i = 0; i < s.size(); ++i) mode.psi[i] = vector[i * s.dof()];
    modes.push_back(std::move(mode));
  }
  return modes;
}

// ---- the count ----------------------------------------------------------------------------------------------------

namespace {

// Follows the phase of the characteristic polynomial f along straight segments. A piece from a to b is taken as
// followed when f'/f at both ends says that ln f changes by less than 0.7 over the piece, and the change is what the two
// slopes predict to 0.2. A zero beside the piece, a pair of them, or a crowd further off shows in the slopes, so that no
// whole turn passes unseen.
class Phase {
 public:
  Phase(const Sliding& s, double evaluations) : sliding_(s), left_(evaluations) {}

  struct Point {
    Complex z;
    LogDet f;
    Complex slope;  // f'/f, by a difference over 1e-3 of
    double reach;   // the length of the pieces that end here
  };
  Point at(Complex z, double reach) {
    left_ -= 2;
    const double step = 1e-3 * reach;
    const LogDet f = sliding_.factor(z, lu_), near = sliding_.factor(z + Complex(0, step), lu_);
    return {z, f, change(f, near) / Complex(0, step), reach};
  }
  bool failed() const { return failed_; }

  // The turn of the phase from a to b; visit(middle, turn) for every piece.
  template <class Visit>
  double turn(Point a, Point b, Visit&& visit, int depth = 0) {
    if (failed_ || left_ < 0 || depth > 60) {
      failed_ = true;
      return 0;
    }
    for (Point* p : {&a, &b})
      if (std::abs(b.z - a.z) < 0.02 * p->reach) *p = at(p->z, std::abs(b.z - a.z));
    const Complex d = b.z - a.z, predicted = (a.slope + b.slope) / 2. * d, measured = change(a.f, b.f);
    if (std::abs(a.slope * d) < 0.7 && std::abs(b.slope * d) < 0.7 && std::abs(measured - predicted) < 0.2) {
      visit((a.z + b.z) / 2., measured.imag());
      return measured.imag();
    }
    const Point m = at((a.z + b.z) / 2., std::abs(d) / 2);
    return turn(a, m, visit, depth + 1) + turn(m, b, visit, depth + 1);
  }

 private:
  static Complex change(const LogDet& a, const LogDet& b) {  // of ln f, its phase within a half turn
    return {b.log_abs - a.log_abs, std::arg(b.unit * std::conj(a.unit))};
  }
  const Sliding& sliding_;
  double left_;
  bool failed_ = false;
  BandLU lu_;
};

// Frequencies of the medium with mean coefficients, one a mode: knots with about one eigenvalue between two of them.
std::vector<double> mean_frequencies(const Sliding& s) {
  const double b = s.mean_beta(), q = s.mean_q(), r = s.mean_r();
  const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
  std::vector<double> w;
  for (std::size_t j = 0; j <= s.size(); ++j) {
    const double K = s.K0 + s.K1 * symbol(s.scene.order, h, M_PI / h * double(j) / double(s.size()));
    for (const Complex& z : s.dispersion(K, b, q, r))
      if (z.imag() > 0) w.push_back(z.imag());
  }
  std::sort(w.begin(), w.end());
  return w;
}

}  // namespace

namespace {

// The count by following the phase with one determinant a point: short lines, and those the tree cannot take.
std::optional<long> count_directly(const Sliding& s, double a, double right, double height,
                                   std::vector<Complex>& where) {
  Phase phase(s, 3e8 / double(s.size()));
  double total = 0;
  Phase::Point last = phase.at(right, height / double(s.size()));
  const auto follow = [&](Complex to, int pieces, const auto& visit) {
    const Complex from = last.z;
    const double reach = std::abs(to - from) / pieces;
    for (int k = 1; k <= pieces && !phase.failed(); ++k) {
      const Phase::Point next = phase.at(from + (to - from) * (double(k) / pieces), reach);
      total += phase.turn(last, next, visit);
      last = next;
    }
  };
  const int pieces = int(s.size()) / 4 + 8;
  const auto nothing = [](Complex, double) {};
  follow({right, height}, pieces, nothing);
  follow({a, height}, pieces, nothing);
  std::vector<std::pair<double, double>> line;  // (frequency, turn) down the line, where the eigenvalues are near
  follow(a, 4 * pieces, [&](Complex z, double turn) { line.emplace_back(z.imag(), turn); });
  if (phase.failed()) return std::nullopt;
  const double count = total / M_PI;
  if (std::abs(count - std::round(count)) > 0.01) return std::nullopt;
  // runs over which the phase turns against the many eigenvalues on the left
  std::vector<std::pair<double, double>> runs;  // (turn, frequency)
  double run = 0, weighted = 0;
  line.emplace_back(0, -1);
  for (const auto& [w, turn] : line) {
    if (turn > 0) {
      run += turn;
      weighted += turn * w;
    } else if (run > 0) {
      if (run > 0.3) runs.emplace_back(run, weighted / run);
      run = weighted = 0;
    }
  }
  std::sort(runs.rbegin(), runs.rend());
  for (const auto& [turn, w] : runs) where.emplace_back(a, w);
  return std::lround(count);
}

// The count by the tree of stretches (phase_tree.hpp). det S has a pole at every -r_i.
std::optional<long> count_by_tree(MPI_Comm comm, const Sliding& s, double a, double height,
                                  std::vector<Complex>& where) {
  const double right = s.right_of_all(), spacing = s.scene.form == Form::chain ? 1 : s.scene.h();
  if (a >= right) return 0;
  // Far to the right waves decay between the nodes like the stencil's own solutions: the tree begins further left.
  const double begin = std::max(a, std::min(right, 0.3 * std::sqrt(s.A * s.K1) / spacing));
  const std::optional<double> far = begin < right ? s.follow_pivots({right, height}, {begin, height}) : 0;
  if (!far) return std::nullopt;
  const std::optional<PhaseTurn> top = follow_phase(comm, s, {begin, height}, {a, height});
  if (!top) return std::nullopt;
  const std::optional<PhaseTurn> line = follow_phase(comm, s, {a, height}, a, 32);
  if (!line) return std::nullopt;
  const double count = (s.phase_right({right, height}) + *far + top->turn + line->turn) / M_PI;
  if (!(std::abs(count - std::round(count)) < 0.01)) return std::nullopt;
  for (const Complex& z : line->zeros) where.push_back(z.imag() >= 0 ? z : std::conj(z));
  return std::lround(count) + std::count_if(s.r.begin(), s.r.end(), [&](double r) { return -r > a; });
}

}  // namespace

std::optional<long> count_right(MPI_Comm comm, const Sliding& s, double a, double height, double effort,
                                std::vector<Complex>* where) {
  const double node_cost = 12;  // of the tree at every halving, in determinants of a node
  const double n = double(s.size());
  std::vector<Complex> places;
  std::optional<long> count;
  if (n * std::log2(n) * node_cost <= effort) count = count_by_tree(comm, s, a, height, places);
  // Right of this there is nothing, and the phase turns slowly there: half as far away again as the box is high.
  if (!count && 120 * n * n <= effort)
    count = count_directly(s, a, std::max(s.real_bound(), a) + 0.5 * height, height, places);
  if (where) *where = std::move(places);
  return count;
}

// ---- the rightmost modes ------------------------------------------------------------------------------------------

namespace {

// Equal real parts, to round-off, are put in the order of frequency.
void sort_modes(std::vector<Mode>& modes, double tolerance) {
  std::sort(modes.begin(), modes.end(), [](const Mode& a, const Mode& b) { return a.value.real() > b.value.real(); });
  for (std::size_t i = 0; i < modes.size();) {
    std::size_t j = i + 1;
    while (j < modes.size() && modes[j - 1].value.real() - modes[j].value.real() <= tolerance) ++j;
    std::sort(modes.begin() + std::ptrdiff_t(i), modes.begin() + std::ptrdiff_t(j),
              [](const Mode& a, const Mode& b) { return a.value.imag() < b.value.imag(); });
    i = j;
  }
}

bool same(const Mode& a, const Mode& b) {
  if (std::abs(a.value - b.value) > 1e-7 * (1 + std::abs(a.value))) return false;
  if (a.psi.empty() || b.psi.empty()) return true;
  const double overlap = std::norm(inner(a.psi, b.psi)) / (inner(a.psi, a.psi).real() * inner(b.psi, b.psi).real());
  return overlap > 0.5;
}

void merge(std::vector<Mode>& modes, std::vector<Mode> more) {
  for (Mode& m : more) {
    const auto twin = std::find_if(modes.begin(), modes.end(), [&](const Mode& o) { return same(o, m); });
    if (twin == modes.end()) modes.push_back(std::move(m));
  }
}

// A uniform ring has every travelling mode twice; a Krylov space built from one vector sees one of the two. The other
// is its mirror image.
void add_mirror_images(const Sliding& s, std::vector<Mode>& modes) {
  if (!s.uniform || !s.scene.ring()) return;
  std::vector<Mode> images;
  for (const Mode& m : modes) {
    Mode image = m;
    const std::size_t n = s.size();
    for (std::size_t i = 0; i < n; ++i) image.psi[i] = m.psi[(n - i) % n];
    const Complex part = inner(m.psi, image.psi) / inner(m.psi, m.psi);
    if (std::norm(part) > 0.999 * inner(image.psi, image.psi).real() / inner(m.psi, m.psi).real()) continue;
    for (std::size_t i = 0; i < n; ++i) image.psi[i] -= part * m.psi[i];
    normalise(image.psi);
    image.residual = s.mode_residual(image.value, image.psi);
    image.wavenumber = s.wavenumber(image.psi);
    images.push_back(std::move(image));
  }
  merge(modes, std::move(images));
}

}  // namespace

bool is_neutral(const Sliding& s, const Mode& m) {
  return s.neutral() && std::abs(m.value) < 1e-6 * (std::abs(s.A * s.mean_beta()) + std::sqrt(s.A * s.K1)) &&
         m.wavenumber * (s.scene.form == Form::chain ? double(s.scene.n) : s.scene.length) < 1;
}

double resolved_frequency(const Sliding& s) {
  if (s.scene.form == Form::chain) return s.imaginary_bound();
  const double k_max = M_PI / s.scene.h();
  if (s.dispersion_error(k_max) < 0.01) return s.imaginary_bound();
  double low = 0, high = k_max;
  for (int i = 0; i < 60; ++i) (s.dispersion_error((low + high) / 2) < 0.01 ? low : high) = (low + high) / 2;
  const double K = s.K0 + s.K1 * symbol(s.scene.order, s.scene.h(), low);
  return std::sqrt(s.A * K);
}

// Cubic between the nodes.
std::vector<Complex> interpolate(const Sliding& coarse, const Sliding& fine, const std::vector<Complex>& p) {
  const PetscInt n = coarse.scene.n;
  std::vector<Complex> all(std::size_t(n), Complex(0));
  for (std::size_t i = 0; i < p.size(); ++i) all[std::size_t(coarse.node[i])] = p[i];
  const auto at = [&](PetscInt i) {
    if (coarse.scene.ring()) return all[std::size_t((i + n) % n)];
    if (i < 0) return coarse.scene.left == End::free ? all[std::size_t(-i)] : 2. * all[0] - all[std::size_t(-i)];
    if (i >= n) {
      const std::size_t mirror = std::size_t(2 * (n - 1) - i), end = std::size_t(n - 1);
      return coarse.scene.right == End::free ? all[mirror] : 2. * all[end] - all[mirror];
    }
    return all[std::size_t(i)];
  };
  std::vector<Complex> q(fine.size());
  for (std::size_t i = 0; i < q.size(); ++i) {
    const double t = double(fine.node[i]) * (fine.scene.h() / coarse.scene.h());
    const PetscInt c = PetscInt(std::floor(t + 1e-9));
    const double y = t - double(c);
    q[i] = -y * (y - 1) * (y - 2) / 6 * at(c - 1) + (y + 1) * (y - 1) * (y - 2) / 2 * at(c) -
           (y + 1) * y * (y - 2) / 2 * at(c + 1) + (y + 1) * y * (y - 1) / 6 * at(c + 2);
  }
  return q;
}

namespace {

// Guesses from a grid of four times the spacing. The same on every rank: rank 0 has them.
std::vector<Mode> coarse_modes(MPI_Comm comm, const Sliding& s, SpectrumSettings settings) {
  Scene scene = s.scene;
  scene.n = scene.ring() ? scene.n / 4 : (scene.n - 1) / 4 + 1;
  settings.compare = false;
  settings.method = SpectrumMethod::krylov;
  settings.quick = s.size() > settings.long_from;
  int rank = 0;
  MPI_Comm_rank(comm, &rank);
  const Sliding coarse(scene);
  std::vector<Mode> modes = compute_spectrum(comm, coarse, settings).modes;
  if (rank > 0) modes.clear();
  for (Mode& m : modes) m.psi = interpolate(coarse, s, m.psi);
  return modes;
}

// Marks the modes that keep their value and shape on the grid of half the spacing; returns the change of the real part
// of the rightmost one that does.
double compare_grids(const Sliding& s, std::vector<Mode>& modes) {
  Scene scene = s.scene;
  scene.n = scene.ring() ? 2 * scene.n : 2 * scene.n - 1;
  const Sliding fine(scene);
  double change = 0;
  bool first = true;
  for (Mode& m : modes) {
    const double scale = std::max(std::abs(m.value), std::sqrt(s.A * s.K0));
    Mode other = m;
    other.psi = interpolate(s, fine, m.psi);
    const std::vector<Complex> guess = other.psi;
    const bool converged = polish(fine, other, 12);
    const double drift = std::min(std::abs(other.value - m.value), std::abs(std::conj(other.value) - m.value));
    const double overlap = std::max(std::norm(inner(guess, other.psi)), [&] {
                             std::vector<Complex> conjugate = other.psi;
                             for (Complex& x : conjugate) x = std::conj(x);
                             return std::norm(inner(guess, conjugate));
                           }()) / (inner(guess, guess).real() * inner(other.psi, other.psi).real());
    m.resolved = converged && drift <= 0.01 * scale && overlap > 0.3;
    if (m.resolved && first) {
      change = std::abs(other.value.real() - m.value.real());
      first = false;
    }
  }
  return change;
}

// Every rank's modes, on every rank.
void share(MPI_Comm comm, std::vector<Mode>& modes) {
  int size = 1, rank = 0;
  MPI_Comm_size(comm, &size);
  MPI_Comm_rank(comm, &rank);
  if (size == 1) return;
  std::vector<Mode> all;
  for (int owner = 0; owner < size; ++owner) {
    long shape[2] = {long(modes.size()), modes.empty() ? 0 : long(modes[0].psi.size())};
    MPI_Bcast(shape, 2, MPI_LONG, owner, comm);
    for (long k = 0; k < shape[0]; ++k) {
      Mode m;
      if (rank == owner) m = modes[std::size_t(k)];
      m.psi.resize(std::size_t(shape[1]));
      double numbers[4] = {m.value.real(), m.value.imag(), m.residual, m.wavenumber};
      MPI_Bcast(numbers, 4, MPI_DOUBLE, owner, comm);
      MPI_Bcast(m.psi.data(), int(2 * shape[1]), MPI_DOUBLE, owner, comm);
      m.value = {numbers[0], numbers[1]};
      m.residual = numbers[2];
      m.wavenumber = numbers[3];
      all.push_back(std::move(m));
    }
  }
  modes = std::move(all);
}

// Shifts where the medium with mean coefficients grows fastest, at the ends of its band, and between. One shift is
// enough where all nodes are alike.
std::vector<Complex> first_shifts(const Sliding& s, double height, PetscInt count) {
  const double b = s.mean_beta(), q = s.mean_q(), r = s.mean_r();
  const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
  const int samples = 400;
  std::vector<Complex> branch;  // rightmost root for every wavenumber
  std::vector<double> waves;
  const std::vector<Sliding::Wave> exact = s.exact_waves();
  for (int j = 0; j <= samples; ++j) {
    double k = M_PI / h * std::pow(double(j) / samples, 2);
    if (!exact.empty()) k = exact[std::size_t(double(exact.size() - 1) * std::pow(double(j) / samples, 2))].k;
    Complex best(-std::numeric_limits<double>::infinity(), 0);
    for (const Complex& z : s.dispersion(s.K0 + s.K1 * symbol(s.scene.order, h, k), b, q, r))
      if (z.imag() >= 0 && z.real() > best.real()) best = z;
    if (best.imag() > height) break;
    branch.push_back(best);
    waves.push_back(k);
  }
  const double spacing = std::sqrt(s.A * s.K1) * M_PI / (double(s.size()) * h);
  const double aside = 0.5 * spacing * std::max(1., double(count) / 4);
  std::size_t best = 0;
  for (std::size_t j = 1; j < branch.size(); ++j)
    if (branch[j].real() > branch[best].real() + 1e-12 * std::abs(branch[j])) best = j;
  std::vector<Complex> shifts{branch[best] + aside};
  if (s.uniform && !exact.empty()) return shifts;
  for (std::size_t j : {std::size_t(0), branch.size() - 1, branch.size() / 4, branch.size() / 2, 3 * branch.size() / 4})
    if (j != best) shifts.push_back(branch[j] + aside);
  shifts.push_back(aside);  // real modes
  // What the least and the most damped nodes would do alone: modes may be trapped there.
  const auto [low, high] = std::minmax_element(s.beta.begin(), s.beta.end());
  for (const auto node : {low, high}) {
    const std::size_t i = std::size_t(node - s.beta.begin());
    for (const double K : {s.K0, s.largest_stiffness()})
      for (const Complex& z : s.dispersion(K, s.beta[i], s.has_state() ? s.F_state[i] * s.g_psi[i] : 0,
                                           s.has_state() ? s.r[i] : 0))
        if (z.imag() >= 0 && z.imag() <= height && z.real() >= branch[best].real()) shifts.push_back(z + 0.1 * aside);
  }
  return shifts;
}

// A stretch of the line with a mode of its own.
struct Trapped {
  Complex value;
  std::size_t first;
  std::vector<Complex> psi;
};

// What a node would do alone: the rightmost root for three stiffnesses; or of its oscillations only.
double local_growth(const Sliding& s, std::size_t i, bool oscillations) {
  if (oscillations) return -s.A * s.beta[i] / 2;
  double local = -std::numeric_limits<double>::infinity();
  for (const double K : {s.K0, s.K0 + 0.1 * (s.largest_stiffness() - s.K0), s.largest_stiffness()})
    for (const Complex& z : s.dispersion(K, s.beta[i], s.has_state() ? s.F_state[i] * s.g_psi[i] : 0,
                                         s.has_state() ? s.r[i] : 0))
      local = std::max(local, z.real());
  return local;
}

// What stretches of the line would do alone, where the mean over 1, 4, 16, ... nodes of the local growth is largest:
// modes trapped there are nearly modes of the whole. Guesses, the rightmost `count` of them; `quick`: one
// stretch a length. `inside`: only those that are small at the ends of their stretch: others look more growing than
// they are, and stand before them.
std::vector<Mode> trapped_modes(const Sliding& s, double height, std::size_t count, bool quick, bool inside, int rank,
                                int ranks) {
  const std::size_t n = s.size();
  std::vector<double> sum{0};
  for (std::size_t i = 0; i < n; ++i) sum.push_back(sum.back() + local_growth(s, i, !s.has_state()));
  std::vector<Trapped> found;
  int task = 0;
  for (std::size_t l = 1; 32 * l < n || l == 1; l *= 4) {
    const std::size_t width = std::min(n, std::max<std::size_t>(quick ? 64 : 96, 16 * l));
    if (n > many_nodes && width > (quick ? 1 : 4) * many_nodes) break;
    std::vector<char> taken(n, 0);
    for (int k = 0; k < (quick || width > 8192 ? 1 : width <= 512 ? 12 : 3); ++k) {
      std::size_t best = n;
      double most = -std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i + l <= n; ++i)
        if (!taken[i] && sum[i + l] - sum[i] > most) most = sum[i + l] - sum[best = i];
      if (best == n) break;
      const std::size_t centre = best + l / 2, half = width / 2;
      const std::size_t first = std::min(centre > half ? centre - half : 0, n - width);
      for (std::size_t i = centre > half ? centre - half : 0; i < std::min(n, centre + half); ++i) taken[i] = 1;
      if (task++ % ranks != rank) continue;
      const Sliding part = s.stretch(first, width);
      std::vector<Mode> modes;
      if (width * s.dof() <= 300) {
        modes = dense_modes(part, 12);
      } else {
        std::vector<Complex> shifts = first_shifts(part, height, 8);
        for (std::size_t j = 0; j < std::min<std::size_t>(shifts.size(), 4); ++j)
          for (Mode& m : krylov_modes(part, shifts[j], 6)) modes.push_back(std::move(m));
      }
      const auto is_inside = [&](const std::vector<Complex>& psi) {
        double ends = 0, all = 0;
        for (std::size_t i = 0; i < psi.size(); ++i) {
          all += std::norm(psi[i]);
          const bool left = i < psi.size() / 8 && first > 0,
                     right = i >= psi.size() - psi.size() / 8 && first + width < n;
          if (left || right) ends += std::norm(psi[i]);
        }
        return ends < 0.01 * all;
      };
      for (Mode& m : modes)
        if (!m.psi.empty() && m.value.imag() <= height && (!inside || is_inside(m.psi)))
          found.push_back({m.value, first, std::move(m.psi)});
      std::sort(found.begin(), found.end(),
                [](const Trapped& a, const Trapped& b) { return a.value.real() > b.value.real(); });
      if (found.size() > count) found.resize(count);
    }
    if (width == n) break;
  }
  std::vector<Mode> guesses;
  for (const Trapped& t : found) {
    Mode m;
    m.value = t.value;
    m.psi.assign(n, Complex(0));
    std::copy(t.psi.begin(), t.psi.end(), m.psi.begin() + long(t.first));
    guesses.push_back(std::move(m));
  }
  return guesses;
}

// Guesses from the exact relation: sine waves, the rightmost first, equal ones by frequency.
std::vector<Mode> sine_modes(const Sliding& s, double height, std::size_t count) {
  const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
  struct Root {
    Complex value;
    double k;
  };
  std::vector<Root> roots;
  const double beta = s.mean_beta(), q = s.mean_q(), rate = s.mean_r();
  for (const Sliding::Wave& w : s.exact_waves())
    for (const Complex& z : s.dispersion(s.K0 + s.K1 * symbol(s.scene.order, h, w.k), beta, q, rate))
      if (z.imag() >= 0 && z.imag() <= height) roots.push_back({z, w.k});
  double right = -std::numeric_limits<double>::infinity();
  for (const Root& r : roots) right = std::max(right, r.value.real());
  const double level = 1e-9 * (std::abs(right) + s.imaginary_bound());
  std::sort(roots.begin(), roots.end(), [&](const Root& a, const Root& b) {
    const bool a_in = a.value.real() > right - level, b_in = b.value.real() > right - level;
    if (a_in != b_in) return a_in;
    return a_in ? a.value.imag() < b.value.imag() : a.value.real() > b.value.real();
  });
  std::vector<Mode> guesses;
  const double beyond = s.scene.form == Form::chain ? 0.5 : 0;
  for (std::size_t j = 0; j < std::min(count, roots.size()); ++j) {
    Mode m;
    m.value = roots[j].value;
    m.psi.resize(s.size());
    for (std::size_t i = 0; i < s.size(); ++i) {
      const double phase = roots[j].k * h * (double(s.node[i]) + (s.scene.left == End::free ? beyond : 0));
      m.psi[i] = s.scene.ring()                       ? std::polar(1., phase)
                 : s.scene.left == End::velocity ? std::sin(phase)
                                                 : std::cos(phase);
    }
    guesses.push_back(std::move(m));
  }
  return guesses;
}

// Largest distance of a mode from the nearest eigenvalue of the exact discrete relation, relative to the size of the
// eigenvalue; and the largest real part of that relation up to `height` (the neutral mode apart).
struct ExactCheck {
  double error, growth;
};
std::optional<ExactCheck> check_dispersion(const Sliding& s, const std::vector<Mode>& modes, double height) {
  const std::vector<Sliding::Wave> waves = s.exact_waves();
  if (waves.empty()) return std::nullopt;
  const double h = s.scene.form == Form::chain ? 1 : s.scene.h();
  std::vector<Complex> roots;
  const double beta = s.mean_beta(), q = s.mean_q(), rate = s.mean_r();
  double growth = -std::numeric_limits<double>::infinity();
  for (const Sliding::Wave& w : waves) {
    bool neutral = s.neutral() && w.k == 0;  // one root 0 of this wave is the symmetry
    for (const Complex& z : s.dispersion(s.K0 + s.K1 * symbol(s.scene.order, h, w.k), beta, q, rate)) {
      if (z.imag() < 0) continue;
      roots.push_back(z);
      if (neutral && std::abs(z) == 0) {
        neutral = false;
        continue;
      }
      if (z.imag() <= height) growth = std::max(growth, z.real());
    }
  }
  std::sort(roots.begin(), roots.end(), [](const Complex& a, const Complex& b) { return a.imag() < b.imag(); });
  double error = 0;
  for (const Mode& m : modes) {
    const double scale = std::max(std::abs(m.value), std::sqrt(s.A * std::max(s.K0, 1e-300)));
    double nearest = std::numeric_limits<double>::infinity();
    auto up = std::lower_bound(roots.begin(), roots.end(), m.value.imag(),
                               [](const Complex& a, double y) { return a.imag() < y; });
    for (auto it = up; it != roots.end() && it->imag() - m.value.imag() <= nearest; ++it)
      nearest = std::min(nearest, std::abs(*it - m.value));
    for (auto it = up; it != roots.begin() && m.value.imag() - (it - 1)->imag() <= nearest; --it)
      nearest = std::min(nearest, std::abs(*(it - 1) - m.value));
    error = std::max(error, nearest / scale);
  }
  return ExactCheck{error, growth};
}

std::string number(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", x);
  return text;
}

}  // namespace

Spectrum compute_spectrum(MPI_Comm comm, const Sliding& s, const SpectrumSettings& settings) {
  int ranks = 1, rank = 0;
  MPI_Comm_size(comm, &ranks);
  MPI_Comm_rank(comm, &rank);
  if (s.size() == 0) throw Failure("the scene has no node left to solve for: both ends are held");
  Spectrum result;
  const bool refine = settings.refine && s.scene.form == Form::continuum;
  const double bound = 1.01 * s.imaginary_bound();
  const double height = refine ? std::min(bound, resolved_frequency(s)) : bound;
  const PetscInt unknowns = PetscInt(s.size() * s.dof());
  const bool dense = settings.method == SpectrumMethod::dense ||
                     (settings.method == SpectrumMethod::automatic && unknowns <= 200) || unknowns < 16;
  if (dense && unknowns > 6000)
    throw UsageError("-spectrum_method dense: " + std::to_string(unknowns) +
                     " unknowns are too many for a dense matrix; take krylov (or at most 6000 unknowns)");
  result.method = dense ? "dense" : "krylov";
  double margin = 0;  // between the rightmost mode found and the line right of which all are counted

  std::vector<Mode> modes;
  const auto in_reach = [&](const Mode& m) { return m.value.imag() <= height; };
  const auto counts = [&](const Mode& m) { return in_reach(m) && !is_neutral(s, m); };
  // the rightmost mode within reach that is no symmetry
  const auto rightmost = [&] {
    const Mode* best = nullptr;
    for (const Mode& m : modes)
      if (counts(m) && (!best || m.value.real() > best->value.real())) best = &m;
    return best;
  };
  const auto tolerance = [&](const Mode& m) {
    return std::max(10 * rounding(s, m.value), 1e-11 * (1 + bound));
  };

  if (dense) {
    modes = dense_modes(s, unknowns);
    sort_modes(modes, 1e-10 * bound * epsilon);
    // Only what is shown, and the rightmost mode within reach, is polished.
    PetscInt kept = 0;
    std::vector<Mode> some;
    for (Mode& m : modes) {
      const bool needed = kept < settings.count + 2 || (counts(m) && std::none_of(some.begin(), some.end(), counts));
      if (!needed) continue;
      const Complex before = m.value;
      Mode polished = m;
      m.residual = s.mode_residual(m.value, m.psi);
      m.wavenumber = s.wavenumber(m.psi);
      if (polish(s, polished) && std::abs(polished.value - before) <= 1e-6 * (1 + std::abs(before))) m = polished;
      kept += m.value.imag() > 0 ? 2 : 1;
      some.push_back(m);
    }
    modes = std::move(some);
    result.complete = true;
    result.completeness_check = "every eigenvalue of the matrix was computed (LAPACK)";
  } else {
    if (s.neutral()) {
      Mode m;
      m.value = 0;
      m.psi.assign(s.size(), Complex(1));
      m.residual = s.mode_residual(0, m.psi);
      modes.push_back(std::move(m));
    }
    const PetscInt wanted = settings.count / 2 + 2;
    const bool many = s.size() > settings.long_from;
    // The rightmost guesses within reach, and some beyond it, are shared among the ranks and polished.
    const auto select = [&](std::vector<Mode>& guesses) {
      std::size_t inside = 0, outside = 0;
      sort_modes(guesses, 1e-9 * (1 + bound));
      guesses.erase(std::remove_if(guesses.begin(), guesses.end(), [&](const Mode& m) {
        const std::size_t most = many ? (counts(m) ? wanted + 1 : 1) : wanted + 4;
        return ++(counts(m) ? inside : outside) > most;
      }), guesses.end());
    };
    const auto take = [&](std::vector<Mode> guesses) {  // each rank has its own guesses
      select(guesses);
      share(comm, guesses);
      std::vector<Mode> apart, polished;
      merge(apart, std::move(guesses));
      select(apart);
      for (std::size_t k = 0; k < apart.size(); ++k)
        if (int(k) % ranks == rank && polish(s, apart[k])) merge(polished, {std::move(apart[k])});
      share(comm, polished);
      merge(modes, std::move(polished));
      add_mirror_images(s, modes);
    };
    const auto search = [&](const std::vector<Complex>& shifts, PetscInt count) {
      std::vector<Mode> found;
      for (std::size_t k = 0; k < shifts.size(); ++k)
        if (int(k) % ranks == rank) {
          merge(found, krylov_modes(s, shifts[k], count));
          select(found);
        }
      take(std::move(found));
    };
    // Modes near places where the count has seen them.
    const auto take_near = [&](const std::vector<Complex>& places) {
      std::vector<Mode> found;
      for (std::size_t k = 0; k < places.size(); ++k)
        if (int(k) % ranks == rank) found.push_back(mode_near(s, places[k]));
      take(std::move(found));
    };
    // Zeros that are no mode known, and would be among the wanted ones.
    const auto unknown = [&](std::vector<Complex> zeros) {
      std::vector<double> growth;
      for (const Mode& m : modes)
        if (counts(m)) growth.push_back(m.value.real());
      std::sort(growth.rbegin(), growth.rend());
      const double least = PetscInt(growth.size()) < wanted ? -std::numeric_limits<double>::infinity()
                                                            : growth[std::size_t(wanted) - 1] + 1e-9 * (1 + bound);
      zeros.erase(std::remove_if(zeros.begin(), zeros.end(), [&](Complex z) {
        return z.real() < least || std::any_of(modes.begin(), modes.end(), [&](const Mode& m) {
                 return std::abs(m.value - z) < 1e-7 * (1 + std::abs(z));
               });
      }), zeros.end());
      if (zeros.size() > std::size_t(wanted)) zeros.resize(std::size_t(wanted));
      return zeros;
    };
    const bool waves = !s.exact_waves().empty();
    if (waves && many) {
      take(rank == 0 ? sine_modes(s, height, std::size_t(wanted) + 2) : std::vector<Mode>());
    } else if (many) {
      std::vector<Complex> shifts = first_shifts(s, height, settings.count);
      // the grid-scale end of the band is sought where it matters: modes trapped there crowd
      if (!refine && !settings.quick)
        search({*std::max_element(shifts.begin(), shifts.end(),
                                  [](Complex a, Complex b) { return a.imag() < b.imag(); })},
               wanted);
      if (shifts.size() > 2) shifts.resize(2);
      take_near(shifts);
      if (!s.uniform && !settings.quick) {
        take(trapped_modes(s, height, std::size_t(wanted), refine, false, rank, ranks));
        if (!refine) take(trapped_modes(s, height, std::size_t(wanted), true, true, rank, ranks));
      }
      if (s.scene.form == Form::continuum && s.scene.n > 200) take(coarse_modes(comm, s, settings));
    } else {
      search(first_shifts(s, height, settings.count), std::min<PetscInt>(unknowns, 2 * wanted));
      if (!s.uniform) take(trapped_modes(s, height, std::size_t(wanted), settings.quick, false, rank, ranks));
      if (refine && s.scene.n >= 2000 && !settings.quick) take(coarse_modes(comm, s, settings));
    }
    if (!rightmost()) throw Failure("the eigenvalue solver found nothing");

    // Where all modes of a long grid count and the search has not closed: those that the grid resolves, whose own search
    // is not led astray by crowds at the grid scale. Once.
    bool resolved_sought = refine || !many || settings.quick || s.scene.form == Form::chain;
    const auto take_resolved = [&] {
      if (std::exchange(resolved_sought, true)) return false;
      SpectrumSettings resolved = settings;
      resolved.refine = true;
      resolved.compare = false;
      std::vector<Mode> found = compute_spectrum(comm, s, resolved).modes;
      if (rank > 0) found.clear();
      take(std::move(found));
      return true;
    };

    const std::optional<ExactCheck> exact = check_dispersion(s, {}, height);
    int scan = 4;
    for (int round = 0;; ++round) {
      if (settings.quick) {
        result.completeness_check = "not checked";
        break;
      }
      const Mode& best = *rightmost();
      const double growth = best.value.real(), line = growth + tolerance(best);
      if (exact) {
        result.complete = exact->growth <= line;
        result.completeness_check = result.complete
            ? "the exact dispersion relation of all modes has none further right"
            : "the exact dispersion relation has a mode further right, at " + number(exact->growth);
        if (result.complete || round >= 12) break;
      } else if (s.symmetric && !s.has_state() && s.real_bound() <= line) {
        result.complete = true;
        result.completeness_check = "no mode can exceed -1/2 of the least damping, which the rightmost one attains";
        break;
      }
      std::vector<Complex> where;
      if (!exact) {
        std::optional<long> count = count_right(comm, s, line, height, settings.effort, &where);
        double counted = line;
        if (!count && many) {
          // Beside strongly trapped modes round-off hides the phase: from further right it is seen, at the price of a
          // wider margin.
          double high = line + 2e-5 * (1 + std::abs(growth));
          for (std::size_t i = 0; i < s.size(); ++i) high = std::max(high, local_growth(s, i, false));
          for (double aside = 1e-7 * (1 + std::abs(growth)); !count && line + aside < high; aside *= 10)
            count = count_right(comm, s, counted = line + aside, height, settings.effort, &where);
        }
        if (!count) {
          if (take_resolved()) continue;
          result.completeness_check = "not checked: counting the eigenvalues right of the line failed or would take "
                                      "too long at " + std::to_string(s.size()) + " nodes";
          break;
        }
        const auto judge = [&] {
          long expected = 0;
          for (const Mode& m : modes)
            if (m.value.real() > counted && in_reach(m)) expected += m.value.imag() > 0 ? 2 : 1;
          result.complete = *count == expected;
          margin = counted - line;
          result.completeness_check = "argument principle: " + std::to_string(*count) +
                                      " eigenvalues with real part above " + number(counted) + " and |Im| below " +
                                      number(height) + ", " + std::to_string(expected) + " expected";
        };
        judge();
        if (many) {
          where = unknown(std::move(where));
          const std::size_t before = modes.size();
          take_near(where);
          if (modes.size() > before && round < 5 && (!result.complete || rightmost()->value.real() > line)) continue;
          // Trapped modes are ill-conditioned: to the count the rightmost itself may stand right of the line.
          for (double aside = 1e-6; !result.complete && aside < 1e-3; aside *= 10) {
            const double further = line + aside * (1 + std::abs(growth));
            if (const auto again = count_right(comm, s, further, height, settings.effort)) {
              count = again;
              counted = further;
              judge();
            }
          }
          if (!result.complete && take_resolved()) continue;
          break;
        }
        if (result.complete || round >= 12) break;
        where.erase(std::remove_if(where.begin(), where.end(), [line](Complex z) { return z.real() < line; }),
                    where.end());
      }
      // look where the count points, and scan ever more densely
      std::vector<Complex> shifts;
      const std::vector<double> knots = mean_frequencies(s);
      const double spacing = height / double(s.size());
      const double near = std::max(1e-3 * (1 + std::abs(growth)), 0.5 * spacing);
      const double aside = near + std::max(0., s.real_bound() - line) * 0.25 * (round % 4);
      for (std::size_t k = 0; k < std::min<std::size_t>(where.size(), 8); ++k) {
        shifts.push_back(where[k] + near);
        if (round > 0) shifts.push_back(where[k] + aside);
      }
      if (where.empty() || round > 1) {
        for (int k = 0; k < scan; ++k) {
          const double w = knots.empty() ? height * k / scan
                                         : knots[std::size_t(double(knots.size() - 1) * (k + 0.5) / scan)];
          if (w <= height) shifts.emplace_back(line + aside, w);
        }
        for (int k = 0; k < scan; ++k)  // real modes may stand far to the right
          shifts.emplace_back(line + aside + (s.real_bound() - line) * k / scan, 0);
        scan = std::min<int>(2 * scan, 4 + int(s.size() / 4));
      }
      search(shifts, std::min<PetscInt>(unknowns, 8));
    }
  }

  const Mode* best = rightmost();
  if (!best) throw Failure("no eigenvalue was found that the grid can resolve; take more nodes (grid_n)");
  sort_modes(modes, tolerance(*best));
  // what is shown: the rightmost of all, and the rightmost within reach whatever its place
  std::vector<Mode> shown;
  PetscInt eigenvalues = 0, within = 0;
  for (Mode& m : modes) {
    const PetscInt members = m.value.imag() > 0 ? 2 : 1;
    if (eigenvalues < settings.count || (counts(m) && within < 1)) {
      eigenvalues += members;
      within += counts(m) ? members : 0;
      shown.push_back(std::move(m));
    }
  }
  modes = std::move(shown);
  double change = 0;
  if (refine && settings.compare) {
    change = compare_grids(s, modes);
    for (Mode& m : modes) m.resolved = m.resolved && in_reach(m);
  }
  if (const auto exact = check_dispersion(s, modes, height)) result.dispersion_error = exact->error;
  result.growth = result.frequency = std::numeric_limits<double>::quiet_NaN();
  for (const Mode& m : modes)
    if (m.resolved && !is_neutral(s, m)) {
      result.growth = m.value.real();
      result.frequency = m.value.imag();
      result.error = change + tolerance(m) + margin;
      break;
    }
  result.stable = result.growth < -result.error;
  result.modes = std::move(modes);
  return result;
}

}  // namespace stickslip
