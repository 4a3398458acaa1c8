#include "stability/closed_form.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip {

namespace {

// All nodes are alike: the first one's coefficients are those of all.
std::vector<Complex> roots_of_wave(const LinearisedOperator& s, double k) {
  return dispersion(s.point(0), s.symbol(k));
}

}  // namespace

ExactModes::ExactModes(const LinearisedOperator& s) {
  for (const LinearisedOperator::Wave& w : s.exact_waves())
    for (const Complex& z : roots_of_wave(s, w.k))
      if (z.imag() >= 0) roots_.push_back({z, w.multiplicity * (z.imag() > 0 ? 2 : 1)});
  std::sort(roots_.begin(), roots_.end(),
            [](const Root& a, const Root& b) { return a.value.imag() < b.value.imag(); });
}

long ExactModes::count(double a, double height) const {
  long sum = 0;
  for (const Root& r : roots_)
    if (r.value.real() > a && r.value.imag() <= height) sum += r.members;
  return sum;
}

double ExactModes::distance(const LinearisedOperator& s, const std::vector<Mode>& modes) const {
  double worst = 0;
  for (const Mode& m : modes) {
    const double scale = std::max(std::abs(m.value), std::sqrt(s.A * std::max(s.K0, 1e-300)));
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

std::vector<Mode> sine_modes(const LinearisedOperator& s, double height, std::size_t count) {
  struct Root {
    Complex value;
    double k;
  };
  std::vector<Root> roots;
  for (const LinearisedOperator::Wave& w : s.exact_waves())
    for (const Complex& z : roots_of_wave(s, w.k))
      if (z.imag() >= 0 && z.imag() <= height) roots.push_back({z, w.k});
  // without a state the real parts of all oscillating waves are equal to the last bit
  std::sort(roots.begin(), roots.end(), [&](const Root& a, const Root& b) {
    return a.value.real() != b.value.real() ? a.value.real() > b.value.real() : a.value.imag() < b.value.imag();
  });
  std::vector<Mode> guesses;
  for (std::size_t j = 0; j < std::min(count, roots.size()); ++j) {
    Mode m;
    m.value = roots[j].value;
    m.psi = s.wave(roots[j].k);
    guesses.push_back(std::move(m));
  }
  return guesses;
}

double short_wave_growth(const LinearisedOperator& s) {
  double sum = 0, length = 0, growth = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < s.size(); ++i) {
    // a held end has no unknown: its half of an interval goes to the node beside it
    const double extra = !s.scene.ring() && s.coupling.weight[i] == 1 && (i == 0 || i + 1 == s.size()) ? 0.5 : 0;
    sum += (s.coupling.weight[i] + extra) * s.point(i).damping();
    length += s.coupling.weight[i] + extra;
    if (s.has_state()) growth = std::max(growth, -s.point(i).r());
  }
  return std::max(growth, -sum / length / 2);
}

}  // namespace stickslip
