#include "stickslip/stability/spectrum.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>

#include "stability/closed_form.hpp"
#include "stability/modes.hpp"
#include "stability/search.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/stability/continuum.hpp"
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

}  // namespace stickslip
