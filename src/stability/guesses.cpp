#include "stability/guesses.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace stickslip {

std::vector<double> mean_frequencies(const LinearisedOperator& s) {
  const LinearPoint medium = s.mean();
  std::vector<double> w;
  for (std::size_t j = 0; j <= s.size(); ++j)
    for (const Complex& z : dispersion(medium, s.symbol(M_PI / s.spacing() * double(j) / double(s.size()))))
      if (z.imag() > 0) w.push_back(z.imag());
  std::sort(w.begin(), w.end());
  return w;
}

std::vector<Complex> first_shifts(const LinearisedOperator& s, double height, PetscInt count) {
  const LinearPoint medium = s.mean();
  const double h = s.spacing();
  const int samples = 400;
  std::vector<Complex> branch;  // rightmost root for every wavenumber
  std::vector<double> waves;
  const std::vector<LinearisedOperator::Wave> exact = s.exact_waves();
  for (int j = 0; j <= samples; ++j) {
    double k = M_PI / h * std::pow(double(j) / samples, 2);
    if (!exact.empty()) k = exact[double(exact.size() - 1) * std::pow(double(j) / samples, 2)].k;
    Complex best(-std::numeric_limits<double>::infinity(), 0);
    for (const Complex& z : dispersion(medium, s.symbol(k)))
      if (z.imag() >= 0 && z.real() > best.real()) best = z;
    if (best.imag() > height) break;
    branch.push_back(best);
    waves.push_back(k);
  }
  const double spacing = s.rate_of(s.K1) * M_PI / (double(s.size()) * h);
  const double aside = 0.5 * spacing * std::max(1., double(count) / 4);
  std::size_t best = 0;
  for (std::size_t j = 1; j < branch.size(); ++j)
    if (branch[j].real() > branch[best].real() + 1e-12 * std::abs(branch[j])) best = j;
  std::vector<Complex> shifts{branch[best] + aside};
  if (s.uniform && !exact.empty()) return shifts;
  for (std::size_t j :
       {std::size_t(0), branch.size() - 1, branch.size() / 4, branch.size() / 2, 3 * branch.size() / 4})
    if (j != best) shifts.push_back(branch[j] + aside);
  shifts.push_back(aside);  // real modes
  // What the least and the most damped nodes would do alone: modes may be trapped there.
  std::size_t low = 0, high = 0;
  for (std::size_t i = 1; i < s.size(); ++i) {
    if (s.point(i).beta() < s.point(low).beta()) low = i;
    if (s.point(i).beta() > s.point(high).beta()) high = i;
  }
  for (const std::size_t node : {low, high})
    for (const double kappa2 : {0., s.largest_symbol()})
      for (const Complex& z : dispersion(s.point(node), kappa2))
        if (z.imag() >= 0 && z.imag() <= height && z.real() >= branch[best].real())
          shifts.push_back(z + 0.1 * aside);
  return shifts;
}

double local_growth(const LinearisedOperator& s, std::size_t i, bool oscillations) {
  if (oscillations && !s.scene.massless()) return -s.point(i).damping() / 2;
  double local = -std::numeric_limits<double>::infinity();
  for (const double part : {0., 0.1, 1.})
    for (const Complex& z : dispersion(s.point(i), part * s.largest_symbol()))
      local = std::max(local, z.real());
  return local;
}

std::vector<Segment> promising_segments(const LinearisedOperator& s, bool quick) {
  const std::size_t n = s.size();
  std::vector<double> sum{0};
  for (std::size_t i = 0; i < n; ++i) sum.push_back(sum.back() + local_growth(s, i, !s.has_state()));
  std::vector<Segment> segments;
  for (std::size_t l = 1; 32 * l < n || l == 1; l *= 4) {
    const std::size_t width = std::min(n, std::max<std::size_t>(quick ? 64 : 96, 16 * l));
    if (n > many_nodes && width > (quick ? 1 : 4) * many_nodes) break;
    std::vector<char> taken(n, 0);
    for (int k = 0; k < (quick || width > 8192 ? 1 : width <= 512 ? 12 : 3); ++k) {
      std::size_t best = n;
      double most = -std::numeric_limits<double>::infinity();
      for (std::size_t i = 0; i + l <= n; ++i)
        if (!taken[i] && sum[i + l] - sum[i] > most) most = sum[i + l] - sum[best = i];
      if (best == n) break;
      const std::size_t centre = best + l / 2, half = width / 2, begin = centre > half ? centre - half : 0;
      segments.push_back({std::min(begin, n - width), width});
      for (std::size_t i = begin; i < std::min(n, centre + half); ++i) taken[i] = 1;
    }
    if (width == n) break;
  }
  return segments;
}

std::vector<Mode> segment_modes(const LinearisedOperator& s, const Segment& segment, double height,
                                bool inside) {
  const LinearisedOperator part = s.segment(segment.first, segment.width);
  std::vector<Mode> modes;
  if (segment.width * s.dof() <= 300) {
    modes = dense_modes(part, 12);
  } else {
    std::vector<Complex> shifts = first_shifts(part, height, 8);
    for (std::size_t j = 0; j < std::min<std::size_t>(shifts.size(), 4); ++j)
      for (Mode& m : krylov_modes(part, shifts[j], 6)) modes.push_back(std::move(m));
  }
  const auto small_at_ends = [&](const std::vector<Complex>& psi) {
    const std::size_t eighth = psi.size() / 8;
    double ends = 0, all = 0;
    for (std::size_t i = 0; i < psi.size(); ++i) {
      all += std::norm(psi[i]);
      const bool left = i < eighth && segment.first > 0;
      const bool right = i >= psi.size() - eighth && segment.first + segment.width < s.size();
      if (left || right) ends += std::norm(psi[i]);
    }
    return ends < 0.01 * all;
  };
  modes.erase(std::remove_if(modes.begin(), modes.end(),
                             [&](const Mode& m) {
                               return m.psi.empty() || m.value.imag() > height ||
                                      (inside && !small_at_ends(m.psi));
                             }),
              modes.end());
  return modes;
}

}  // namespace stickslip
