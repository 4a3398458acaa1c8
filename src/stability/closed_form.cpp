#include "stability/closed_form.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stickslip {

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

}  // namespace stickslip
