#include "stickslip/cycles/bloch.hpp"

#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "cycles/deviations.hpp"
#include "cycles/stick_deviations.hpp"
#include "cycles/wave_scan.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

using std::size_t;
using Complex = std::complex<double>;
using Multipliers = std::vector<Complex>;

// Of uniform motion of the continuum waves are looked at as far as they turn by so much in a period; shorter
// ones see its mean damping.
constexpr double turns_of_shortest = 100;

class Waves {
 public:
  Waves(const Cycle& cycle, const Scene& scene, const WaveMap& map)
      : cycle_(cycle), scene_(scene), map_(map), one_node_(cycle.nodes == 1) {
    if (!scene.ring())
      throw UsageError("cycle_spectrum: the cell's ends are not those of a ring, so that it does not repeat");
    length_ = scene.form == Form::chain ? double(scene.n) : scene.h() * double(scene.n);
  }
  bool coupled() const { return scene_.K1() > 0; }
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
  double turning() const { return map_.speed * period() * std::max(1 - cycle_.rest_fraction, 0.1); }
  // ln(multiplier of the phase mode)/period is -diffusion k^2 + ...: differences of fourth order, in kappa^2
  // or in k.
  double diffusion() const {
    if (one_node_) {
      const double unit = 1e-3 * scene_.K0() / scene_.K1();
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
  double short_waves() const { return continuum_node() ? map_.short_waves : std::nan(""); }

 private:
  double phase_growth(const Multipliers& m) const {
    return std::log(std::abs(m[nearest_to_one(m)])) / period();
  }

  const Cycle& cycle_;
  const Scene& scene_;
  const WaveMap& map_;
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

}  // namespace

BlochSpectrum bloch_spectrum(const Cycle& cycle, const Scene& cell, const WaveMap& map, int wavenumbers) {
  const Waves waves(cycle, cell, map);
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

namespace {

// Half the mean damping; with viscosity between neighbours, which damps psi ever faster, K1/N or what a state
// keeps, whose mean rate is what psi and eta leave of the exponents' sum.
double growth_of_short_waves(const SmoothCycle& cycle, const Deviations& deviations) {
  const Scene& scene = cycle.field->scene();
  if (scene.N() == 0) return -deviations.mean_damping() / 2;
  double growth = -scene.K1() / scene.N(), sum = 0;
  for (const auto& m : cycle.cycle.multipliers) sum += std::log(std::abs(m)) / cycle.cycle.period;
  if (cycle.cycle.dof == 3) growth = std::max(growth, sum + deviations.mean_damping());
  return growth;
}

}  // namespace

BlochSpectrum bloch_spectrum(const SmoothCycle& cycle, int wavenumbers) {
  Deviations deviations(cycle);
  return bloch_spectrum(
      cycle.cycle, cycle.field->scene(),
      {[&](double kappa2) { return deviations.of_wave(kappa2); },
       [&](double theta) { return deviations.of_phase(theta); }, growth_of_short_waves(cycle, deviations),
       deviations.mean_speed()},
      wavenumbers);
}

BlochSpectrum bloch_spectrum(const StickCycle& cycle, const Cycle& course, const Scene& cell,
                             int wavenumbers) {
  StickDeviations deviations(cell, cycle);
  return bloch_spectrum(course, cell,
                        {[&](double kappa2) { return deviations.of_wave(kappa2); },
                         [&](double theta) { return deviations.of_phase(theta); }, std::nan(""),
                         std::sqrt(cell.A() * cell.K1())},
                        wavenumbers);
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
