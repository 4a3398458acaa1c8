#include "stickslip/waves/wave_stability.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <set>

#include "stickslip/base/error.hpp"
#include "waves/spectral_line.hpp"

namespace stickslip {

namespace {

using Complex = std::complex<double>;
// a growth rate of the infinite train below this is that of the translation
constexpr double marginal = 1e-7;
constexpr double growing_line = 1e-5;  // of growing_modes
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// A factor exp(i theta) over a period T of xi = t - x/V is one of exp(-i theta) over x = V T: k = -theta/(V
// T).
double wavenumber_of(double theta, const Train& train) {
  return std::remainder(-theta, 2 * M_PI) / (train.speed * train.period) + 0.;  // no negative zero
}

// Where eigenvalues are as near as 1 + |frequency| in the frame of the medium, however fast the train.
double carrier_scale(const Train& train, Complex lambda) {
  return 1 + std::abs(lambda) * std::sqrt(train.oscillator->c2()) / std::abs(train.speed);
}

// A train whose short waves grow: it is unstable and has infinitely many modes that say so. True where it is
// one.
bool short_waves_grow(const Transfer& transfer, TrainSpectrum& out) {
  const double mean = transfer.damping().mean;
  if (mean > 0) return false;
  out.growth_rate = out.growth_bound = out.infinite_growth = -mean / 2;
  out.known = out.infinite_known = true;
  out.completeness_check =
      "waves of any short length grow at " + rounded_text(-mean / 2) + ": no list is complete";
  return true;
}

// V/c - 1 down to which spectra have been compared with an independent computation. Nearer to c the waves
// that run with the train have ever shorter scales, and neither the answer nor the time it takes is known to
// be sound.
constexpr double nearest_to_c = 1e-7;

std::string too_near_c(const Train& train) {
  const double V = std::abs(train.speed), c = std::sqrt(train.oscillator->c2());
  // r2 = 1 - c^2/V^2 keeps its digits
  if (!(train.r2 < 2 * nearest_to_c * (1 - 2 * nearest_to_c))) return "";
  return "not computed: V/c - 1 = " + rounded_text(train.r2 * V / (V + c) * V / c, 4) + " is below " +
         rounded_text(nearest_to_c) + ", where spectra of trains have not been verified";
}

// Leaves the growth rates unknown (NaN).
bool unverified(const Train& train, TrainSpectrum& out) {
  out.completeness_check = too_near_c(train);
  if (out.completeness_check.empty()) return false;
  out.growth_rate = out.growth_bound = out.translation_error = unknown;
  out.infinite_growth = out.infinite_wavenumber = out.infinite_frequency = unknown;
  warn("the stability of the train is " + out.completeness_check);
  return true;
}

// A medium without coupling: every point keeps the phase that it has.
bool uncoupled(const Train& train, TrainSpectrum& out) {
  if (train.oscillator->c2() > 0) return false;
  out.known = out.infinite_known = out.infinite_stable = true;
  out.completeness_check = "without coupling (c = 0) every phase is free: infinitely many neutral modes";
  return true;
}

// The infinite train: what its curves show right of a line.
void fill_infinite_train(const Train& train, const SpectralCurves& curves, TrainSpectrum& out) {
  out.infinite_growth = marginal;
  for (const SpectralCurve& curve : curves.list)
    for (const CurvePoint& p : curve.points) {
      if (p.lambda.real() <= out.infinite_growth) continue;
      out.infinite_growth = p.lambda.real();
      out.infinite_frequency = std::abs(p.lambda.imag());
      out.infinite_wavenumber =
          wavenumber_of(std::copysign(1., p.lambda.imag()) * p.phase(train.period), train);
    }
  const bool grows = out.infinite_growth > marginal;
  out.infinite_stable = curves.whole && !grows;
  out.infinite_known = curves.whole || grows;
  if (!grows) out.infinite_growth = curves.whole ? 0 : unknown;
}

// A mode not yet computed: which of the list it is, and where about it lies.
struct RootCandidate {
  long long M;
  const SpectralCurve* curve;
  std::size_t near;  // point of the curve
  Complex lambda;
};

double phase_of(long long M, const Train& train) { return 2 * M_PI * double(M) / double(train.pulses); }

// The modes of one curve that may belong to the `wanted` rightmost: all where they are few, else those next
// to its summits, between which the growth rate falls away.
void add_candidates(const SpectralCurve& curve, const Train& train, int wanted,
                    std::vector<RootCandidate>& list) {
  const ModeRange range = curve.modes(train.period, train.pulses);
  std::set<long long> chosen;
  if (range.hi - range.lo < 4LL * wanted) {
    for (long long M = range.lo; M <= range.hi; ++M) chosen.insert(M);
  } else {
    for (std::size_t k = 0; k < curve.points.size(); ++k) {
      if (!curve.is_summit(k)) continue;
      const long long middle = std::llround(curve.points[k].phase(train.period) / phase_of(1, train));
      const long long last = std::min(range.hi, middle + wanted);
      for (long long M = std::max(range.lo, middle - wanted); M <= last; ++M) chosen.insert(M);
    }
  }
  for (const long long M : chosen) {
    std::size_t near;
    const Complex lambda = curve.lambda_near(phase_of(M, train), train.period, near);
    list.push_back({M, &curve, near, lambda});
  }
}

// A candidate as a mode, computed again on a mesh twice as fine. False where it cannot be reached, or another
// is.
bool compute(const RootCandidate& candidate, Transfer& coarse, Transfer& fine, TrainMode& mode) {
  const Train& train = coarse.train();
  const double phase = phase_of(candidate.M, train);
  CurvePoint p = candidate.curve->points[candidate.near];
  const double scale = carrier_scale(train, p.lambda), gap = std::abs(p.lambda - candidate.lambda);
  if (!follow(coarse, p, phase, 1e-10) || std::abs(p.lambda - candidate.lambda) > gap / 2 + 1e-4 * scale)
    return false;
  CurvePoint exact = p;
  const bool again = follow(fine, exact, phase, 1e-10);
  mode.resolved = again && std::abs(exact.lambda - p.lambda) < 1e-4 * scale;
  mode.lambda = again ? exact.lambda : p.lambda;
  mode.residual = again ? std::abs(exact.lambda - p.lambda) / scale : 1;
  mode.bloch = PetscInt(((candidate.M % train.pulses) + train.pulses) % train.pulses);
  mode.wavenumber = wavenumber_of(phase, train);
  mode.translation = mode.bloch == 0 && std::abs(mode.lambda) < 1e-4;
  return true;
}

TrainMode conjugate(const TrainMode& mode, PetscInt pulses) {
  TrainMode other = mode;
  other.lambda = std::conj(mode.lambda);
  other.bloch = (pulses - mode.bloch) % pulses;
  other.wavenumber = -mode.wavenumber + 0.;
  return other;
}

// Up to here two modes are one.
double same_mode(const TrainMode& mode, const Train& train) {
  return 1e-8 * carrier_scale(train, mode.lambda);
}

// The modes right of the line, the `wanted` rightmost at least. False where one was not reached.
bool modes_right_of(const SpectralCurves& curves, Transfer& coarse, Transfer& fine, int wanted,
                    std::vector<TrainMode>& modes) {
  const Train& train = coarse.train();
  std::vector<RootCandidate> candidates;
  for (const SpectralCurve& curve : curves.list) add_candidates(curve, train, wanted, candidates);
  std::stable_sort(candidates.begin(), candidates.end(), [](const RootCandidate& a, const RootCandidate& b) {
    return a.lambda.real() > b.lambda.real();
  });
  // a few more than wanted, since the order is that of an interpolation as yet
  bool all = true;
  for (const RootCandidate& c : candidates) {
    if (int(modes.size()) >= wanted + 8) break;
    TrainMode mode;
    if (!compute(c, coarse, fine, mode)) {
      all = false;
      continue;
    }
    modes.push_back(mode);
    if (c.curve->has_image) modes.push_back(conjugate(mode, train.pulses));
  }
  std::sort(modes.begin(), modes.end(), [](const TrainMode& a, const TrainMode& b) {
    return a.lambda.real() != b.lambda.real() ? a.lambda.real() > b.lambda.real()
                                              : a.lambda.imag() > b.lambda.imag();
  });
  // pairs whose two were computed each by itself, and are one number
  for (std::size_t k = 0; k + 1 < modes.size(); ++k) {
    const Complex image = std::conj(modes[k].lambda);
    if (image.imag() > 0 && std::abs(image - modes[k + 1].lambda) <= same_mode(modes[k], train)) {
      std::swap(modes[k], modes[k + 1]);
      modes[k].lambda = image;
    }
  }
  return all;
}

// Whether no mode stands in the list twice.
bool all_different(const std::vector<TrainMode>& modes, const Train& train) {
  for (std::size_t k = 0; k < modes.size(); ++k)
    for (std::size_t j = k + 1; j < modes.size(); ++j) {
      const double same = same_mode(modes[k], train);
      if (modes[k].lambda.real() - modes[j].lambda.real() > same) break;
      if (modes[k].bloch == modes[j].bloch && std::abs(modes[k].lambda - modes[j].lambda) <= same)
        return false;
    }
  return true;
}

// How far from 0 the eigenvalue stands that belongs to the derivative of the train.
double error_of_translation(Transfer& transfer) {
  const double step = 1e-4 / transfer.train().period;
  const Multipliers here = transfer.at(0), there = transfer.at(step);
  int best = 0;
  for (int k = 1; k < here.count; ++k)
    if (std::abs(here.log_rho[k]) < std::abs(here.log_rho[best])) best = k;
  const Complex slope = (there.log_rho[best] - here.log_rho[best]) / step;
  return std::abs(here.log_rho[best] / (slope - transfer.train().period));
}

// The modes right of one line.
struct RootSearch {
  std::unique_ptr<SpectralLine> line;
  SpectralCurves curves;
  std::vector<TrainMode> modes;  // sorted; the `wanted` rightmost at least
  long long counted = 0;
  bool complete = false;
  // Whether the list says how fast the train is left or comes back: a mode besides the translation.
  bool tells() const { return modes.size() > 1; }
};

RootSearch search(Transfer& coarse, Transfer& fine, double sigma, int wanted) {
  RootSearch s;
  s.line = std::make_unique<SpectralLine>(coarse, sigma);
  s.counted = s.line->count(coarse.train().pulses);
  s.curves = curves_of(coarse, *s.line);
  const bool reached = modes_right_of(s.curves, coarse, fine, wanted, s.modes);
  bool resolved = true;
  for (size_t k = 0; k < std::min(s.modes.size(), size_t(wanted)); ++k)
    resolved = resolved && s.modes[k].resolved;
  const auto found = (long long)s.modes.size();
  // the translation is right of every line: it is among those listed as far as they reach left of 0
  const bool due = found == s.counted || (found > 0 && s.modes.back().lambda.real() < -1e-4);
  const bool there =
      std::any_of(s.modes.begin(), s.modes.end(), [](const TrainMode& m) { return m.translation; });
  const bool all = found == s.counted || (s.curves.whole && reached && found >= wanted && found < s.counted);
  s.complete =
      s.line->closed() && all && resolved && (there || !due) && all_different(s.modes, coarse.train());
  return s;
}

// How far left of 0 a line may stand. Short waves decay at half the mean of C, without its peaks (at small
// psi) those that the peaks hold still. Near V = c waves that run with the train grow where C < -Re lambda,
// by exp(Re lambda^2/(2 r2 |dC/dt|)) about: that must not be large.
double depth_of(const Transfer& transfer) {
  const TrainDamping damping = transfer.damping();
  double most = 4 * damping.usual, mean = transfer.damping_within(most);
  while (mean < .01 * damping.usual && most < 1e9 * damping.usual) mean = transfer.damping_within(most *= 4);
  const Train& train = transfer.train();
  const double at_fronts = std::sqrt(train.r2 * damping.slope) / 2;
  return std::min(mean / 4, at_fronts);
}

// A line so far left that the modes wanted stand right of it, or one besides the translation at least, for
// which it may go nearer to where the short waves begin; further right where two multipliers meet right of it
// and a curve cannot be followed.
RootSearch best_search(Transfer& coarse, Transfer& fine, int wanted) {
  const double depth = depth_of(coarse);
  RootSearch s = search(coarse, fine, -depth / 4, wanted);
  for (const double at : {.5, 1., 1.25, 1.5, 1.75, 1.9}) {
    if (!s.complete || s.counted >= std::max(wanted, 2) || (at > 1 && s.tells())) break;
    RootSearch further = search(coarse, fine, -at * depth, wanted);
    if (!further.complete) break;
    if (s.curves.whole && !further.curves.whole) further.curves = std::move(s.curves);  // of what grows
    s = std::move(further);
  }
  for (double at = depth / 16; !s.complete && at > depth / 1200; at /= 4) {
    RootSearch nearer = search(coarse, fine, -at, wanted);
    if (nearer.complete) s = std::move(nearer);
  }
  return s;
}

// What keeps a line from counting.
constexpr const char* trouble = "waves of higher frequency grow faster than that";

// The growth rate and what follows from it: a mode that grows makes the train unstable, whatever else was not
// found; only a list that is whole makes it stable.
void judge(const RootSearch& found, TrainSpectrum& out) {
  double error = std::max(10 * out.translation_error, 1e-9);
  out.growth_rate = unknown;
  out.growth_known = out.complete;
  for (const TrainMode& mode : found.modes) {
    if (mode.lambda.real() > found.line->sigma() / 10) error = std::max(error, mode.residual);
    if (!mode.translation) out.growth_rate = std::fmax(out.growth_rate, mode.lambda.real());
  }
  out.growth_bound = std::isnan(out.growth_rate) ? found.line->sigma() : out.growth_rate;
  out.stable = out.complete && out.growth_bound < -error;
  out.known = out.stable || out.growth_rate > error;
}

}  // namespace

std::vector<Complex> bloch_factors(const Train& train, Complex lambda) {
  const Multipliers m = Transfer(train, 1).at(lambda);
  std::vector<Complex> factors;
  for (int k = 0; k < m.count; ++k) factors.push_back(std::exp(m.log_rho[k] - lambda * train.period));
  return factors;
}

bool follow_mode(const Train& train, TrainMode& mode) {
  Transfer transfer(train, 1);
  const double T = train.period, theta = 2 * M_PI * double(mode.bloch) / double(train.pulses),
               step = 1e-4 / T;
  const auto difference = [](Complex a, Complex b) {
    return Complex(a.real() - b.real(), std::remainder(a.imag() - b.imag(), 2 * M_PI));
  };
  const auto nearest = [&](const Multipliers& m, Complex to) {
    return *std::min_element(m.log_rho, m.log_rho + m.count, [&](Complex a, Complex b) {
      return std::abs(difference(a, to)) < std::abs(difference(b, to));
    });
  };
  const Complex here = nearest(transfer.at(mode.lambda), mode.lambda * T + Complex(0, theta));
  const Complex there = nearest(transfer.at(mode.lambda + step), here);
  CurvePoint p{mode.lambda, here, difference(there, here) / step};
  const double phase = p.phase(T);
  if (!follow(transfer, p, phase + std::remainder(theta - phase, 2 * M_PI), 1e-10)) return false;
  mode.lambda = p.lambda;
  return true;
}

std::vector<int> growing_modes(const Train& train) {
  TrainSpectrum out;
  Transfer transfer(train, 1);
  std::vector<int> counts(train.pulses / 2 + 1, 1);
  if (uncoupled(train, out)) return std::vector<int>(counts.size(), 0);
  if (const std::string reason = too_near_c(train); !reason.empty())
    throw Failure("the stability of the train is " + reason);
  if (short_waves_grow(transfer, out)) return counts;
  // right of what a kink of the friction leaves of the translation's 0
  const SpectralLine line(transfer, std::max(growing_line, 3 * error_of_translation(transfer)));
  if (!line.closed()) throw Failure(std::string("the growing modes of the train are not known: ") + trouble);
  for (std::size_t m = 0; m < counts.size(); ++m)
    counts[m] = int(std::min<long long>(line.count(train.pulses, PetscInt(m)), 1 << 30));
  return counts;
}

TrainSpectrum infinite_train_stability(const Train& train) {
  TrainSpectrum out;
  Transfer transfer(train, 1);
  if (uncoupled(train, out) || unverified(train, out) || short_waves_grow(transfer, out)) return out;
  fill_infinite_train(train, curves_of(transfer, SpectralLine(transfer, -depth_of(transfer) / 4)), out);
  return out;
}

TrainSpectrum train_spectrum(const Train& train, int count) {
  TrainSpectrum out;
  if (uncoupled(train, out) || unverified(train, out)) return out;
  Transfer coarse(train, 1), fine(train, 2);
  if (short_waves_grow(coarse, out)) return out;
  RootSearch found = best_search(coarse, fine, count);
  const SpectralLine& line = *found.line;
  out.translation_error = error_of_translation(coarse);
  if (out.translation_error > 1e-4)
    warn("the translation mode of the train was not found: its spectrum is not to be trusted");
  out.complete = found.complete && out.translation_error <= 1e-4;
  const auto size = (long long)found.modes.size();
  out.completeness_check = fmt::format(
      "argument of the determinant along Re = {:.10g}, |Im| up to {:.8g}: {} eigenvalues to the right, {}{} "
      "found{}",
      line.sigma(), line.top(), found.counted,
      out.complete && size < found.counted ? "the rightmost " : "", size,
      line.closed() ? "" : std::string("; ") + trouble);
  if (!out.complete) warn("the spectrum of the train is not complete: " + out.completeness_check);
  judge(found, out);
  fill_infinite_train(train, found.curves, out);
  out.modes = std::move(found.modes);
  if (out.modes.size() > size_t(count)) out.modes.resize(size_t(count));
  return out;
}

}  // namespace stickslip
