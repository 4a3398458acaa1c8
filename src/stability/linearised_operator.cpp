#include "stickslip/stability/linearised_operator.hpp"

#include <algorithm>
#include <cmath>

#include "base/failure.hpp"
#include "base/pulse.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"
#include "stickslip/stability/fastest_wave.hpp"

namespace stickslip {

NodeVector LinearisedOperator::node_of(const std::vector<Complex>& x, std::size_t i) const {
  const Complex* const at = &x[i * dof()];
  const std::size_t eta = 1 - psi_entries();
  return {eta == 1 ? at[0] : 0, at[eta], has_state() ? at[eta + 1] : 0};
}

void LinearisedOperator::put(const NodeVector& v, std::size_t i, std::vector<Complex>& x) const {
  Complex* const at = &x[i * dof()];
  const std::size_t eta = 1 - psi_entries();
  if (eta == 1) at[0] = v.psi;
  at[eta] = v.eta;
  if (has_state()) at[eta + 1] = v.state;
}

LinearisedOperator::LinearisedOperator(const SteadySliding& s)
    : scene(s.scene), A(0), K0(0), K1(scene.mean_K1()), N(scene.N()),
      rate(scales_of(scene).rate), coupling(scene), medium_(scene.averaged()), mean_(medium_) {
  slopes_.reserve(coupling.size());
  for (const PetscInt i : coupling.node) slopes_.push_back(s.slopes[i]);
  if (scene.medium.nodes_differ())
    for (const PetscInt i : coupling.node) nodes_.push_back(scene.coefficients(i));
  for (const NodeCoefficients& c : nodes_) {
    A = std::max(A, c.A);
    K0 = std::max(K0, c.K0);
  }
  if (nodes_.empty()) {
    A = medium_.A;
    K0 = medium_.K0;
  }
  uniform =
      !scene.medium.varies() && std::all_of(slopes_.begin(), slopes_.end(),
                                            [&](const FrictionSlopes& f) { return f == slopes_.front(); });
  for (std::size_t i = 0; i < size() && scene.massless(); ++i)
    if (const double resistance = point(i).beta(); !(resistance > 0))
      throw failure(
          "no steady sliding without mass: at x = {:.6g} friction falls with velocity faster than zeta psi "
          "rises (zeta/f0 + F_psi = {:.6g}), and the force does not say what psi is; take model_m > 0",
          scene.x(coupling.node[i]), resistance);
  refuse_rates_too_large();
  if (size() > 0) mean_ = find_mean();
}

// Beyond 1e60 cubes of rates, of waves 1e15 times as fast in the continuum too, would overflow and their
// signs be wrong.
void LinearisedOperator::refuse_rates_too_large() const {
  const double shortest_wave = coupling.largest_row();
  for (std::size_t i = 0; i < (uniform ? std::min<std::size_t>(size(), 1) : size()); ++i) {
    const auto [c2, c1, c0] = point(i).characteristic(shortest_wave);
    const double fastest = std::abs(c2) + std::sqrt(std::abs(c1)) + std::cbrt(std::abs(c0));
    if (!(fastest < 1e60))
      throw Failure("rates of perturbations of steady sliding (" + rounded_text(fastest, 2) +
                    ") are too large to be computed with: choose gentler units");
  }
}

LinearisedOperator::LinearisedOperator(const LinearisedOperator& whole, std::size_t first, std::size_t count)
    : scene(whole.scene), A(whole.A), K0(whole.K0), K1(whole.K1), N(whole.N), rate(whole.rate),
      coupling(whole.coupling.segment(first, count)), uniform(false), medium_(whole.medium_),
      mean_(whole.medium_), slopes_(whole.slopes_.begin() + first, whole.slopes_.begin() + first + count) {
  if (!whole.nodes_.empty())
    nodes_.assign(whole.nodes_.begin() + first, whole.nodes_.begin() + first + count);
  if (size() > 0) mean_ = find_mean();
}

LinearisedOperator LinearisedOperator::segment(std::size_t first, std::size_t count) const {
  return LinearisedOperator(*this, first, count);
}

// ---- S

std::vector<Complex> LinearisedOperator::apply(Complex lambda, const std::vector<Complex>& p) const {
  std::vector<Complex> y = coupling.minus_d2(p);
  const Complex coupled = coupling_factor(lambda);
  for (std::size_t i = 0; i < size(); ++i) {
    const LinearPoint m = point(i);
    y[i] = (m.diagonal(lambda) + m.K0) * p[i] + coupled * y[i];
  }
  return y;
}

std::vector<Complex> LinearisedOperator::apply_slope(Complex lambda, const std::vector<Complex>& p) const {
  std::vector<Complex> y(size());
  for (std::size_t i = 0; i < size(); ++i) y[i] = point(i).diagonal_slope(lambda) * p[i];
  add_viscous(p, 1, 0, y);
  return y;
}

// Adds `factor` times -N D2 p to the entries first, first + stride, ... of x, where there is viscosity.
void LinearisedOperator::add_viscous(const std::vector<Complex>& p, std::size_t stride, std::size_t first,
                                     std::vector<Complex>& x, double factor) const {
  if (N == 0) return;
  const std::vector<Complex> stencil = coupling.minus_d2(p);
  for (std::size_t i = 0; i < size(); ++i) x[i * stride + first] += factor * N * stencil[i];
}

void LinearisedOperator::assemble(Complex lambda, Complex factor, BandLU& lu) const {
  lu.reset(size(), coupling.band(), coupling.band());
  for (std::size_t i = 0; i < size(); ++i) {
    const std::size_t row = coupling.position(i);
    const LinearPoint m = point(i);
    lu.add(row, row, factor * (m.diagonal(lambda) + m.K0));
  }
  coupling.add_to(lu, factor * coupling_factor(lambda));
}

LogDet LinearisedOperator::factor(Complex lambda, BandLU& lu) const {
  beat("factorisations");
  assemble(lambda, 1, lu);
  LogDet det = lu.factor();
  if (has_state())
    for (std::size_t i = 0; i < size(); ++i) det.multiply(lambda + point(i).r());
  det.unit /= std::abs(det.unit);
  return det;
}

// ---- J

std::vector<Complex> LinearisedOperator::expand(Complex lambda, const std::vector<Complex>& p) const {
  std::vector<Complex> x(unknowns());
  for (std::size_t i = 0; i < size(); ++i) put(point(i).expand(lambda, p[i]), i, x);
  add_viscous(p, dof(), 1, x);
  return x;
}

std::vector<Complex> LinearisedOperator::expand_fields(Complex lambda, const std::vector<Complex>& p) const {
  const std::vector<Complex> x = expand(lambda, p);
  if (psi_entries() == 0) return x;
  std::vector<Complex> all;
  for (std::size_t i = 0; i < size(); ++i) {
    all.push_back(p[i]);
    all.insert(all.end(), x.begin() + i * dof(), x.begin() + (i + 1) * dof());
  }
  return all;
}

Complex LinearisedOperator::psi_of(const Complex* x, std::size_t i) const {
  if (psi_entries() == 0) return x[0];
  const LinearPoint m = point(i);
  return (x[0] - (has_state() ? m.F_state * x[1] : 0)) / m.beta();
}

std::vector<Complex> LinearisedOperator::multiply(const std::vector<Complex>& x) const {
  const std::size_t d = dof();
  std::vector<Complex> p(size()), y(x.size());
  for (std::size_t i = 0; i < size(); ++i) p[i] = psi_of(&x[i * d], i);
  const std::vector<Complex> stencil = coupling.minus_d2(p);
  for (std::size_t i = 0; i < size(); ++i) {
    const NodeVector v = node_of(x, i);
    if (scene.massless()) {
      put({0, -K0 * p[i] - K1 * stencil[i], point(i).g_psi * p[i] + point(i).g_state * v.state}, i, y);
      continue;
    }
    const NodeBlock b = point(i).block(Part::full);
    put({b.psi_psi * v.psi + b.psi_eta * v.eta + b.psi_state * v.state - A * N * stencil[i],
         b.eta_psi * v.psi + b.eta_eta * v.eta + b.eta_state * v.state -
             (K1 - medium_.s_delta * N) * stencil[i],
         b.state_psi * v.psi + b.state_state * v.state},
        i, y);
  }
  return y;
}

std::vector<LinearisedOperator::Entry> LinearisedOperator::entries() const {
  if (scene.massless()) return massless_entries();
  const std::size_t d = dof();
  std::vector<Entry> e;
  for (std::size_t i = 0; i < size(); ++i) {
    double rows[9];
    point(i).block(Part::full).write(int(d), rows);
    for (std::size_t k = 0; k < d * d; ++k)
      if (rows[k] != 0) e.push_back({i * d + k / d, i * d + k % d, rows[k]});
    for (const Coupling::Term& t : coupling.row(i)) {
      e.push_back({i * d + 1, t.column * d, (medium_.s_delta * N - K1) * t.value});
      if (N > 0) e.push_back({i * d, t.column * d, -A * N * t.value});
    }
  }
  return e;
}

// psi_j, in the columns of its eta and state, acts on eta of its neighbours and on its own state.
std::vector<LinearisedOperator::Entry> LinearisedOperator::massless_entries() const {
  const std::size_t d = dof();
  std::vector<Entry> e;
  const auto add_psi = [&](std::size_t row, std::size_t node, double factor) {
    const LinearPoint m = point(node);
    e.push_back({row, node * d, factor / m.beta()});
    if (has_state()) e.push_back({row, node * d + 1, -factor * m.F_state / m.beta()});
  };
  for (std::size_t i = 0; i < size(); ++i) {
    add_psi(i * d, i, -K0);
    for (const Coupling::Term& t : coupling.row(i)) add_psi(i * d, t.column, -K1 * t.value);
    if (!has_state()) continue;
    add_psi(i * d + 1, i, point(i).g_psi);
    e.push_back({i * d + 1, i * d + 1, point(i).g_state});
  }
  return e;
}

std::vector<double> LinearisedOperator::balance() const {
  std::size_t most = 0;  // the node on which the state acts most
  for (std::size_t i = 1; i < size() && has_state() && !uniform; ++i)
    if (std::abs(point(i).q()) > std::abs(point(most).q())) most = i;
  const auto units = stickslip::balance(point(most));
  return {units.begin() + psi_entries(), units.begin() + fields()};
}

double LinearisedOperator::mode_residual(Complex lambda, const std::vector<Complex>& p) const {
  const std::vector<Complex> x = expand(lambda, p), y = multiply(x);
  const std::vector<double> units = balance();
  double above = 0, below = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double unit = units[i % dof()];
    above += std::norm((y[i] - lambda * x[i]) / unit);
    below += std::norm(x[i] / unit);
  }
  return std::sqrt(above / below);
}

std::vector<Complex> LinearisedOperator::resolvent(Complex lambda, const BandLU& lu,
                                                   const std::vector<Complex>& b) const {
  beat("solutions");
  std::vector<Complex> p(size()), y(b.size());
  for (std::size_t i = 0; i < size(); ++i) p[i] = -point(i).condense(lambda, node_of(b, i));
  solve(lu, p);
  for (std::size_t i = 0; i < size(); ++i) put(point(i).expand(lambda, p[i], node_of(b, i)), i, y);
  add_viscous(p, dof(), 1, y);
  return y;
}

// ---- waves

double LinearisedOperator::symbol(double k) const { return stickslip::symbol(scene.order, spacing(), k); }
double LinearisedOperator::largest_symbol() const {
  return stickslip::largest_symbol(scene.order, spacing());
}

double LinearisedOperator::wavenumber(const std::vector<Complex>& p) const {
  if (K1 == 0) return 0;
  const std::vector<Complex> d = coupling.minus_d2(p, true);
  const double h = spacing();
  double above = 0, below = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    above += coupling.weight[i] * (std::conj(p[i]) * d[i]).real();
    below += coupling.weight[i] * std::norm(p[i]);
  }
  const double target = above / below;
  if (!(target > 0)) return 0;
  if (target >= largest_symbol()) return M_PI / h;
  // kappa lies between what stencils of order 2 and more say of k, (2/h) sin(k h/2), and k itself
  const double kappa = std::sqrt(target), low = 0.999999 * kappa, sine = 1.000001 * kappa * h / 2;
  const double high = sine < 1 ? 2 / h * std::asin(sine) : M_PI / h;
  const auto off = [&](double k) { return symbol(k) - target; };
  return find_root(off, {low, off(low), high, off(high)}, 0);
}

double LinearisedOperator::dispersion_error(double k) const {
  if (scene.form == Form::chain || k == 0) return 0;
  return 1 - std::sqrt(symbol(k)) / k;
}

LinearPoint LinearisedOperator::find_mean() const {
  if (uniform) return point(0);
  LinearPoint m = medium_;
  m.set(slopes_[0]);
  double F_psi = 0, q = 0, r = 0;  // over those of the first node
  for (std::size_t i = 0; i < size(); ++i) {
    const LinearPoint p = point(i);
    F_psi += p.F_psi - m.F_psi;
    q += p.q() - m.q();
    r += p.r() - m.r();
  }
  const double n = double(size());
  m.F_psi += F_psi / n;
  m.F_state = m.q() + q / n;
  m.g_psi = 1;
  m.g_state -= r / n;
  return m;
}

std::vector<LinearisedOperator::Wave> LinearisedOperator::exact_waves() const {
  std::vector<Wave> found;
  if (!has_exact_waves()) return found;
  const Waves waves = Waves::of(scene);
  for (PetscInt j = 0; j < waves.count; ++j)
    found.push_back({waves.k(j), !scene.ring() || j == 0 || 2 * j == scene.n ? 1 : 2});
  return found;
}

std::vector<Complex> LinearisedOperator::wave(double k) const {
  const bool held = scene.left == End::velocity;
  const double beyond = scene.form == Form::chain && scene.left == End::free ? 0.5 : 0;
  std::vector<Complex> psi(size());
  for (std::size_t i = 0; i < size(); ++i) {
    const double phase = k * spacing() * (double(coupling.node[i]) + beyond);
    psi[i] = scene.ring() ? std::polar(1., phase) : held ? std::sin(phase) : std::cos(phase);
  }
  return psi;
}

std::array<double, 3> balance(const LinearPoint& m) {
  const auto near = [](double x) {
    return x > 0 && std::isfinite(x) ? std::exp2(std::round(std::log2(x))) : 1;
  };
  const double K = m.K0 > 0 ? m.K0 : m.K1, resistance = std::abs(m.beta());
  const double pull = std::abs(m.g_psi / m.F_state);
  if (m.massless()) return {1, near(resistance), near(resistance * std::sqrt(pull / K))};
  return {1, near(K > 0 ? std::sqrt(K / m.A) : resistance), near(std::sqrt(pull / m.A))};
}

std::vector<Complex> dispersion(const LinearPoint& medium, double kappa2) {
  const auto [c2, c1, c0] = medium.characteristic(kappa2);
  if (medium.massless()) return medium.has_state ? polynomial_roots({1, c1, c0}) : std::vector<Complex>{-c1};
  if (medium.has_state) return polynomial_roots({1, c2, c1, c0});
  return polynomial_roots({1, c2, c1});
}

// ---- bounds

// Without a state and with D2 symmetric, an oscillating mode has |lambda|^2 = A times the weighted mean of K0
// - K1 D2, with viscosity too. Else: for |lambda| beyond the bound, S(lambda) is diagonally dominant.
double LinearisedOperator::imaginary_bound() const {
  if (scene.medium.varies() && symmetric() && !has_state()) return wave_frequency(scene);
  // without mass: of none, all are real
  if (symmetric() && !has_state()) return rate_of(largest_stiffness());
  const double stiff = K0 + K1 * coupling.largest_row();
  double beta = 0, r = 0, q = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    const LinearPoint p = point(i);
    beta = std::max(beta, std::abs(p.beta()));
    r = std::max(r, std::abs(p.r()));
    q = std::max(q, std::abs(p.q()));
  }
  beta += N * coupling.largest_row();
  if (scene.massless()) return massless_bound(stiff, r, q);
  double radius = 2 * r + rate_of(stiff);
  while (radius * (radius / A - beta - q / (radius - r + 1e-300)) <= stiff) radius *= 1.1;
  return radius;
}

// |lambda| is less than twice the larger of what beta |lambda| = K and beta |lambda| = |q| give, or than 2 r.
double LinearisedOperator::massless_bound(double stiff, double r, double q) const {
  double beta = point(0).beta();
  for (std::size_t i = 1; i < size(); ++i) beta = std::min(beta, point(i).beta());
  double radius = 2 * r + 1e-300;
  while (radius * (beta - q / (radius - r)) <= stiff) radius *= 1.1;
  return radius;
}

// Oscillating modes grow at -1/2 of a weighted mean of the damping C - A N D2; real ones obey lambda^2 + C
// lambda + A K = 0 with C such a mean and K >= K0. (Of unequal masses the means have the weight |psi|^2/A.)
double LinearisedOperator::real_bound() const {
  if (!symmetric() || has_state()) return imaginary_bound();
  if (scene.massless()) return 0;  // K0 - K1 D2 is not negative
  double low = point(0).damping(), high = low, least = A * K0;
  for (std::size_t i = 1; i < size(); ++i) {
    low = std::min(low, point(i).damping());
    high = std::max(high, point(i).damping());
  }
  for (const NodeCoefficients& c : nodes_) least = std::min(least, c.A * c.K0);
  high += viscous_rate();
  const double pull = 4 * least;
  double bound = -low / 2;
  if (low < 0 && low * low >= pull)
    bound = std::max(bound, (-low + std::sqrt(low * low - pull)) / 2);
  else if (high > 0 && high * high >= pull)
    bound = std::max(bound, -pull / 2 / (high + std::sqrt(high * high - pull)));
  return bound;
}

}  // namespace stickslip
