#include "cycles/wave_scan.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/numerics/roots.hpp"

namespace stickslip {

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

}  // namespace stickslip
