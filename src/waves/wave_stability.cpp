#include "stickslip/waves/wave_stability.hpp"

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
constexpr double marginal = 1e-7;      // a growth rate of the endless train below this is that of the translation
constexpr double growing_line = 1e-5;  // of growing_modes

// A factor exp(i theta) over a period T of xi = t - x/V is one of exp(-i theta) over x = V T: k = -theta/(V T).
double wavenumber_of(double theta, const Train& train) {
  return std::remainder(-theta, 2 * M_PI) / (train.speed * train.period) + 0.;  // no negative zero
}

// Where eigenvalues are as near as 1 + |frequency| in the frame of the medium, however fast the train.
double carrier_scale(const Train& train, Complex lambda) {
  return 1 + std::abs(lambda) * std::sqrt(train.oscillator->c2()) / std::abs(train.speed);
}

// A train whose short waves grow: it is unstable and has infinitely many modes that say so. True where it is one.
bool short_waves_grow(const Transfer& transfer, TrainSpectrum& out) {
  const double mean = transfer.damping().mean;
  if (mean > 0 || transfer.train().nu > 0) return false;  // viscosity makes them decay
  out.growth_rate = out.endless_growth = -mean / 2;
  out.completeness_check = "waves of any short length grow at " + rounded_text(-mean / 2) + ": no list is complete";
  return true;
}

// V/c - 1 down to which spectra have been compared with an independent computation. Nearer to c the waves that run with
// the train have ever shorter scales, and neither the answer nor the time it takes is known to be sound.
constexpr double nearest_to_c = 1e-7;

std::string too_near_c(const Train& train) {
  const double V = std::abs(train.speed), c = std::sqrt(train.oscillator->c2());
  if (!(train.r2 < 2 * nearest_to_c * (1 - 2 * nearest_to_c))) return "";  // r2 = 1 - c^2/V^2 keeps its digits
  return "not computed: V/c - 1 = " + rounded_text(train.r2 * V / (V + c) * V / c, 4) + " is below " +
         rounded_text(nearest_to_c) + ", where spectra of trains have not been verified";
}

// Leaves the growth rates unknown (NaN).
bool unverified(const Train& train, TrainSpectrum& out) {
  out.completeness_check = too_near_c(train);
  if (out.completeness_check.empty()) return false;
  out.growth_rate = out.translation_error = std::numeric_limits<double>::quiet_NaN();
  out.endless_growth = out.endless_wavenumber = out.endless_frequency = out.growth_rate;
  warn("the stability of the train is " + out.completeness_check);
  return true;
}

// A medium without coupling: every point keeps the phase that it has.
bool uncoupled(const Train& train, TrainSpectrum& out) {
  if (train.oscillator->c2() > 0) return false;
  out.endless_stable = true;
  out.completeness_check = "without coupling (c = 0) every phase is free: infinitely many neutral modes";
  return true;
}

using Curve = std::vector<CurvePoint>;

// The place of largest growth between three points of a curve, by parabolas in the phase.
CurvePoint summit(Transfer& transfer, CurvePoint left, CurvePoint top, CurvePoint right) {
  const double T = transfer.train().period;
  for (int it = 0; it < 12; ++it) {
    const double a = left.phase(T), b = top.phase(T), c = right.phase(T);
    const double fa = left.lambda.real(), fb = top.lambda.real(), fc = right.lambda.real();
    const double p = (b - a) * (fb - fc), q = (b - c) * (fb - fa);
    if (p == q) break;
    double at = b - ((b - a) * p - (b - c) * q) / (2 * (p - q));
    if (!((at - a) * (at - c) < 0) || at == b) break;
    CurvePoint next = top;
    if (!follow(transfer, next, at, 1e-9)) break;
    const double gain = next.lambda.real() - top.lambda.real();
    if (gain > 0) {
      ((at - b) * (c - b) > 0 ? left : right) = top;
      top = next;
    } else {
      ((at - b) * (c - b) > 0 ? right : left) = next;
    }
    if (std::abs(gain) < 1e-11) break;
  }
  return top;
}

// Puts the place of largest growth beside every point of the curve that has more of it than its neighbours.
void add_summits(Transfer& transfer, Curve& curve) {
  Curve with;
  for (size_t k = 0; k < curve.size(); ++k) {
    const double here = curve[k].lambda.real();
    const bool peak = k > 0 && k + 1 < curve.size() && here >= curve[k - 1].lambda.real() &&
                      here > curve[k + 1].lambda.real();
    if (!peak) {
      with.push_back(curve[k]);
      continue;
    }
    const CurvePoint top = summit(transfer, curve[k - 1], curve[k], curve[k + 1]);
    const double T = transfer.train().period, passed = curve[k].phase(T) - top.phase(T);  // the phase falls
    if (passed < 0) with.push_back(top);
    with.push_back(curve[k]);
    if (passed > 0) with.push_back(top);
  }
  curve = std::move(with);
}

bool is_summit(const Curve& curve, size_t k) {
  return k > 0 && k + 1 < curve.size() && curve[k].lambda.real() >= curve[k - 1].lambda.real() &&
         curve[k].lambda.real() > curve[k + 1].lambda.real();
}

void fill_endless(const Train& train, const std::vector<Curve>& curves, bool closed, TrainSpectrum& out) {
  out.endless_growth = marginal;
  for (const Curve& curve : curves)
    for (const CurvePoint& p : curve) {
      if (p.lambda.real() <= out.endless_growth) continue;
      out.endless_growth = p.lambda.real();
      out.endless_frequency = std::abs(p.lambda.imag());
      out.endless_wavenumber = wavenumber_of(std::copysign(1., p.lambda.imag()) * p.phase(train.period), train);
    }
  out.endless_stable = closed && out.endless_growth == marginal;
  if (out.endless_growth == marginal) out.endless_growth = 0;
}

// Whether an arc is the mirror image of one at positive frequencies.
bool is_mirror(const Arc& arc) { return arc.front().omega + arc.back().omega < 0 && arc.back().omega < 0; }

// A mode not yet computed: where to start from, and how far right it is about to lie.
struct Candidate {
  long long M;
  const Arc* arc;
  const Curve* curve;
  size_t near;  // point of the curve
  double growth;
};

// The growth rate a part of the way in phase from one point of a curve to the next: Hermite's cubic.
double growth_between(const CurvePoint& a, const CurvePoint& b, double part, double T) {
  const double h = b.phase(T) - a.phase(T);
  const auto slope = [&](const CurvePoint& p) { return (Complex(0, 1) / (p.slope - T)).real() * h; };
  const double rest = 1 - part;
  return rest * rest * ((1 + 2 * part) * a.lambda.real() + part * slope(a)) +
         part * part * ((1 + 2 * rest) * b.lambda.real() - rest * slope(b));
}

// The modes of one arc that may belong to the `wanted` rightmost: all where they are few, else those next to the
// summits of the curve, between which the growth rate falls away.
void add_candidates(const Arc& arc, const Curve& curve, const Train& train, int wanted, std::vector<Candidate>& list) {
  const ModeRange range = modes_of(arc, train.pulses);
  const double T = train.period, per = double(train.pulses) / (2 * M_PI);
  std::set<long long> chosen;
  const auto around = [&](double phase) {
    const long long middle = std::llround(phase * per);
    const long long last = std::min(range.hi, middle + wanted);
    for (long long M = std::max(range.lo, middle - wanted); M <= last; ++M) chosen.insert(M);
  };
  if (range.hi - range.lo < 4LL * wanted) {
    for (long long M = range.lo; M <= range.hi; ++M) chosen.insert(M);
  } else {
    for (size_t k = 0; k < curve.size(); ++k)
      if (is_summit(curve, k)) around(curve[k].phase(T));
  }
  for (const long long M : chosen) {
    const double phase = double(M) / per;
    size_t k = 0;  // the phase falls along the curve
    while (k + 2 < curve.size() && curve[k + 1].phase(T) > phase) ++k;
    const double part = (phase - curve[k].phase(T)) / (curve[k + 1].phase(T) - curve[k].phase(T));
    list.push_back({M, &arc, &curve, part < .5 ? k : k + 1, growth_between(curve[k], curve[k + 1], part, T)});
  }
}

// A candidate as a mode, computed again on a mesh twice as fine. False where it cannot be reached.
bool compute(const Candidate& candidate, Transfer& coarse, Transfer& fine, TrainMode& mode) {
  const Train& train = coarse.train();
  const double phase = 2 * M_PI * double(candidate.M) / double(train.pulses);
  CurvePoint p = (*candidate.curve)[candidate.near];
  if (!follow(coarse, p, phase, 1e-10)) return false;
  CurvePoint exact = p;
  const bool again = follow(fine, exact, phase, 1e-10);
  const double scale = carrier_scale(train, p.lambda);
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

// The modes right of the line, the `wanted` rightmost at least. False where one was not reached.
bool modes_right_of(const SpectralLine& line, const std::vector<Curve>& curves, Transfer& coarse, Transfer& fine,
                    int wanted, std::vector<TrainMode>& modes) {
  const Train& train = coarse.train();
  std::vector<Candidate> candidates;
  for (size_t k = 0; k < curves.size(); ++k)
    if (!curves[k].empty()) add_candidates(line.arcs()[k], curves[k], train, wanted, candidates);
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.growth > b.growth; });
  // a few more than wanted, since the order is that of an interpolation as yet
  bool all = true;
  int taken = 0;
  for (const Candidate& c : candidates) {
    if (taken >= wanted + 8) break;
    TrainMode mode;
    if (!compute(c, coarse, fine, mode)) {
      all = false;
      continue;
    }
    modes.push_back(mode);
    ++taken;
    // arcs at negative frequencies are images of others
    if (c.arc->front().omega > 0) {
      modes.push_back(conjugate(mode, train.pulses));
      ++taken;
    }
  }
  std::sort(modes.begin(), modes.end(), [](const TrainMode& a, const TrainMode& b) {
    return a.lambda.real() != b.lambda.real() ? a.lambda.real() > b.lambda.real() : a.lambda.imag() > b.lambda.imag();
  });
  return all;
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

std::vector<Curve> curves_of(Transfer& transfer, const SpectralLine& line) {
  std::vector<Curve> curves;
  for (const Arc& arc : line.arcs())
    curves.push_back(is_mirror(arc) ? Curve() : curve_of(transfer, arc, line.sigma()));
  return curves;
}

// Have the curves of a line been followed from end to end, and is nothing beyond the line's ends? With viscosity a curve
// must come back to the line where its arc ends, too: it does not where the multiplier that is left out meets the arc's own
// between the two.
bool whole(const SpectralLine& line, const std::vector<Curve>& curves, const Train& train) {
  bool all = line.closed();
  for (size_t k = 0; k < curves.size(); ++k) {
    const Arc& arc = line.arcs()[k];
    if (is_mirror(arc)) continue;
    all = all && curves[k].size() == arc.size();
    if (all && train.nu > 0)
      all = std::abs(curves[k].back().lambda - Complex(line.sigma(), arc.back().omega)) * train.period < 1e-3;
  }
  return all;
}

// The modes right of one line.
struct Search {
  std::unique_ptr<SpectralLine> line;
  std::vector<Curve> curves;
  std::vector<TrainMode> modes;  // sorted; the `wanted` rightmost at least
  long long counted = 0;
  bool curves_whole = false, complete = false;
};

Search search(Transfer& coarse, Transfer& fine, double sigma, int wanted) {
  Search s;
  s.line = std::make_unique<SpectralLine>(coarse, sigma);
  s.counted = s.line->count(coarse.train().pulses);
  s.curves = curves_of(coarse, *s.line);
  s.curves_whole = whole(*s.line, s.curves, coarse.train());
  for (Curve& curve : s.curves) add_summits(coarse, curve);
  const bool reached = modes_right_of(*s.line, s.curves, coarse, fine, wanted, s.modes);
  bool resolved = true;
  for (size_t k = 0; k < std::min(s.modes.size(), size_t(wanted)); ++k) resolved = resolved && s.modes[k].resolved;
  const auto found = (long long)s.modes.size();
  // the translation is right of every line: where all are listed, it is among them
  const bool translation =
      std::any_of(s.modes.begin(), s.modes.end(), [](const TrainMode& m) { return m.translation; });
  s.complete = s.curves_whole && reached && resolved && (found == s.counted ? translation : found >= wanted);
  return s;
}

// How far left of 0 a line may stand. Short waves decay at half the mean of C, without its peaks (at
// small psi) those that the peaks hold still. Near V = c waves that run with the train grow where C < -Re lambda, by
// exp(Re lambda^2/(2 r2 |dC/dt|)) about: that must not be large. With viscosity the shortest waves creep back at c^2/nu,
// and the mean of C may be negative.
double depth_of(const Transfer& transfer) {
  const TrainDamping damping = transfer.damping();
  double most = 4 * damping.usual, mean = transfer.damping_within(most);
  while (mean < .01 * damping.usual && most < 1e9 * damping.usual) mean = transfer.damping_within(most *= 4);
  const Train& train = transfer.train();
  const double at_fronts = std::sqrt(train.r2 * damping.slope) / 2;
  if (!(train.nu > 0)) return std::min(mean / 4, at_fronts);
  const Oscillator& o = *train.oscillator;
  return std::min({std::max(mean / 4, std::sqrt(o.A() * o.K0()) / 20), at_fronts, o.c2() / (4 * train.nu)});
}

// A line so far left that the modes wanted stand right of it; further right where two multipliers meet right of it and
// a curve cannot be followed.
Search best_search(Transfer& coarse, Transfer& fine, int wanted) {
  const double depth = depth_of(coarse), first = depth / 4;
  Search s = search(coarse, fine, -first, wanted);
  for (double at = 2 * first; s.complete && s.counted < wanted && at <= depth; at *= 2) {
    Search further = search(coarse, fine, -at, wanted);
    if (!further.complete) break;
    s = std::move(further);
  }
  for (double at = first / 4; !s.complete && at > first / 300; at /= 4) {
    Search nearer = search(coarse, fine, -at, wanted);
    if (nearer.complete) s = std::move(nearer);
  }
  return s;
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
  const double T = train.period, theta = 2 * M_PI * double(mode.bloch) / double(train.pulses), step = 1e-4 / T;
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
  std::vector<int> counts(std::size_t(train.pulses / 2 + 1), 1);
  if (uncoupled(train, out)) return std::vector<int>(counts.size(), 0);
  if (const std::string reason = too_near_c(train); !reason.empty())
    throw Failure("the stability of the train is " + reason);
  if (short_waves_grow(transfer, out)) return counts;
  const SpectralLine line(transfer, growing_line);
  if (!line.separate()) throw Failure("the growing modes of the train are not known: with this viscosity multipliers meet");
  for (std::size_t m = 0; m < counts.size(); ++m)
    counts[m] = int(std::min<long long>(line.count(train.pulses, PetscInt(m)), 1 << 30));
  return counts;
}

TrainSpectrum endless_stability(const Train& train) {
  TrainSpectrum out;
  Transfer transfer(train, 1);
  if (uncoupled(train, out) || unverified(train, out) || short_waves_grow(transfer, out)) return out;
  const SpectralLine line(transfer, -depth_of(transfer) / 4);
  std::vector<Curve> curves = curves_of(transfer, line);
  const bool curves_whole = whole(line, curves, train);
  for (Curve& curve : curves) add_summits(transfer, curve);
  fill_endless(train, curves, curves_whole, out);
  return out;
}

TrainSpectrum train_spectrum(const Train& train, int count) {
  TrainSpectrum out;
  if (uncoupled(train, out) || unverified(train, out)) return out;
  Transfer coarse(train, 1), fine(train, 2);
  if (short_waves_grow(coarse, out)) return out;
  Search found = best_search(coarse, fine, count);
  const SpectralLine& line = *found.line;
  out.translation_error = error_of_translation(coarse);
  if (out.translation_error > 1e-4)
    warn("the translation mode of the train was not found: its spectrum is not to be trusted");
  out.growth_rate = line.sigma();
  for (const TrainMode& mode : found.modes)
    if (!mode.translation) out.growth_rate = std::max(out.growth_rate, mode.lambda.real());
  out.complete = found.complete && out.translation_error <= 1e-4;
  const auto size = (long long)found.modes.size();
  out.completeness_check = "argument of the determinant along Re = " + rounded_text(line.sigma(), 10) +
                           ", |Im| up to " + rounded_text(line.top(), 8) + ": " + std::to_string(found.counted) +
                           " eigenvalues to the right, " + (size < found.counted ? "the rightmost " : "") +
                           std::to_string(size) + " found" +
                           (!line.separate()   ? "; with this viscosity multipliers meet right of it"
                            : !line.closed() ? "; waves of higher frequency grow faster than that"
                                             : "");
  double error = std::max(10 * out.translation_error, 1e-9);
  for (const TrainMode& mode : found.modes)
    if (mode.lambda.real() > line.sigma() / 10) error = std::max(error, mode.residual);
  out.stable = out.complete && out.growth_rate < -error;
  if (!out.complete) warn("the spectrum of the train is not complete: " + out.completeness_check);
  fill_endless(train, found.curves, found.curves_whole, out);
  out.modes = std::move(found.modes);
  if (out.modes.size() > size_t(count)) out.modes.resize(size_t(count));
  return out;
}

}  // namespace stickslip
