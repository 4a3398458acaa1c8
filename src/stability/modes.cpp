#include "stability/modes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

Complex inner(const std::vector<Complex>& a, const std::vector<Complex>& b) {
  Complex sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::conj(a[i]) * b[i];
  return sum;
}

void normalise(std::vector<Complex>& p) {
  Complex largest = 0;
  for (const Complex& x : p)
    if (std::norm(x) > std::norm(largest) * (1 + 1e-9)) largest = x;
  if (largest == Complex(0)) return;
  for (Complex& x : p) x /= largest;
}

double rounding(const LinearisedOperator& s, Complex lambda) {
  const double scale = std::max(std::abs(lambda), s.rate_of(s.K0) + 1e-3 * spring_frequency(s));
  if (s.scene.massless()) return 20 * epsilon * (scale + s.largest_stiffness() / s.mean().beta());
  return 20 * epsilon * (scale + s.A * s.largest_stiffness() / scale + s.viscous_rate());
}

// It is known where D2 is symmetric: p times the weight, or its conjugate where all nodes are alike (a
// travelling wave).
std::vector<Complex> left_vector(const LinearisedOperator& s, const Mode& mode) {
  std::vector<Complex> w = mode.psi;
  if (s.symmetric()) {
    for (std::size_t i = 0; i < w.size(); ++i)
      w[i] = s.coupling.weight[i] * (s.uniform ? std::conj(w[i]) : w[i]);
    return w;
  }
  BandLU lu;
  s.factor(mode.value, lu);
  for (int k = 0; k < 2; ++k) {
    s.solve_transposed(lu, w);
    normalise(w);
  }
  return w;
}

std::optional<Complex> stationary_value(const LinearisedOperator& s, const Mode& mode,
                                        const std::vector<Complex>& w, double least) {
  const std::vector<Complex>& p = mode.psi;
  const std::size_t n = p.size();
  Complex lambda = mode.value;
  const double scale = std::abs(lambda) + s.rate;
  // w S p = m lambda^2/A + lambda (sum w (beta + q/(lambda + r) - N D2) p) + K
  const std::vector<Complex> d = s.coupling.minus_d2(p);
  std::vector<Complex> wp(n);
  Complex m = 0, drag = 0, K = 0, pull = 0;  // m: over A, pull: the K0
  double weight = 0, drags = 0;
  const bool differ = s.scene.medium.nodes_differ();
  for (std::size_t i = 0; i < n; ++i) {
    wp[i] = w[i] * p[i];
    const LinearPoint at = s.point(i);
    m += wp[i] * (differ ? s.A / at.A : 1);
    pull += wp[i] * at.K0;
    drag += wp[i] * at.beta();
    K += w[i] * d[i];
    weight += std::abs(wp[i]);
    drags += std::abs(wp[i]) * std::abs(s.point(i).beta());
  }
  drag += s.N * K;
  K = (differ ? pull : s.K0 * m) + s.K1 * K;
  for (int k = 0; k < 8; ++k) {
    Complex above = lambda * (lambda / s.A * m + drag) + K, below = 2. * lambda / s.A * m + drag;
    double size = 2 * std::abs(lambda) / s.A * weight + drags;
    for (std::size_t i = 0; s.has_state() && i < n; ++i) {
      const Complex over = 1. / (lambda + s.point(i).r()), q = wp[i] * s.point(i).q() * over;
      above += lambda * q;
      below += q * s.point(i).r() * over;
      size += std::abs(q * s.point(i).r() * over);
    }
    if (!(std::abs(below) > least * size)) return std::nullopt;
    const Complex step = above / below;
    lambda -= step;
    if (!(std::abs(step) < 0.3 * scale)) return std::nullopt;
    if (std::abs(step) <= 1e-13 * scale) return lambda;
  }
  return std::nullopt;
}

bool polish(const LinearisedOperator& s, Mode& mode, int steps) {
  BandLU lu;
  bool converged = false;
  const double own = own_rate(s);
  normalise(mode.psi);
  double last = std::numeric_limits<double>::infinity();
  for (int k = 0; k < steps && !converged; ++k) {
    s.factor(mode.value, lu);
    std::vector<Complex> y = s.apply_slope(mode.value, mode.psi);
    s.solve(lu, y);
    const Complex step = inner(mode.psi, mode.psi) / inner(mode.psi, y);
    if (!std::isfinite(std::abs(step))) break;
    mode.value -= step;
    mode.psi = std::move(y);
    normalise(mode.psi);
    const double size = std::abs(step);
    converged =
        size <= rounding(s, mode.value) || (size > 0.3 * last && size < 1e-9 * (own + std::abs(mode.value)));
    last = size;
  }
  if (s.symmetric()) {  // else the left eigenvector costs a solve
    const Complex value = stationary_value(s, mode, left_vector(s, mode), 0.1).value_or(mode.value);
    if (std::abs(value - mode.value) < 1e-6 * (own + std::abs(value))) mode.value = value;
  }
  if (mode.value.imag() < 0) {
    mode.value = std::conj(mode.value);
    for (Complex& x : mode.psi) x = std::conj(x);
  }
  if (mode.value.imag() <= rounding(s, mode.value)) {
    // A real eigenvalue has a real eigenvector; a pair that is almost double keeps its imaginary part
    // otherwise.
    Mode real = mode;
    real.value = mode.value.real();
    double re = 0, im = 0;
    for (const Complex& x : mode.psi) {
      re += x.real() * x.real();
      im += x.imag() * x.imag();
    }
    for (Complex& x : real.psi) x = re >= im ? x.real() : x.imag();
    normalise(real.psi);
    if (s.mode_residual(real.value, real.psi) <=
        10 * s.mode_residual(mode.value, mode.psi) + rounding(s, mode.value))
      mode = std::move(real);
  }
  mode.residual = s.mode_residual(mode.value, mode.psi);
  mode.wavenumber = s.wavenumber(mode.psi);
  return converged;
}

Mode mode_near(const LinearisedOperator& s, Complex z) {
  Mode mode;
  mode.value = z;
  mode.psi.resize(s.size());
  Noise noise;
  for (Complex& x : mode.psi) x = noise.next();
  BandLU lu;
  s.factor(z, lu);
  for (int k = 0; k < 3; ++k) {
    std::vector<Complex> y = s.apply_slope(z, mode.psi);
    s.solve(lu, y);
    mode.psi = std::move(y);
    normalise(mode.psi);
  }
  return mode;
}

void sort_modes(std::vector<Mode>& modes, double tolerance) {
  std::sort(modes.begin(), modes.end(),
            [](const Mode& a, const Mode& b) { return a.value.real() > b.value.real(); });
  for (std::size_t i = 0; i < modes.size();) {
    std::size_t j = i + 1;
    while (j < modes.size() && modes[j - 1].value.real() - modes[j].value.real() <= tolerance) ++j;
    std::sort(modes.begin() + i, modes.begin() + j,
              [](const Mode& a, const Mode& b) { return a.value.imag() < b.value.imag(); });
    i = j;
  }
}

std::size_t shown_modes(const LinearisedOperator& s, const std::vector<Mode>& modes, double height,
                        PetscInt count) {
  std::size_t shown = 0;
  PetscInt eigenvalues = 0;
  bool leading = false;
  for (const Mode& m : modes) {
    if (m.value.imag() > height) continue;
    if (eigenvalues >= count && leading) break;
    eigenvalues += eigenvalues_of(m.value);
    leading = leading || !is_neutral(s, m);
    ++shown;
  }
  return shown;
}

double nearness(const LinearisedOperator& s, Complex value) {
  return 1e-7 * (own_rate(s) + std::abs(value)) + 10 * rounding(s, value);
}

void remove_part(std::vector<Complex>& p, const std::vector<Complex>& q) {
  const Complex part = inner(q, p) / inner(q, q);
  for (std::size_t i = 0; i < p.size(); ++i) p[i] -= part * q[i];
}

namespace {

using Shapes = std::vector<std::vector<Complex>>;

void remove_parts(std::vector<Complex>& p, const Shapes& shapes) {
  for (int k = 0; k < 2; ++k)  // the second time what round-off has left
    for (const std::vector<Complex>& q : shapes) remove_part(p, q);
}

// Shapes, orthogonal to each other, that span those of the modes with nearly this value.
Shapes span_near(const LinearisedOperator& s, const std::vector<Mode>& modes, Complex value) {
  const double near = nearness(s, value);
  Shapes shapes;
  for (const Mode& m : modes) {
    if (!(std::abs(m.value - value) <= near)) continue;
    std::vector<Complex> p = m.psi;
    remove_parts(p, shapes);
    if (inner(p, p).real() > 1e-20 * inner(m.psi, m.psi).real()) shapes.push_back(std::move(p));
  }
  return shapes;
}

// What is left of p beside those shapes, and its squared size in parts of p's.
std::pair<std::vector<Complex>, double> rest_beside(std::vector<Complex> p, const Shapes& shapes) {
  const double before = inner(p, p).real();
  remove_parts(p, shapes);
  const double left = inner(p, p).real() / before;
  return {std::move(p), left};
}

// What the mirror image about half of `about` has beside the mode itself; nothing if they are one.
std::optional<Mode> image_beside(const LinearisedOperator& s, const Mode& m, std::size_t about) {
  Mode image = m;
  const std::size_t n = s.size();
  for (std::size_t i = 0; i < n; ++i) image.psi[i] = m.psi[(about + n - i) % n];
  const Complex part = inner(m.psi, image.psi) / inner(m.psi, m.psi);
  if (std::norm(part) > 0.999 * inner(image.psi, image.psi).real() / inner(m.psi, m.psi).real()) return {};
  remove_part(image.psi, m.psi);
  normalise(image.psi);
  image.residual = s.mode_residual(image.value, image.psi);
  image.wavenumber = s.wavenumber(image.psi);
  return image;
}

}  // namespace

bool is_new(const LinearisedOperator& s, const std::vector<Mode>& known, const Mode& m) {
  const Shapes shapes = span_near(s, known, m.value);
  if (shapes.empty()) return true;
  const auto [rest, left] = rest_beside(m.psi, shapes);
  constexpr double digits = 1e-8;  // what a polished shape may be wrong by, squared
  return left > digits && s.mode_residual(m.value, rest) <= nearness(s, m.value);
}

void add_new(const LinearisedOperator& s, std::vector<Mode>& modes, std::vector<Mode> more) {
  for (Mode& m : more)
    if (is_new(s, modes, m)) modes.push_back(std::move(m));
}

void add_guesses(const LinearisedOperator& s, std::vector<Mode>& guesses, std::vector<Mode> more) {
  for (Mode& m : more)
    if (rest_beside(m.psi, span_near(s, guesses, m.value)).second > 0.01) guesses.push_back(std::move(m));
}

std::optional<Mode> twin(const LinearisedOperator& s, const std::vector<Mode>& known, const Mode& m) {
  const double near = nearness(s, m.value);
  const Shapes shapes = span_near(s, known, m.value);
  BandLU lu;
  s.factor(m.value + Complex(0, 0.01 * near), lu);  // beside the value all of its shapes grow alike
  Mode other = m;
  Noise noise;
  for (Complex& x : other.psi) x = noise.next();
  for (int k = 0; k < 4; ++k) {
    remove_parts(other.psi, shapes);
    normalise(other.psi);
    if (k == 3) break;
    other.psi = s.apply_slope(m.value, other.psi);
    s.solve(lu, other.psi);
  }
  other.residual = s.mode_residual(other.value, other.psi);
  if (!(other.residual <= near)) return std::nullopt;
  other.wavenumber = s.wavenumber(other.psi);
  return other;
}

void add_mirror_images(const LinearisedOperator& s, std::vector<Mode>& modes) {
  if (!s.uniform || !s.scene.ring()) return;
  std::vector<Mode> images;
  for (const Mode& m : modes) {
    std::optional<Mode> image = image_beside(s, m, 0);
    const double quarter = M_PI / 2 / (m.wavenumber * s.scene.h());  // a standing wave may stand about node 0
    if (!image && quarter < double(s.size())) image = image_beside(s, m, std::lround(quarter));
    if (image) images.push_back(std::move(*image));
  }
  add_new(s, modes, std::move(images));
}

bool is_neutral(const LinearisedOperator& s, const Mode& m) {
  return s.neutral() && std::abs(m.value) < 1e-6 * (damping_scale(s) + s.rate_of(s.K1)) &&
         m.wavenumber * (s.scene.form == Form::chain ? double(s.scene.n) : s.scene.length) < 1;
}

double resolved_frequency(const LinearisedOperator& s) {
  if (s.scene.form == Form::chain) return s.imaginary_bound();
  const double k = resolved_wavenumber(s.scene.order, s.scene.h());
  if (k == M_PI / s.scene.h()) return s.imaginary_bound();
  double height = s.rate_of(s.K0 + s.K1 * s.symbol(k));
  if (s.has_exact_waves())  // a state may add to the frequency of that wave
    for (const Complex& z : dispersion(s.mean(), s.symbol(k))) height = std::max(height, z.imag());
  return height;
}

void interpolate(const LinearisedOperator& from, const LinearisedOperator& to,
                 const std::vector<std::vector<Complex>*>& shapes) {
  const auto end = [](End e) {
    return e == End::periodic ? GridEnd::periodic : e == End::free ? GridEnd::mirrored : GridEnd::one_sided;
  };
  const Scene& grid = from.scene;
  const PetscInt first = from.coupling.node.front(), last = from.coupling.node.back();
  std::vector<std::vector<Complex>> results(shapes.size(), std::vector<Complex>(to.size(), Complex(0)));
  for (std::size_t i = 0; i < to.size(); ++i) {
    const double at = double(to.coupling.node[i]) * (to.scene.h() / grid.h());
    for (const auto& [node, weight] : grid_interpolation(grid.n, end(grid.left), end(grid.right), 4, at))
      for (std::size_t k = 0; k < shapes.size() && node >= first && node <= last; ++k)
        results[k][i] += weight * (*shapes[k])[node - first];
  }
  for (std::size_t k = 0; k < shapes.size(); ++k) *shapes[k] = std::move(results[k]);
}

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
