#include "stickslip/cycles/bloch.hpp"

#include <algorithm>
#include <cmath>

#include "cycles/deviations.hpp"
#include "cycles/stick_deviations.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using std::size_t;
using Complex = std::complex<double>;
using Multipliers = std::vector<Complex>;

// Of uniform motion of the continuum waves are looked at as far as they turn by so much in a period; shorter ones see
// its mean damping.
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
    return continuum_node() ? turns_of_shortest / (std::sqrt(scene_.A() * scene_.K1()) * period()) : M_PI / length_;
  }
  Multipliers at(double k) const {
    if (!one_node_) return map_.of_twist(k * length_);
    return map_.of_wave(continuum_node() ? k * k : symbol(2, 1, k));
  }
  double growth(double k) const { return std::log(std::abs(at(k).front())) / period(); }
  // ln(multiplier of the phase mode)/period is -diffusion k^2 + ...: differences of fourth order, in kappa^2 or in k.
  double diffusion() const {
    if (one_node_) {
      const double unit = 1e-3 * scene_.K0() / scene_.K1();
      const auto f = [&](double part) { return phase_growth(map_.of_wave(part * unit)); };
      return -(8 * (f(1) - f(-1)) - (f(2) - f(-2))) / (12 * unit);
    }
    const auto f = [&](double theta) { return phase_growth(map_.of_twist(theta)) / (theta * theta); };
    return -(4 * f(.01) - f(.02)) / 3 * length_ * length_;
  }
  double short_waves() const { return continuum_node() ? map_.short_waves : std::nan(""); }

 private:
  double phase_growth(const Multipliers& m) const { return std::log(std::abs(m[nearest_to_one(m)])) / period(); }

  const Cycle& cycle_;
  const Scene& scene_;
  const WaveMap& map_;
  bool one_node_;
  double length_;
};

// The top between two neighbours of a point.
BlochPoint summit(const Waves& waves, const BlochPoint& left, const BlochPoint& right) {
  const Least top = find_least([&](double k) { return -waves.growth(k); }, left.wavenumber, right.wavenumber,
                               1e-6 * right.wavenumber, [](double) { return false; });
  return {top.x, waves.at(top.x), -top.value};
}

}  // namespace

BlochSpectrum bloch_spectrum(const Cycle& cycle, const Scene& cell, const WaveMap& map, int wavenumbers) {
  const Waves waves(cycle, cell, map);
  BlochSpectrum out;
  out.largest_at_zero = out.growth_rate = growth_rate(cycle);
  if (cycle.multipliers.size() > 1) out.multiplier = cycle.multipliers[cycle.phase_mode == 0 ? 1 : 0];
  out.coupled = waves.coupled();
  const double error = std::abs(std::log(std::abs(cycle.multipliers[cycle.phase_mode]))) / waves.period() + 1e-12;
  if (!out.coupled) {
    out.stable = out.largest_at_zero < 0;
    out.decided = std::abs(out.largest_at_zero) > error;
    return out;
  }
  for (int j = 1; j <= wavenumbers; ++j) {
    const double k = waves.longest_wavenumber() * j / wavenumbers;
    const Multipliers m = waves.at(k);
    out.points.push_back({k, m, std::log(std::abs(m.front())) / waves.period()});
  }
  out.diffusion = waves.diffusion();
  out.short_waves = waves.short_waves();
  // the band that a negative diffusion opens at k = 0 is its own; what lies beyond is that of finite waves
  const std::vector<BlochPoint>& p = out.points;
  size_t finite = 0;
  if (out.diffusion < 0)
    while (finite < p.size() && p[finite].growth_rate > 0) ++finite;
  std::vector<size_t> tops;
  for (size_t j = 0; j < p.size(); ++j)
    if ((j == 0 ? out.diffusion < 0 : p[j].growth_rate >= p[j - 1].growth_rate) &&
        (j + 1 == p.size() || p[j].growth_rate > p[j + 1].growth_rate))
      tops.push_back(j);
  std::stable_sort(tops.begin(), tops.end(), [&](size_t a, size_t b) { return p[a].growth_rate > p[b].growth_rate; });
  const BlochPoint zero{0, {}, 0};
  out.largest_of_finite = finite < p.size() ? p.back().growth_rate : -error;
  const auto consider = [&](const BlochPoint& point, bool of_finite) {
    if (point.growth_rate > out.growth_rate) {
      out.growth_rate = point.growth_rate;
      out.wavenumber = point.wavenumber;
      out.multiplier = point.multipliers.front();
    }
    if (of_finite) out.largest_of_finite = std::max(out.largest_of_finite, point.growth_rate);
  };
  for (size_t j = 0; j < p.size(); ++j) consider(p[j], false);
  for (size_t rank = 0; rank < std::min<size_t>(3, tops.size()); ++rank) {
    const size_t j = tops[rank];
    const bool of_finite = j >= finite;
    consider(j + 1 == p.size() ? p[j] : summit(waves, j == 0 ? zero : p[j - 1], p[j + 1]), of_finite);
  }
  const double waves_growth = std::fmax(out.largest_of_finite, out.short_waves);  // the second may be NaN
  out.stable = out.largest_at_zero < 0 && out.diffusion > 0 && waves_growth < 0;
  const double k1 = p.front().wavenumber;
  const bool clearly_unstable = out.growth_rate > error || out.short_waves > error;
  out.decided = clearly_unstable || (std::abs(out.largest_at_zero) > error && std::abs(waves_growth) > error &&
                                     std::abs(out.diffusion) * k1 * k1 > 1e-12);
  return out;
}

namespace {

// Half the mean damping; with viscosity between neighbours, which damps psi ever faster, K1/N or what a state keeps, whose
// mean rate is what psi and eta leave of the exponents' sum.
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
  return bloch_spectrum(cycle.cycle, cycle.field->scene(),
                        {[&](double kappa2) { return deviations.of_wave(kappa2); },
                         [&](double theta) { return deviations.of_twist(theta); },
                         growth_of_short_waves(cycle, deviations)},
                        wavenumbers);
}

BlochSpectrum bloch_spectrum(const StickCycle& cycle, const Cycle& course, const Scene& cell, int wavenumbers) {
  StickDeviations deviations(cell, cycle);
  return bloch_spectrum(course, cell,
                        {[&](double kappa2) { return deviations.of_wave(kappa2); },
                         [&](double theta) { return deviations.of_twist(theta); }, std::nan("")},
                        wavenumbers);
}

Watched watch_waves(const BlochSpectrum& spectrum) {
  Watched seen{spectrum.stable, spectrum.growth_rate, spectrum.wavenumber, {}};
  if (!spectrum.coupled) return seen;
  seen.tests["long-wave"] = spectrum.diffusion;
  // where long waves grow, their band and others part and join: that is no change of stability
  if (spectrum.diffusion > 0) seen.tests["wave"] = spectrum.largest_of_finite;
  return seen;
}

}  // namespace stickslip
