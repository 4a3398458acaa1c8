#include "stickslip/stability/spectrum.hpp"

#include <slepceps.h>

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "base/pulse.hpp"
#include "stability/modes.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

namespace {

// Marks the modes that the grid resolves: where all are waves, by their wavenumber, as in Waves::resolved;
// else those that keep their value and shape on the grid of half the spacing. Returns the change of the real
// part of the rightmost one.
double compare_grids(const LinearisedOperator& s, std::vector<Mode>& modes) {
  Scene scene = s.scene;
  scene.n = scene.ring() ? 2 * scene.n : 2 * scene.n - 1;
  const LinearisedOperator fine(scene);
  const double last = resolved_wavenumber(s.scene.order, s.scene.h());
  double change = 0;
  bool first = true;
  std::vector<Mode> others;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    if (k % 4 == 0) {  // a few at a time: few weights to compute, little memory
      others.assign(modes.begin() + k, modes.begin() + std::min(k + 4, modes.size()));
      std::vector<std::vector<Complex>*> shapes;
      for (Mode& m : others) shapes.push_back(&m.psi);
      interpolate(s, fine, shapes);
    }
    Mode &m = modes[k], &other = others[k % 4];
    const double scale = std::max(std::abs(m.value), s.rate_of(s.K0));
    const std::vector<Complex> guess = other.psi;
    const bool converged = polish(fine, other, 12);
    const double drift =
        std::min(std::abs(other.value - m.value), std::abs(std::conj(other.value) - m.value));
    const double overlap = std::max(std::norm(inner(guess, other.psi)),
                                    [&] {
                                      std::vector<Complex> conjugate = other.psi;
                                      for (Complex& x : conjugate) x = std::conj(x);
                                      return std::norm(inner(guess, conjugate));
                                    }()) /
                           (inner(guess, guess).real() * inner(other.psi, other.psi).real());
    m.resolved = converged && drift <= 0.01 * scale && overlap > 0.3;
    if (s.has_exact_waves()) m.resolved = m.wavenumber <= (1 + 1e-6) * last;
    if (m.resolved && converged && first) {
      change = std::abs(other.value.real() - m.value.real());
      first = false;
    }
  }
  return change;
}

bool refined(const LinearisedOperator& s, const Mode& from, Mode& mode) {
  return polish(s, mode) && std::abs(mode.value - from.value) <= 1e-6 * (own_rate(s) + std::abs(from.value));
}

// Two real eigenvalues that are equal, or nearly, come from LAPACK as a pair with a frequency of round-off:
// the other one, whose vector is what is left of the pair's beside the first one's.
std::optional<Mode> real_twin(const LinearisedOperator& s, const Mode& pair, const Mode& first) {
  Mode other = pair;
  other.value = pair.value.real();
  remove_part(other.psi, first.psi);
  if (!refined(s, pair, other) || other.value.imag() > 0 || !is_new(s, {first}, other)) return std::nullopt;
  return other;
}

// All eigenvalues by LAPACK; of them what is shown, and some more, polished. What cannot be polished without
// the loss of an eigenvalue stays as it is.
std::vector<Mode> dense_search(const LinearisedOperator& s, const SpectrumSettings& settings, double height) {
  std::vector<Mode> modes = dense_modes(s, s.unknowns());
  // LAPACK's round-off hides which of equal real parts is larger
  sort_modes(modes, 1e-10 * (own_rate(s) + s.imaginary_bound()));
  modes.erase(
      std::remove_if(modes.begin(), modes.end(), [&](const Mode& m) { return m.value.imag() > height; }),
      modes.end());
  modes.resize(shown_modes(s, modes, height, settings.count + 2));
  std::vector<Mode> twins;
  for (Mode& m : modes) {
    Mode polished = m;
    m.residual = s.mode_residual(m.value, m.psi);
    m.wavenumber = s.wavenumber(m.psi);
    if (!refined(s, m, polished)) continue;
    if (m.value.imag() > 0 && polished.value.imag() == 0) {
      std::optional<Mode> twin = real_twin(s, m, polished);
      if (!twin) continue;
      twins.push_back(std::move(*twin));
    }
    m = std::move(polished);
  }
  std::move(twins.begin(), twins.end(), std::back_inserter(modes));
  return modes;
}

// The leading mode: the first that is resolved and no symmetry. Others with its growth rate are told.
void lead(const LinearisedOperator& s, const Tolerance& tolerance, double error, Spectrum& result) {
  result.growth = result.frequency = std::numeric_limits<double>::quiet_NaN();
  const Mode* first = nullptr;
  for (const Mode& m : result.modes) {
    if (!m.resolved || is_neutral(s, m)) continue;
    const double same = 4 * tolerance(m);
    if (!first) {
      first = &m;
      result.growth = m.value.real();
      result.frequency = m.value.imag();
      result.error = error + tolerance(m);
    } else if (first->value.real() - m.value.real() <= same &&
               std::abs(m.value - first->value) > 1e3 * same) {
      result.degenerate = true;
    }
  }
  result.stable = result.growth < -result.error;
}

// What the waves that the grid does not carry do.
void look_beyond_grid(const LinearisedOperator& s, double height, bool refine, Spectrum& result) {
  if (s.scene.form == Form::chain) return;
  const std::string beyond = refine ? "the grid" : "the matrix";
  if (const auto continuum = continuum_lead(s)) {
    result.growth_continuum = continuum->growth;
    if (std::isfinite(continuum->wavenumber)) result.wavenumber_continuum = continuum->wavenumber;
    // at the threshold the growth rate is round-off, of either sign
    const double round_off = 8 * epsilon * s.rate_of(s.K0);
    const bool decays = continuum->growth < -round_off;
    if (result.stable && !decays)
      result.remarks.push_back(fmt::format(
          "waves of the continuum that {} does not carry {} (growth_continuum)", beyond,
          continuum->growth > round_off
              ? fmt::format("grow, at up to {:.6g}", continuum->growth)
              : "decay at rates that come to 0: sliding in the continuum is neither stable nor unstable"));
    result.stable = result.stable && (decays || !refine);
    return;
  }
  if (!refine) return;
  const double limit = short_wave_growth(s);
  if (result.stable && limit > 0) {
    result.stable = false;
    result.remarks.push_back("waves shorter than the grid carries grow, at " + rounded_text(limit, 3) +
                             " as they become ever shorter: sliding in the continuum is not stable");
  } else if (result.frequency > 0.5 * height && limit > result.growth - 0.1 * std::abs(result.growth)) {
    result.remarks.push_back(
        fmt::format("the leading mode is among the shortest waves that the grid carries, and shorter ones "
                    "come to grow at {:.3g}: take more nodes (grid_n) for the growth rate",
                    limit));
  }
}

}  // namespace

Spectrum compute_spectrum(MPI_Comm comm, const LinearisedOperator& s, const SpectrumSettings& settings) {
  if (s.size() == 0) throw Failure("the scene has no node left to solve for: both ends are held");
  Spectrum result;
  const bool refine = settings.refine && s.scene.form == Form::continuum;
  const double bound = 1.01 * s.imaginary_bound();
  const double height = refine ? std::min(bound, resolved_frequency(s)) : bound;
  const PetscInt unknowns = s.unknowns();
  const bool dense = settings.method == SpectrumMethod::dense ||
                     (settings.method == SpectrumMethod::automatic && unknowns <= 200) || unknowns < 16;
  if (dense && unknowns > 6000)
    throw UsageError("-spectrum_method dense: " + std::to_string(unknowns) +
                     " unknowns are too many for a dense matrix; take krylov (or at most 6000 unknowns)");
  const Tolerance tolerance(s);
  double error = 0;
  std::vector<Mode> modes;
  if (dense) {
    result.method = "dense";
    modes = dense_search(s, settings, height);
    result.complete = result.list_complete = true;
    result.missing = 0;
    result.completeness_check = "every eigenvalue of the matrix was computed (LAPACK)";
  } else {
    result.method = "krylov";
    ModeSearch search(comm, s, settings, height);
    modes = search.run(result);
    error = search.margin();
  }
  modes.erase(
      std::remove_if(modes.begin(), modes.end(), [&](const Mode& m) { return m.value.imag() > height; }),
      modes.end());
  const auto leads = [&](const Mode& m) { return !is_neutral(s, m); };
  const auto best = std::find_if(modes.begin(), modes.end(), leads);
  if (best == modes.end())
    throw Failure("no eigenvalue was found that the grid can resolve; take more nodes (grid_n)");
  sort_modes(modes, tolerance(*best));
  modes.resize(shown_modes(s, modes, height, settings.count));
  const PetscInt listed = std::accumulate(
      modes.begin(), modes.end(), PetscInt(0),
      [](PetscInt sum, const Mode& m) { return sum + eigenvalues_of(m.value); });
  const PetscInt wanted = std::min(settings.count, unknowns);
  if (!refine && listed < wanted)
    result.remarks.push_back(fmt::format(
        "{} of the {} eigenvalues asked for are listed, the rightmost: the search did not reach further; "
        "-spectrum_method dense computes all of them",
        listed, wanted));
  if (refine && settings.compare) error += compare_grids(s, modes);
  if (const ExactModes exact(s); exact.apply()) result.dispersion_error = exact.distance(modes);
  result.modes = std::move(modes);
  lead(s, tolerance, error, result);
  look_beyond_grid(s, height, refine && settings.compare, result);
  return result;
}

ExactModes::ExactModes(const LinearisedOperator& s) : s_(s) {
  for (const LinearisedOperator::Wave& w : s.exact_waves())
    for (const Complex& z : dispersion(s.point(0), s.symbol(w.k)))  // all nodes are alike
      if (z.imag() >= 0) roots_.push_back({z, w.k, w.multiplicity * (z.imag() > 0 ? 2 : 1)});
  std::sort(roots_.begin(), roots_.end(),
            [](const Root& a, const Root& b) { return a.value.imag() < b.value.imag(); });
}

long ExactModes::count(double a, double height) const {
  long sum = 0;
  for (const Root& r : roots_)
    if (r.value.real() > a && r.value.imag() <= height) sum += r.members;
  return sum;
}

double ExactModes::distance(const std::vector<Mode>& modes) const {
  double worst = 0;
  for (const Mode& m : modes) {
    const double scale = std::max(std::abs(m.value), s_.rate_of(std::max(s_.K0, 1e-300)));
    double nearest = std::numeric_limits<double>::infinity();
    const auto up = std::lower_bound(roots_.begin(), roots_.end(), m.value.imag(),
                                     [](const Root& a, double y) { return a.value.imag() < y; });
    for (auto it = up; it != roots_.end() && it->value.imag() - m.value.imag() <= nearest; ++it)
      nearest = std::min(nearest, std::abs(it->value - m.value));
    for (auto it = up; it != roots_.begin() && m.value.imag() - (it - 1)->value.imag() <= nearest; --it)
      nearest = std::min(nearest, std::abs((it - 1)->value - m.value));
    worst = std::max(worst, nearest / scale);
  }
  return worst;
}

std::vector<Mode> ExactModes::rightmost(double height, std::size_t count) const {
  std::vector<Root> roots(roots_.begin(), std::find_if(roots_.begin(), roots_.end(), [&](const Root& r) {
                            return r.value.imag() > height;
                          }));
  // without a state the real parts of all oscillating waves are equal to the last bit
  std::stable_sort(roots.begin(), roots.end(),
                   [](const Root& a, const Root& b) { return a.value.real() > b.value.real(); });
  std::vector<Mode> modes(std::min(count, roots.size()));
  for (std::size_t j = 0; j < modes.size(); ++j) {
    modes[j].value = roots[j].value;
    modes[j].psi = s_.wave(roots[j].k);
  }
  return modes;
}

double short_wave_growth(const LinearisedOperator& s) {
  double sum = 0, length = 0, growth = -std::numeric_limits<double>::infinity();
  if (s.N > 0) {
    growth = -s.K1 / s.N;
    for (std::size_t i = 0; i < s.size() && s.has_state(); ++i) growth = std::max(growth, -s.point(i).r());
    return growth;
  }
  for (std::size_t i = 0; i < s.size(); ++i) {
    // a held end has no unknown: its half of an interval goes to the node beside it
    const double extra =
        !s.scene.ring() && s.coupling.weight[i] == 1 && (i == 0 || i + 1 == s.size()) ? 0.5 : 0;
    sum += (s.coupling.weight[i] + extra) * s.point(i).damping();
    length += s.coupling.weight[i] + extra;
    if (s.has_state()) growth = std::max(growth, -s.point(i).r());
  }
  return std::max(growth, -sum / length / 2);
}

// The eigenvalues by SLEPc: all of them, or those near a shift.

namespace {

// re + i im, or re alone.
std::vector<Complex> entries_of(Vec re, Vec im, bool real) {
  PetscInt n = 0;
  SS_TRY(VecGetSize(re, &n));
  const Reading x(re), y(im);
  std::vector<Complex> entries;
  for (PetscInt i = 0; i < n; ++i) entries.emplace_back(x[i], real ? 0. : y[i]);
  return entries;
}

// x in units of the entries of a node, or out of them.
void scale(std::vector<Complex>& x, const std::vector<double>& units) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] *= units[i % units.size()];
}

// psi of an eigenvector of J in those units.
std::vector<Complex> velocities_of(const LinearisedOperator& s, const std::vector<double>& units,
                                   std::vector<Complex> x) {
  scale(x, units);
  std::vector<Complex> psi(s.size());
  for (std::size_t i = 0; i < psi.size(); ++i) psi[i] = s.psi_of(&x[i * s.dof()], i);
  return psi;
}

}  // namespace

// ---- dense

std::vector<Mode> dense_modes(const LinearisedOperator& s, PetscInt count) {
  const std::size_t n = s.unknowns(), dof = s.dof();
  const std::vector<double> units = s.balance();
  std::vector<double> J(n * n);
  for (const LinearisedOperator::Entry& e : s.entries())
    J[e.column * n + e.row] += e.value * (units[e.column % dof] / units[e.row % dof]);
  const LogStage solving("eigenvalues");
  constexpr std::size_t takes_a_second = 500;
  if (n > takes_a_second)
    announce(
        fmt::format("all eigenvalues of {} unknowns in one call of LAPACK's, some {:.0f} s, which hears no "
                    "signal but a second one",
                    n, std::ceil(7e-9 * std::pow(double(n), 3))),
        "dense matrices");
  std::vector<Eigenpair> pairs = eigenpairs(int(n), std::move(J));
  beat("dense matrices");
  std::vector<Mode> modes;
  PetscInt eigenvalues = 0;
  for (Eigenpair& pair : pairs) {
    Mode mode;
    mode.value = pair.value;
    if (eigenvalues < count) {
      mode.psi = velocities_of(s, units, std::move(pair.vector));
      eigenvalues += eigenvalues_of(pair.value);
    }
    modes.push_back(std::move(mode));
  }
  return modes;
}

// ---- krylov

namespace {

struct ShiftedInverse {
  const LinearisedOperator& J;
  const std::vector<double> units, per_unit;
  Complex sigma;
  BandLU lu;
};

// y = Re (J - sigma)^-1 x, J balanced: real, with the eigenvectors of J, largest for eigenvalues near sigma
// and its conjugate.
PetscErrorCode apply_shifted_inverse(Mat M, Vec x, Vec y) {
  return guarded([&] {
    ShiftedInverse* op = nullptr;
    SS_TRY(MatShellGetContext(M, &op));
    const Reading in(x);
    const Writing out(y);
    const std::size_t n = op->J.unknowns();
    std::vector<Complex> entries(in + 0, in + n);
    scale(entries, op->units);
    std::vector<Complex> image = op->J.resolvent(op->sigma, op->lu, entries);
    scale(image, op->per_unit);
    for (std::size_t i = 0; i < n; ++i) out[i] = image[i].real();
  });
}

// Before the lines of -eps_monitor: which of several solutions they are of.
void say_solver(Complex sigma, PetscInt unknowns) {
  PetscBool is_watched = PETSC_FALSE;
  for (const char* monitor : {"-eps_monitor", "-eps_monitor_all", "-eps_monitor_conv"}) {
    PetscBool is_set;
    SS_TRY(PetscOptionsHasName(nullptr, nullptr, monitor, &is_set));
    is_watched = is_set ? PETSC_TRUE : is_watched;
  }
  if (!is_watched || rank_in(PETSC_COMM_WORLD) != 0) return;
  SS_TRY(PetscPrintf(PETSC_COMM_SELF,
                     "EPS of the eigenvalues nearest to %g%+gi of %" PetscInt_FMT " unknowns\n", sigma.real(),
                     sigma.imag(), unknowns));
}

// Nothing where LAPACK gives up: it may fail to put values that nearly coincide in order (trexc).
std::optional<std::vector<Mode>> modes_near(const LinearisedOperator& s, Complex sigma, PetscInt count) {
  const PetscInt n = s.unknowns();
  const std::vector<double> units = s.balance();
  std::vector<double> per_unit;
  for (const double unit : units) per_unit.push_back(1 / unit);
  ShiftedInverse op{s, units, per_unit, sigma, {}};
  s.factor(sigma, op.lu);
  MatHandle M;
  SS_TRY(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, &op, M.out()));
  SS_TRY(MatShellSetOperation(M, MATOP_MULT, reinterpret_cast<void (*)()>(apply_shifted_inverse)));
  Handle<EPS, EPSDestroy> eps;
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
    const Writing x(start);
    Noise noise;
    for (PetscInt i = 0; i < n; ++i) x[i] = noise.next();
  }
  Vec first = start;
  SS_TRY(EPSSetInitialSpace(eps, 1, &first));
  SS_TRY(EPSSetFromOptions(eps));
  const LogStage solving("eigenvalues");
  say_solver(sigma, n);
  try {
    SS_TRY(EPSSolve(eps));
  } catch (const RankFailure& e) {
    if (std::string(e.what()).find("LAPACK subroutine") == std::string::npos) throw;
    return std::nullopt;
  }
  PetscInt found = 0;
  SS_TRY(EPSGetConverged(eps, &found));
  std::vector<Mode> modes;
  for (PetscInt j = 0; j < found; ++j) {
    PetscScalar a, b;
    SS_TRY(EPSGetEigenpair(eps, j, &a, &b, start, im));
    if (b > 0) continue;  // mu is conjugate to lambda, roughly; either member of a pair gives both
    const std::vector<Complex> vector = entries_of(start, im, b == 0);
    std::vector<Complex> image = vector;
    scale(image, units);
    image = s.multiply(image);
    scale(image, per_unit);
    Mode mode;
    mode.value = inner(vector, image) / inner(vector, vector);
    mode.psi = velocities_of(s, units, vector);
    modes.push_back(std::move(mode));
  }
  return modes;
}

}  // namespace

std::vector<Mode> krylov_modes(const LinearisedOperator& s, Complex sigma, PetscInt count) {
  const double aside = 0.01 * (own_rate(s) + std::abs(sigma));
  for (const Complex& shift : {sigma, sigma + aside, sigma + Complex(aside, 2 * aside)})
    if (auto modes = modes_near(s, shift, count)) return *std::move(modes);
  return {};
}

}  // namespace stickslip
