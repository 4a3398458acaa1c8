#include "stickslip/stability/sliding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "stickslip/base/error.hpp"
#include "stickslip/model/friction.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

bool held(const Scene& scene, PetscInt i) {
  return (i == 0 && scene.left == End::velocity) || (i == scene.n - 1 && scene.right == End::velocity);
}

}  // namespace

Sliding::Sliding(const Scene& s) : scene(s), A(s.A()), B(s.B()), K0(s.K0()), K1(s.K1()), s_delta(s.s_delta()) {
  const std::size_t n = std::size_t(s.n);
  std::vector<int> index(n, -1);  // of a node among those solved for
  for (PetscInt i = 0; i < s.n; ++i)
    if (!held(s, i)) {
      index[std::size_t(i)] = int(node.size());
      node.push_back(i);
    }
  const std::size_t m = node.size();

  weight.assign(m, 1);
  if (s.form == Form::continuum) {
    if (s.left == End::free) weight.front() = 0.5;
    if (s.right == End::free) weight.back() = 0.5;
  }
  symmetric = !((s.left == End::velocity || s.right == End::velocity) && s.order > 2);

  // A ring is folded: 0, n-1, 1, n-2, ... so that neighbours stay near each other.
  position_.resize(m);
  for (std::size_t i = 0; i < m; ++i)
    position_[i] = !s.ring() ? int(i) : int(i < (m + 1) / 2 ? 2 * i : 2 * (m - 1 - i) + 1);

  // -D2: the interior rows are all alike, the library's row function serves the ends
  const std::array<double, 5> w = second_difference(s.order);
  const double scale = s.form == Form::chain ? 1 : 1 / (s.h() * s.h());
  const PetscInt half = s.order / 2;
  row_start_.reserve(m + 1);
  row_start_.push_back(0);
  row_sum_.assign(m, 0);
  minus_d2_.reserve(m * std::size_t(s.order + 1));
  for (std::size_t i = 0; i < m; ++i) {
    const PetscInt g = node[i];
    if (g >= s.order && g < s.n - s.order) {
      for (PetscInt j = -half; j <= half; ++j)
        minus_d2_.push_back({index[std::size_t(g + j)], -scale * w[std::size_t(std::abs(j))]});
    } else {
      for (const auto& [column, value] : second_difference_row(s, g)) {
        if (index[std::size_t(column)] >= 0) minus_d2_.push_back({index[std::size_t(column)], -value});
        else row_sum_[i] += value;
      }
    }
    row_start_.push_back(int(minus_d2_.size()));
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k)
      band_ = std::max(band_, std::abs(position_[std::size_t(minus_d2_[std::size_t(k)].column)] - position_[i]));
  }

  steady_velocity();

  const std::vector<double> amplitude = friction_amplitude(s, 0, s.n);
  F_psi.resize(m);
  beta.resize(m);
  {
    const auto law = Friction::of(s.friction);
    const Friction& friction = *law;
    const bool with_state = friction.has_state;
    eta.resize(n);
    if (with_state) {
      state.resize(n);
      for (auto* v : {&F_state, &g_psi, &r}) v->resize(m);
    }
    for (std::size_t i = 0; i < n; ++i) {
      const double x = friction.steady_state(psi[i]);
      const double at = double(i) * s.h();
      if (with_state && !std::isfinite(x))
        throw Failure("no steady sliding: the contact state grows without end at psi = 0 (x = " + rounded_text(at, 6) +
                      "); the plate must move (model_v)");
      if (psi[i] == 0 && friction.sticks && index[i] >= 0)
        throw Failure("no steady sliding: at psi = 0 (x = " + rounded_text(at, 6) +
                      ") the law sticks; take model_v other "
                      "than 0, or friction_stick regularised");
      const Partials f = friction.partials(psi[i], x);
      eta[i] = B * psi[i] + amplitude[i] * f.F;
      if (with_state) state[i] = x;
      if (!std::isfinite(eta[i]) || !std::isfinite(f.F_psi))
        throw Failure("no steady sliding: the friction at psi = " + rounded_text(psi[i], 6) + " is not finite");
      if (index[i] < 0) continue;
      const std::size_t k = std::size_t(index[i]);
      F_psi[k] = amplitude[i] * f.F_psi;
      beta[k] = B + s_delta / A + F_psi[k];
      if (with_state) {
        const RatePartials g = friction.rate_partials(psi[i], x);
        F_state[k] = amplitude[i] * f.F_state;
        g_psi[k] = g.g_psi;
        r[k] = -g.g_state;
        residual = std::max(residual, std::abs(g.g));
      }
    }
  }
  for (std::size_t k = 1; k < m; ++k)
    if (F_psi[k] != F_psi[0] || (has_state() && (F_state[k] != F_state[0] || r[k] != r[0] || g_psi[k] != g_psi[0])))
      uniform = false;

  // How well the equations hold; psi_t = 0 by the choice of eta, and eta - F = B psi, which delta does not meet.
  for (std::size_t i = 0; i < m; ++i) {
    const PetscInt g = node[i];
    double sum = K0 * (s.v - psi[std::size_t(g)]);
    if (g >= s.order && g < s.n - s.order) {
      for (PetscInt j = -half; j <= half; ++j)
        sum += K1 * scale * w[std::size_t(std::abs(j))] * (psi[std::size_t(g + j)] - psi[std::size_t(g)]);
    } else {
      for (const auto& [column, value] : second_difference_row(s, g))
        sum += K1 * value * (psi[std::size_t(column)] - psi[std::size_t(g)]);
    }
    residual = std::max(residual, std::abs(sum));
  }
}

// Deviations from v: (K0 - K1 D2)(psi - v) = K1 (D2 to the held nodes)(psi_e - v).
void Sliding::steady_velocity() {
  psi.assign(std::size_t(scene.n), scene.v);
  bool flat = true;
  for (PetscInt i : {PetscInt(0), scene.n - 1})
    if (held(scene, i)) {
      psi[std::size_t(i)] = i == 0 ? scene.left_value : scene.right_value;
      flat = flat && psi[std::size_t(i)] == scene.v;
    }
  if (flat || node.empty()) return;
  std::vector<Complex> b(size(), Complex(0));
  for (std::size_t i = 0; i < size(); ++i) {
    const PetscInt g = node[i];
    if (g >= scene.order && g < scene.n - scene.order) continue;
    for (const auto& [column, value] : second_difference_row(scene, g))
      if (held(scene, column)) b[i] += K1 * value * (psi[std::size_t(column)] - scene.v);
  }
  if (K1 == 0) return;
  BandLU lu;
  lu.reset(size(), band_, band_);
  for (std::size_t i = 0; i < size(); ++i) {
    lu.add(std::size_t(position_[i]), std::size_t(position_[i]), K0);
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k) {
      const Term& t = minus_d2_[std::size_t(k)];
      lu.add(std::size_t(position_[i]), std::size_t(position_[std::size_t(t.column)]), K1 * t.value);
    }
  }
  if (!std::isfinite(lu.factor().log_abs)) throw Failure("no steady sliding: its equation is singular");
  solve(lu, b);
  for (std::size_t i = 0; i < size(); ++i) psi[std::size_t(node[i])] = scene.v + b[i].real();
}

Complex Sliding::pointwise(std::size_t i, Complex lambda) const {
  Complex c = beta[i];
  if (has_state()) c += F_state[i] * g_psi[i] / (lambda + r[i]);
  return lambda * (lambda / A + c);
}

Complex Sliding::pointwise_slope(std::size_t i, Complex lambda) const {
  Complex c = 2. * lambda / A + beta[i];
  if (has_state()) c += F_state[i] * g_psi[i] * r[i] / ((lambda + r[i]) * (lambda + r[i]));
  return c;
}

std::vector<Complex> Sliding::minus_d2(const std::vector<Complex>& p) const {
  std::vector<Complex> y(size());
  for (std::size_t i = 0; i < size(); ++i) {
    y[i] = row_sum_[i] * p[i];
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k) {
      const Term& t = minus_d2_[std::size_t(k)];
      y[i] += t.value * (p[std::size_t(t.column)] - p[i]);
    }
  }
  return y;
}

std::vector<Complex> Sliding::apply(Complex lambda, const std::vector<Complex>& p) const {
  std::vector<Complex> y = minus_d2(p);
  for (std::size_t i = 0; i < size(); ++i) y[i] = (pointwise(i, lambda) + K0) * p[i] + K1 * y[i];
  return y;
}

std::vector<Complex> Sliding::apply_slope(Complex lambda, const std::vector<Complex>& p) const {
  std::vector<Complex> y(size());
  for (std::size_t i = 0; i < size(); ++i) y[i] = pointwise_slope(i, lambda) * p[i];
  return y;
}

LogDet Sliding::factor(Complex lambda, BandLU& lu) const {
  fill(lambda, 1, lu);
  LogDet det = lu.factor();
  for (double x : r) {
    const Complex f = lambda + x;
    det.log_abs += std::log(std::abs(f));
    det.unit *= f / std::abs(f);
  }
  det.unit /= std::abs(det.unit);
  return det;
}

Sliding::Sliding(const Sliding& whole, std::size_t first, std::size_t count)
    : scene(whole.scene), A(whole.A), B(whole.B), K0(whole.K0), K1(whole.K1), s_delta(whole.s_delta) {
  const auto cut = [&](auto& to, const auto& from) {
    if (!from.empty()) to.assign(from.begin() + long(first), from.begin() + long(first + count));
  };
  cut(node, whole.node);
  cut(F_psi, whole.F_psi);
  cut(F_state, whole.F_state);
  cut(g_psi, whole.g_psi);
  cut(r, whole.r);
  cut(beta, whole.beta);
  cut(weight, whole.weight);
  cut(row_sum_, whole.row_sum_);
  symmetric = whole.symmetric;
  uniform = false;
  row_start_ = {0};
  for (std::size_t i = 0; i < count; ++i) {
    position_.push_back(int(i));
    for (const auto& [column, value] : whole.coupling_row(first + i)) {
      if (column < first || column >= first + count) {
        row_sum_[i] -= value;
        continue;
      }
      minus_d2_.push_back({int(column - first), value});
      band_ = std::max(band_, std::abs(int(column - first) - int(i)));
    }
    row_start_.push_back(int(minus_d2_.size()));
  }
}

Sliding Sliding::segment(std::size_t first, std::size_t count) const { return Sliding(*this, first, count); }

void Sliding::fill(Complex lambda, Complex factor, BandLU& lu) const {
  lu.reset(size(), band_, band_);
  for (std::size_t i = 0; i < size(); ++i) {
    const std::size_t row = std::size_t(position_[i]);
    lu.add(row, row, factor * (pointwise(i, lambda) + K0));
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k) {
      const Term& t = minus_d2_[std::size_t(k)];
      lu.add(row, std::size_t(position_[std::size_t(t.column)]), factor * (K1 * t.value));
    }
  }
}

double Sliding::phase_right(Complex lambda) const {
  BandLU lu;
  fill(lambda, 1. / lambda, lu);
  return lu.factor(false).phase + double(size()) * std::arg(lambda);
}

std::optional<double> Sliding::follow_pivots(Complex from, Complex to) const {
  BandLU lu;
  const auto pivots = [&](Complex lambda) {
    fill(lambda, 1, lu);
    lu.factor(false);
    std::vector<Complex> d(size());
    for (std::size_t i = 0; i < d.size(); ++i) d[i] = lu.pivot(i);
    return d;
  };
  double turn = 0, at = 0, step = 0.1;
  std::vector<Complex> last = pivots(from);
  for (int k = 0; at < 1; ++k) {
    if (k == 400) return std::nullopt;
    const double next_at = std::min(1., at + step);
    std::vector<Complex> next = pivots(from + (to - from) * next_at);
    double change = 0;
    bool follows = true;
    for (std::size_t i = 0; i < next.size() && follows; ++i) {
      follows = std::norm(next[i] - last[i]) < 0.25 * std::norm(last[i]);
      change += std::arg(next[i] * std::conj(last[i]));
    }
    if (!follows) {
      step /= 2;
      continue;
    }
    turn += change;
    at = next_at;
    step *= 1.5;
    last = std::move(next);
  }
  return turn;
}

// The real part of S/lambda is at least Re lambda/A + beta - |q|/(Re lambda + r) where D2 is symmetric.
double Sliding::right_of_all() const {
  if (!symmetric) return 1.01 * imaginary_bound();
  double x = 1e-3 * std::sqrt(A * (K0 + K1)) + 1e-300;
  for (std::size_t i = 0; i < size(); ++i)
    while (x / A + beta[i] - (has_state() ? std::abs(F_state[i] * g_psi[i]) / (x + r[i]) : 0) <= 0) x *= 1.1;
  return x;
}

std::vector<std::pair<std::size_t, double>> Sliding::coupling_row(std::size_t i) const {
  std::vector<std::pair<std::size_t, double>> row;
  for (int k = row_start_[i]; k < row_start_[i + 1]; ++k)
    row.emplace_back(std::size_t(minus_d2_[std::size_t(k)].column), minus_d2_[std::size_t(k)].value);
  return row;
}

void Sliding::solve(const BandLU& lu, std::vector<Complex>& b) const {
  std::vector<Complex> folded(size());
  for (std::size_t i = 0; i < size(); ++i) folded[std::size_t(position_[i])] = b[i];
  lu.solve(folded.data());
  for (std::size_t i = 0; i < size(); ++i) b[i] = folded[std::size_t(position_[i])];
}

void Sliding::solve_transposed(const BandLU& lu, std::vector<Complex>& b) const {
  std::vector<Complex> folded(size());
  for (std::size_t i = 0; i < size(); ++i) folded[std::size_t(position_[i])] = b[i];
  lu.solve_transposed(folded.data());
  for (std::size_t i = 0; i < size(); ++i) b[i] = folded[std::size_t(position_[i])];
}

std::vector<Complex> Sliding::expand(Complex lambda, const std::vector<Complex>& p) const {
  const std::size_t d = dof();
  std::vector<Complex> x(size() * d);
  for (std::size_t i = 0; i < size(); ++i) {
    x[i * d] = p[i];
    x[i * d + 1] = (lambda / A + B + F_psi[i]) * p[i];
    if (has_state()) {
      x[i * d + 2] = g_psi[i] * p[i] / (lambda + r[i]);
      x[i * d + 1] += F_state[i] * x[i * d + 2];
    }
  }
  return x;
}

void Sliding::multiply(const Complex* x, Complex* y) const {
  const std::size_t d = dof();
  for (std::size_t i = 0; i < size(); ++i) {
    Complex stencil = row_sum_[i] * x[i * d];
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k) {
      const Term& t = minus_d2_[std::size_t(k)];
      stencil += t.value * (x[std::size_t(t.column) * d] - x[i * d]);
    }
    Complex f = F_psi[i] * x[i * d];
    if (has_state()) {
      f += F_state[i] * x[i * d + 2];
      y[i * d + 2] = g_psi[i] * x[i * d] - r[i] * x[i * d + 2];
    }
    y[i * d] = A * (x[i * d + 1] - B * x[i * d] - f);
    y[i * d + 1] = -K0 * x[i * d] - K1 * stencil - s_delta * (x[i * d + 1] - f);
  }
}

std::vector<Sliding::Entry> Sliding::entries() const {
  const std::size_t d = dof();
  std::vector<Entry> e;
  for (std::size_t i = 0; i < size(); ++i) {
    const std::size_t p = i * d;
    e.push_back({p, p, -A * (B + F_psi[i])});
    e.push_back({p, p + 1, A});
    e.push_back({p + 1, p, -K0 + s_delta * F_psi[i]});
    e.push_back({p + 1, p + 1, -s_delta});
    if (has_state()) {
      e.push_back({p, p + 2, -A * F_state[i]});
      e.push_back({p + 1, p + 2, s_delta * F_state[i]});
      e.push_back({p + 2, p, g_psi[i]});
      e.push_back({p + 2, p + 2, -r[i]});
    }
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k) {
      const Term& t = minus_d2_[std::size_t(k)];
      e.push_back({p + 1, std::size_t(t.column) * d, -K1 * t.value});
    }
  }
  return e;
}

double Sliding::mode_residual(Complex lambda, const std::vector<Complex>& p) const {
  const std::vector<Complex> x = expand(lambda, p);
  std::vector<Complex> y(x.size());
  multiply(x.data(), y.data());
  double above = 0, below = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    above += std::norm(y[i] - lambda * x[i]);
    below += std::norm(x[i]);
  }
  return std::sqrt(above / below);
}

// With t = (g_psi p - b_t)/(sigma + r) and e = b_p/A + (sigma/A + B + F_psi) p + F_state t put into the second
// equation: -S(sigma) p = b_e + (s delta + sigma) b_p/A - sigma F_state b_t/(sigma + r).
void Sliding::solve_shifted(Complex sigma, const BandLU& lu, const double* b, Complex* y) const {
  const std::size_t d = dof();
  std::vector<Complex> p(size());
  for (std::size_t i = 0; i < size(); ++i) {
    p[i] = -(b[i * d + 1] + (s_delta + sigma) * b[i * d] / A);
    if (has_state()) p[i] += sigma * F_state[i] * b[i * d + 2] / (sigma + r[i]);
  }
  solve(lu, p);
  for (std::size_t i = 0; i < size(); ++i) {
    y[i * d] = p[i];
    y[i * d + 1] = b[i * d] / A + (sigma / A + B + F_psi[i]) * p[i];
    if (has_state()) {
      y[i * d + 2] = (g_psi[i] * p[i] - b[i * d + 2]) / (sigma + r[i]);
      y[i * d + 1] += F_state[i] * y[i * d + 2];
    }
  }
}

double Sliding::stiffness(const std::vector<Complex>& p) const {
  const std::vector<Complex> d = minus_d2(p);
  double above = 0, below = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    above += weight[i] * (std::conj(p[i]) * d[i]).real();
    below += weight[i] * std::norm(p[i]);
  }
  return K0 + K1 * above / below;
}

double Sliding::wavenumber(const std::vector<Complex>& p) const {
  if (K1 == 0) return 0;
  const double h = scene.form == Form::chain ? 1 : scene.h();
  const double target = (stiffness(p) - K0) / K1;
  if (target <= 0) return 0;
  if (target >= largest_symbol(scene.order, h)) return M_PI / h;
  // the symbol is a polynomial in S = sin^2(k h/2) with positive coefficients: Newton from above cannot miss
  double s = target * h * h / 4;
  static constexpr double coefficient[] = {1, 1. / 3, 8. / 45, 4. / 35};
  for (int iteration = 0; iteration < 60; ++iteration) {
    double f = -target * h * h / 4, slope = 0, power = 1;
    for (int j = 0; j < scene.order / 2; ++j) {
      slope += (j + 1) * coefficient[j] * power;
      power *= s;
      f += coefficient[j] * power;
    }
    const double step = f / slope;
    s -= step;
    if (std::abs(step) <= 1e-16 * s) break;
  }
  return 2 / h * std::asin(std::sqrt(std::clamp(s, 0., 1.)));
}

double Sliding::dispersion_error(double k) const {
  if (scene.form == Form::chain || k == 0) return 0;
  return 1 - std::sqrt(symbol(scene.order, scene.h(), k)) / k;
}

std::vector<Complex> Sliding::dispersion(double K, double mean_beta_, double mean_q_, double mean_r_) const {
  if (has_state())
    return polynomial_roots({1 / A, mean_beta_ + mean_r_ / A, K + mean_r_ * mean_beta_ + mean_q_, mean_r_ * K});
  return polynomial_roots({1 / A, mean_beta_, K});
}

namespace {
double mean(const std::vector<double>& x) {
  double sum = 0;
  for (double y : x) sum += y - x[0];
  return x.empty() ? 0 : x[0] + sum / double(x.size());
}
}  // namespace

double Sliding::mean_beta() const { return mean(beta); }
double Sliding::mean_r() const { return mean(r); }
double Sliding::mean_q() const {
  std::vector<double> q(r.size());
  for (std::size_t i = 0; i < q.size(); ++i) q[i] = F_state[i] * g_psi[i];
  return mean(q);
}

std::vector<Sliding::Wave> Sliding::exact_waves() const {
  std::vector<Wave> waves;
  if (!uniform || !symmetric) return waves;
  const PetscInt n = scene.n;
  const double h = scene.form == Form::chain ? 1 : scene.h();
  if (scene.ring()) {
    for (PetscInt j = 0; 2 * j <= n; ++j)
      waves.push_back({2 * M_PI * double(j) / (double(n) * h), j == 0 || 2 * j == n ? 1 : 2});
    return waves;
  }
  // A free end reflects evenly about the node (continuum) or half a spacing beyond it (chain), a held end oddly.
  const double beyond = scene.form == Form::chain ? 0.5 : 0;
  const bool left = scene.left == End::velocity, right = scene.right == End::velocity;
  const double width = double(n - 1) + (left ? 0 : beyond) + (right ? 0 : beyond);
  for (std::size_t j = 0; j < size(); ++j) {
    const double turns = double(j) + (left && right ? 1 : left || right ? 0.5 : 0);
    waves.push_back({M_PI * turns / (width * h), 1});
  }
  return waves;
}

double Sliding::largest_stiffness() const {
  return K0 + K1 * largest_symbol(scene.order, scene.form == Form::chain ? 1 : scene.h());
}

namespace {
double largest_magnitude(const std::vector<double>& x) {
  double m = 0;
  for (double y : x) m = std::max(m, std::abs(y));
  return m;
}
}  // namespace

// Without a state and with D2 symmetric, an oscillating mode has |lambda|^2 = A times the weighted mean of K0 - K1 D2.
// Else: for |lambda| beyond the bound, S(lambda) is diagonally dominant.
double Sliding::imaginary_bound() const {
  if (symmetric && !has_state()) return std::sqrt(A * largest_stiffness());
  double rows = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    double sum = 0;
    for (int k = row_start_[i]; k < row_start_[i + 1]; ++k) sum += std::abs(minus_d2_[std::size_t(k)].value);
    rows = std::max(rows, sum);
  }
  const double stiff = K0 + K1 * rows, beta_max = largest_magnitude(beta), r_max = largest_magnitude(r);
  double q = 0;
  for (std::size_t i = 0; i < r.size(); ++i) q = std::max(q, std::abs(F_state[i] * g_psi[i]));
  double radius = 2 * r_max + std::sqrt(A * stiff);
  while (radius * (radius / A - beta_max - q / (radius - r_max + 1e-300)) <= stiff) radius *= 1.1;
  return radius;
}

double Sliding::real_bound() const {
  if (!symmetric || has_state()) return imaginary_bound();
  const auto [low, high] = std::minmax_element(beta.begin(), beta.end());
  double bound = -A * *low / 2;  // oscillating modes: -1/2 of a weighted mean of A beta
  // real roots: lambda^2/A + lambda b + K = 0 with b a mean of beta, K >= K0
  if (*low < 0 && *low * *low >= 4 * K0 / A) {
    bound = std::max(bound, A / 2 * (-*low + std::sqrt(*low * *low - 4 * K0 / A)));
  } else if (*high > 0 && *high * *high >= 4 * K0 / A) {
    bound = std::max(bound, -2 * K0 / (*high + std::sqrt(*high * *high - 4 * K0 / A)));
  }
  return bound;
}

std::vector<Complex> polynomial_roots(const std::vector<double>& c) {
  if (c.size() == 3) {  // without cancellation
    const double b = c[1] / c[0], d = c[2] / c[0], disc = b * b / 4 - d;
    if (disc < 0) return {Complex(-b / 2, std::sqrt(-disc)), Complex(-b / 2, -std::sqrt(-disc))};
    const double large = -b / 2 - std::copysign(std::sqrt(disc), b);
    return {large, large == 0 ? 0 : d / large};
  }
  // A cubic: Newton's iteration from beyond its outermost turning point, on the side where the real root is (Kahan
  // 1986); then the quadratic that is left, deflated from the side that loses no digits.
  double root = -c[1] / (3 * c[0]);
  const auto value = [&](double x) { return ((c[0] * x + c[1]) * x + c[2]) * x + c[3]; };
  const auto slope = [&](double x) { return (3 * c[0] * x + 2 * c[1]) * x + c[2]; };
  const double at = value(root) / c[0], side = at >= 0 ? 1 : -1;
  double distance = std::cbrt(std::abs(at));
  if (-slope(root) / c[0] > 0) distance = 1.324718 * std::max(distance, std::sqrt(-slope(root) / c[0]));
  if (c[3] == 0) {
    root = 0;
  } else if (distance > 0) {
    double x = root - side * distance, last;
    do {
      last = x;
      if (slope(last) == 0) break;
      x = last - value(last) / slope(last) / (1 + 1e-15);
    } while (side * x > side * last);
    root = last;
  }
  double linear = c[1] + c[0] * root, constant = c[2] + linear * root;
  if (root != 0 && std::abs(c[0]) * root * root > std::abs(c[3] / root)) {
    constant = -c[3] / root;
    linear = (constant - c[2]) / root;
  }
  std::vector<Complex> roots = polynomial_roots({c[0], linear, constant});
  roots.push_back(root);
  return roots;
}

}  // namespace stickslip
