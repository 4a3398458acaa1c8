// The growth rate of waves on a cycle as a function of their wavenumber: every place where it is largest.
//
// Samples are added until the multipliers of neighbours lie next to each other, those that matter: whose
// growth could be the largest or positive. ln(multiplier)/T changes by c or so for each unit of the
// wavenumber, the speed at which anything travels; this bounds what lies between two samples, and where the
// bound passes the largest known of finite waves, the top between them is looked for. Where all nodes are
// alike the equations of a wave are real: two multipliers that turn towards each other on a circle meet on
// the real axis and part along it, which opens a band of growth beside a resonance. Between two samples that
// both show a pair beside the real axis it is looked for by the distance of the pair, squared, which passes
// through their meeting smoothly. Local to the process.
#include "stickslip/cycles/cycle.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "base/pulse.hpp"
#include "cycles/cycle_waves.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

class WaveScan {
 public:
  struct Setting {
    double period;
    double turning;  // |d ln(multiplier)/dk| of waves, or so
    bool real;       // the multipliers come in conjugate pairs
  };
  // `first`: the wavenumber 0 and evenly spaced ones. `diffusion`: of the phase mode, which is followed from
  // 0 on until it grows at -diffusion k^2.
  WaveScan(std::function<BlochPoint(double)> at, std::vector<BlochPoint> first, double diffusion,
           const Setting& setting);

  // wavenumbers rise; every top is among them
  const std::vector<BlochPoint>& points() const { return points_; }
  // Of waves that are not on the way down from the phase mode's 0 at k = 0: what that does its diffusion
  // says.
  double largest_of_finite() const;

 private:
  bool matched(const BlochPoint& a, const BlochPoint& b) const;
  // bound on the growth between point k and the next, over the larger of theirs
  double rise_within(std::size_t k) const;
  std::size_t first_rise() const;
  void follow_phase_mode(double diffusion);
  void fill_in();
  void find_resonances();
  void find_tops();

  std::function<BlochPoint(double)> at_;
  Setting setting_;
  std::vector<BlochPoint> points_;
  double shortest_;  // wavenumbers nearer than this are not told apart
};

namespace {

using std::size_t;
using Complex = std::complex<double>;
constexpr double longest_move = .8;  // of ln(multiplier) between neighbours
// ln|multiplier|, below the largest or 0, from which on they are told apart
constexpr double of_interest = -.3;
constexpr double of_rise = .75;  // of `turning` over the step: what may lie between two samples
constexpr size_t most_points = 20000, most_tops = 40;

Complex log_of(Complex z) { return std::log(std::abs(z) > 1e-300 ? z : Complex(1e-300)); }

Complex apart(Complex a, Complex b) {  // of logarithms
  return {a.real() - b.real(), std::remainder(a.imag() - b.imag(), 2 * M_PI)};
}

// How far from the real axis the angle of the leading complex multiplier stands, and on which side: 0 or pi.
bool beside_real_axis(const BlochPoint& p, double least, double& angle, bool& negative) {
  for (const Complex& z : p.multipliers) {
    if (z.imag() == 0) continue;
    if (std::log(std::abs(z)) < least) return false;
    negative = z.real() < 0;
    angle = std::atan2(std::abs(z.imag()), std::abs(z.real()));
    return true;
  }
  return false;
}

// The least distance of two multipliers on that side of the imaginary axis, squared: negative where they are
// conjugate.
double separation(const std::vector<Complex>& multipliers, bool negative) {
  Complex best = 1e300;
  for (size_t i = 0; i < multipliers.size(); ++i)
    for (size_t j = i + 1; j < multipliers.size(); ++j) {
      if ((multipliers[i].real() < 0) != negative || (multipliers[j].real() < 0) != negative) continue;
      const Complex between = apart(log_of(multipliers[i]), log_of(multipliers[j]));
      if (std::abs(between) < std::abs(best)) best = between;
    }
  return (best * best).real();
}

}  // namespace

WaveScan::WaveScan(std::function<BlochPoint(double)> at, std::vector<BlochPoint> first, double diffusion,
                   const Setting& setting)
    : at_(std::move(at)), setting_(setting), points_(std::move(first)),
      shortest_(1e-3 * (points_[1].wavenumber - points_[0].wavenumber)) {
  follow_phase_mode(diffusion);
  fill_in();
  if (setting_.real) find_resonances();
  find_tops();
}

double WaveScan::largest_of_finite() const {
  double most = points_.back().growth_rate;
  for (size_t k = first_rise(); k < points_.size(); ++k) most = std::max(most, points_[k].growth_rate);
  return most;
}

size_t WaveScan::first_rise() const {
  size_t k = 0;
  while (k + 1 < points_.size() && points_[k + 1].growth_rate < points_[k].growth_rate) ++k;
  return k + 1;
}

double WaveScan::rise_within(size_t k) const {
  return of_rise * setting_.turning / setting_.period * (points_[k + 1].wavenumber - points_[k].wavenumber);
}

bool WaveScan::matched(const BlochPoint& a, const BlochPoint& b) const {
  const double least = of_interest + std::min(0., setting_.period * std::max(a.growth_rate, b.growth_rate));
  for (const auto& [one, other] : {std::pair(&a, &b), std::pair(&b, &a)})
    for (const Complex& z : one->multipliers) {
      const Complex log_z = log_of(z);
      if (log_z.real() < least) continue;
      const bool near =
          std::any_of(other->multipliers.begin(), other->multipliers.end(),
                      [&](const Complex& w) { return std::abs(apart(log_z, log_of(w))) < longest_move; });
      if (!near) return false;
    }
  return true;
}

void WaveScan::follow_phase_mode(double diffusion) {
  constexpr int most = 40;
  for (int halvings = 0; halvings < most; ++halvings) {
    const double k = points_[1].wavenumber, expected = -diffusion * k * k;
    if (std::abs(points_[1].growth_rate - expected) <= std::abs(expected) / 2 ||
        std::abs(expected) < 1e-12 / setting_.period)
      return;
    points_.insert(points_.begin() + 1, at_(k / 2));
  }
}

void WaveScan::fill_in() {
  std::vector<BlochPoint> ahead(points_.rbegin(), points_.rend()), done{ahead.back()};
  ahead.pop_back();
  while (!ahead.empty()) {
    const double a = done.back().wavenumber, b = ahead.back().wavenumber;
    if (done.size() + ahead.size() > most_points || b - a < shortest_ || matched(done.back(), ahead.back())) {
      done.push_back(std::move(ahead.back()));
      ahead.pop_back();
    } else {
      ahead.push_back(at_((a + b) / 2));
    }
  }
  points_ = std::move(done);
}

void WaveScan::find_resonances() {
  double most = largest_of_finite();
  for (size_t k = 0; k + 1 < points_.size(); ++k) {
    const BlochPoint &a = points_[k], &b = points_[k + 1];
    const double step = b.wavenumber - a.wavenumber,
                 highest = std::max(a.growth_rate, b.growth_rate) + rise_within(k);
    double at_a, at_b;
    bool left, right;
    const double least = of_interest + std::min(0., setting_.period * most);
    if (highest <= most || !beside_real_axis(a, least, at_a, left) ||
        !beside_real_axis(b, least, at_b, right))
      continue;
    if (left != right || at_a + at_b > 2 * setting_.turning * step) continue;
    const Least meeting =
        find_least([&](double x) { return -separation(at_(x).multipliers, left); }, a.wavenumber,
                   b.wavenumber, 1e-2 * step, [](double value) { return value < 0; });
    if (meeting.value > 1e-3 * at_a * at_b) continue;
    BlochPoint there = at_(meeting.x);
    most = std::max(most, there.growth_rate);
    points_.insert(points_.begin() + long(++k), std::move(there));
  }
}

void WaveScan::find_tops() {
  std::vector<size_t> tops;
  for (size_t k = 1; k + 1 < points_.size(); ++k)
    if (points_[k].growth_rate >= points_[k - 1].growth_rate &&
        points_[k].growth_rate > points_[k + 1].growth_rate)
      tops.push_back(k);
  std::stable_sort(tops.begin(), tops.end(),
                   [&](size_t a, size_t b) { return points_[a].growth_rate > points_[b].growth_rate; });
  if (tops.size() > most_tops) tops.resize(most_tops);
  double most = largest_of_finite();
  std::vector<BlochPoint> found;
  for (const size_t k : tops) {
    if (points_[k].growth_rate + std::max(rise_within(k - 1), rise_within(k)) <= most) continue;
    const double low = points_[k - 1].wavenumber, high = points_[k + 1].wavenumber;
    const auto top_to = [&](double tolerance) {
      return find_least([&](double x) { return -at_(x).growth_rate; }, low, high, tolerance,
                        [](double) { return false; });
    };
    const Least about = top_to((high - low) / 16);
    if (-about.value + std::max(rise_within(k - 1), rise_within(k)) / 16 <= most) continue;
    const Least top = top_to(1e-6 * high);
    if (-top.value < points_[k].growth_rate) continue;
    most = std::max(most, -top.value);
    found.push_back(at_(top.x));
  }
  for (BlochPoint& point : found)
    points_.insert(std::upper_bound(points_.begin(), points_.end(), point.wavenumber,
                                    [](double k, const BlochPoint& p) { return k < p.wavenumber; }),
                   std::move(point));
}

namespace {

using std::size_t;
using Complex = std::complex<double>;
using Multipliers = std::vector<Complex>;

// Of uniform motion of the continuum waves are looked at as far as they turn by so much in a period; shorter
// ones see its mean damping.
constexpr double turns_of_shortest = 100;

class Waves {
 public:
  Waves(const Cycle& cycle, CycleWaves& map)
      : cycle_(cycle), scene_(map.scene()), map_(map), one_node_(cycle.nodes == 1) {
    if (!scene_.ring())
      throw UsageError("cycle_spectrum: the cell's ends are not those of a ring, so that it does not repeat");
    length_ = scene_.form == Form::chain ? double(scene_.n) : scene_.h() * double(scene_.n);
  }
  bool coupled() const { return scene_.K1() > 0 || scene_.N() > 0; }
  double period() const { return cycle_.period; }
  bool continuum_node() const { return one_node_ && scene_.form == Form::continuum; }
  double longest_wavenumber() const {
    return continuum_node() ? turns_of_shortest / (std::sqrt(scene_.A() * scene_.K1()) * period())
                            : M_PI / length_;
  }
  Multipliers at(double k) const {
    if (!one_node_) return map_.of_phase(k * length_);
    return map_.of_wave(continuum_node() ? k * k : symbol(2, 1, k));
  }
  BlochPoint point(double k) const {
    beat("wavenumbers");
    const Multipliers m = at(k);
    return {k, m, std::log(std::abs(m.front())) / period()};
  }
  // By how much ln(multiplier) changes with k, or so: what travels does so at the speed of sound, while it is
  // not at rest.
  double turning() const { return map_.speed() * period() * std::max(1 - cycle_.rest_fraction, 0.1); }
  // ln(multiplier of the phase mode)/period is -diffusion k^2 + ...: differences of fourth order, in kappa^2
  // or in k.
  double diffusion() const {
    if (one_node_) {
      // as stiff as viscosity is at the frequency of the cycle
      const double viscous = 2 * M_PI * scene_.N() / period();
      const double unit = 1e-3 * scene_.K0() / std::max(scene_.K1(), viscous);
      const auto f = [&](double part) { return phase_growth(map_.of_wave(part * unit)); };
      return -(8 * (f(1) - f(-1)) - (f(2) - f(-2))) / (12 * unit);
    }
    // the steps' error of the multiplier 1 is nearly the same at these phases as at 0
    const double at_zero = phase_growth(map_.of_phase(0));
    const auto f = [&](double theta) {
      return (phase_growth(map_.of_phase(theta)) - at_zero) / (theta * theta);
    };
    return -(4 * f(.01) - f(.02)) / 3 * length_ * length_;
  }
  double short_waves() const { return continuum_node() ? map_.short_waves() : std::nan(""); }

 private:
  double phase_growth(const Multipliers& m) const {
    return std::log(std::abs(m[nearest_to_one(m)])) / period();
  }

  const Cycle& cycle_;
  const Scene& scene_;
  CycleWaves& map_;
  bool one_node_;
  double length_;
};

// Every growth rate that decides, and the error of such rates.
struct Rates {
  double at_zero, diffusion, largest, of_finite, short_waves, error;
  double longest_wave;  // wavenumber from which on `largest` is looked for
  double least;         // what a rate is rounded by
};

// The one verdict: stable where everything decays, unstable where something grows, undecided where a rate
// that matters is nearer to 0 than its error. No rate that is given can contradict it.
void judge(const Rates& r, BlochSpectrum& out) {
  const double waves = std::fmax(r.of_finite, r.short_waves);  // the second may be NaN
  const bool forced = std::isnan(r.diffusion);                 // long waves are as all others
  const double long_wave = forced ? -1 : -r.diffusion * r.longest_wave * r.longest_wave;
  const bool grows = std::max({r.at_zero, r.largest, waves}) > r.error || long_wave > r.least;
  out.stable = !grows && r.at_zero < -r.error && waves < -r.error && long_wave < -r.least;
  out.decided = grows || out.stable;
}

// The places k = 0 and j/count of the longest, where `wavenumbers` divides count: near enough to each other
// that waves of the speed of sound turn by no more than 1 from one to the next.
std::vector<BlochPoint> evenly(const Waves& waves, int wavenumbers) {
  const double last = waves.longest_wavenumber();
  const int parts = std::max(1, int(std::ceil(std::min(1e6, waves.turning() * last / wavenumbers))));
  std::vector<BlochPoint> points{waves.point(0)};
  for (int j = 1; j <= wavenumbers * parts; ++j)
    points.push_back(waves.point(last * j / (wavenumbers * parts)));
  return points;
}

BlochSpectrum spectrum_of(const Cycle& cycle, CycleWaves& map, int wavenumbers) {
  const Waves waves(cycle, map);
  BlochSpectrum out;
  out.largest_at_zero = out.growth_rate = growth_rate(cycle);
  if (cycle.multipliers.size() > 1) out.multiplier = cycle.multipliers[cycle.phase_mode == 0 ? 1 : 0];
  out.coupled = waves.coupled();
  const double least = 1e-12 / waves.period();
  const bool forced = cycle.forcing_periods > 0;  // no phase diffuses, and no multiplier is 1 by itself
  const double error =
      (forced ? 0 : std::abs(std::log(std::abs(cycle.multipliers[cycle.phase_mode]))) / waves.period()) +
      least;
  if (!out.coupled) {
    out.stable = out.largest_at_zero < 0;
    out.decided = std::abs(out.largest_at_zero) > error;
    return out;
  }
  std::vector<BlochPoint> first = evenly(waves, wavenumbers);
  const size_t parts = (first.size() - 1) / size_t(wavenumbers);
  for (size_t j = parts; j < first.size(); j += parts) out.points.push_back(first[j]);
  out.diffusion = forced ? std::nan("") : waves.diffusion();
  out.short_waves = waves.short_waves();
  const WaveScan scan([&](double k) { return waves.point(k); }, std::move(first), forced ? 0 : out.diffusion,
                      {waves.period(), waves.turning(), cycle.nodes == 1});
  const std::vector<BlochPoint>& p = scan.points();
  const double longest_wave = out.points.front().wavenumber;
  for (size_t j = 1; j < p.size(); ++j) {
    if (p[j].growth_rate <= out.growth_rate || (p[j].wavenumber < longest_wave && !(p[j].growth_rate > 0)))
      continue;
    out.growth_rate = p[j].growth_rate;
    out.wavenumber = p[j].wavenumber;
    out.multiplier = p[j].multipliers.front();
  }
  out.largest_of_finite = scan.largest_of_finite();
  judge({out.largest_at_zero, out.diffusion, out.growth_rate, out.largest_of_finite, out.short_waves, error,
         longest_wave, least},
        out);
  return out;
}

}  // namespace

BlochSpectrum bloch_spectrum(const SmoothCycle& cycle, int wavenumbers) {
  Deviations deviations(cycle);
  return spectrum_of(cycle.cycle, deviations, wavenumbers);
}

BlochSpectrum bloch_spectrum(const StickCycle& cycle, const Cycle& course, const Scene& cell,
                             int wavenumbers) {
  StickDeviations deviations(cell, cycle);
  return spectrum_of(course, deviations, wavenumbers);
}

Watched watch_waves(const BlochSpectrum& spectrum) {
  Watched seen{spectrum.stable, spectrum.growth_rate, spectrum.wavenumber, {}};
  if (!spectrum.coupled) return seen;
  if (std::isnan(spectrum.diffusion)) {  // under a load
    seen.tests["wave"] = spectrum.largest_of_finite;
    return seen;
  }
  seen.tests["long-wave"] = spectrum.diffusion;
  // where long waves grow, their band and others part and join: that is no change of stability
  if (spectrum.diffusion > 0) seen.tests["wave"] = spectrum.largest_of_finite;
  return seen;
}

}  // namespace stickslip
