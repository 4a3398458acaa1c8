#include "stickslip/stability/linearised_operator.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

// Boundary layers, by deviations u from v: (K0 - K1 D2) u = K1 (D2 to the held nodes)(psi_e - v). The largest
// residual of that equation is returned.
double put_layers(const Scene& s, std::vector<double>& psi) {
  for (const PetscInt i : {PetscInt(0), s.n - 1})
    if (s.held(i)) psi[i] = i == 0 ? s.left_value : s.right_value;
  if (s.mean_K1() == 0 || std::all_of(psi.begin(), psi.end(), [&](double x) { return x == s.v; })) return 0;
  const Coupling coupling(s);
  const std::size_t n = coupling.size();
  if (n == 0) return 0;
  const auto K0 = [&](std::size_t i) { return s.coefficients(coupling.node[i]).K0; };
  std::vector<Complex> b(n, Complex(0));
  for (std::size_t i = 0; i < n; ++i) {
    const PetscInt g = coupling.node[i];
    if (g >= s.order && g < s.n - s.order) continue;
    for (const auto& [column, value] : coupling_row(s, g))
      if (s.held(column)) b[i] += value * (psi[column] - s.v);
  }
  BandLU lu;
  lu.reset(n, coupling.band(), coupling.band());
  for (std::size_t i = 0; i < n; ++i) lu.add(coupling.position(i), coupling.position(i), K0(i));
  coupling.add_to(lu, s.mean_K1());
  if (!std::isfinite(lu.factor().log_abs)) throw Failure("no steady sliding: its equation is singular");
  std::vector<Complex> u = b;
  coupling.solve(lu, u);
  const std::vector<Complex> image = coupling.minus_d2(u);
  double residual = 0;
  for (std::size_t i = 0; i < n; ++i) {
    psi[coupling.node[i]] = s.v + u[i].real();
    residual = std::max(residual, std::abs(b[i] - K0(i) * u[i] - s.mean_K1() * image[i]));
  }
  return residual;
}

// N D2 psi of node i: 0 where sliding is uniform.
double viscous_force(const Scene& s, const std::vector<double>& psi, PetscInt i) {
  if (s.N() == 0 || !s.any_held()) return 0;
  double d2 = 0;
  for (const auto& [column, weight] : second_difference_row(s, i)) d2 += weight * (psi[column] - psi[i]);
  return s.N() * d2;
}

}  // namespace

SteadySliding::SteadySliding(const Scene& s) : scene(s), psi(s.n, s.v) {
  residual = put_layers(s, psi);
  const std::vector<double> amplitude = friction_amplitude(s, 0, s.n);
  const Frictions frictions(s, 0, s.n);
  slopes.resize(psi.size());
  eta.resize(psi.size());
  if (s.friction.has_state()) state.resize(psi.size());
  for (std::size_t i = 0; i < psi.size(); ++i) {
    const bool solved_for = !s.held(i);
    const Friction* const friction = &frictions[i];
    const double x = friction->steady_state(psi[i]);
    const auto place = [&] { return "(x = " + rounded_text(s.x(i), 6) + ")"; };
    if (friction->has_state && !std::isfinite(x))
      throw Failure("no steady sliding: the contact state grows without end " +
                    (psi[i] == 0 ? "at psi = 0 " + place() + "; the plate must move (model_v)"
                                 : "in motion " + place()));
    if (psi[i] == 0 && friction->sticks && solved_for)
      throw Failure("no steady sliding: at psi = 0 " + place() +
                    " the law sticks; take model_v other than 0, or friction_stick regularised");
    Partials f = friction->partials(psi[i], x);
    const RatePartials g = friction->rate_partials(psi[i], x);
    for (double* part : {&f.F, &f.F_psi, &f.F_state}) *part *= amplitude[i];
    slopes[i] = {f.F_psi, f.F_state, g.g_psi, g.g_state};
    eta[i] = s.coefficients(PetscInt(i)).B * psi[i] + f.F - viscous_force(s, psi, i);
    if (friction->has_state) state[i] = x;
    if (!std::isfinite(eta[i]) || !std::isfinite(f.F_psi))
      throw Failure("no steady sliding: the friction at psi = " + rounded_text(psi[i], 6) + " is not finite");
    if (solved_for) residual = std::max(residual, std::abs(g.g));
  }
}

Coupling::Coupling(const Scene& s) : folded_(s.ring()) {
  const bool left = s.left == End::velocity, right = s.right == End::velocity;
  for (PetscInt i = left ? 1 : 0; i < (right ? s.n - 1 : s.n); ++i) node.push_back(i);
  const auto is_held = [&](PetscInt i) { return (left && i == 0) || (right && i == s.n - 1); };
  weight.assign(size(), 1);
  if (s.form == Form::continuum && size() > 0) {
    if (s.left == End::free) weight.front() = 0.5;
    if (s.right == End::free) weight.back() = 0.5;
  }
  symmetric = !((left || right) && s.order > 2);

  // the interior rows are all alike, the library's row function serves the ends
  const std::array<double, 5> w = second_difference(s.order);
  const double scale = s.form == Form::chain ? 1 : 1 / (s.h() * s.h());
  const PetscInt half = s.order / 2, before = left ? 1 : 0;
  starts_.reserve(size() + 1);
  terms_.reserve(size() * (s.order + 1));
  row_sum_.assign(size(), 0);
  for (std::size_t i = 0; i < size(); ++i) {
    const PetscInt g = node[i];
    if (s.medium.links_differ()) {
      add_link_row(s, g);
    } else if (g >= s.order && g < s.n - s.order) {
      for (PetscInt j = -half; j <= half; ++j)
        terms_.push_back({std::size_t(g + j - before), -scale * w[std::abs(j)]});
    } else {
      for (const auto& [column, value] : second_difference_row(s, g)) {
        if (is_held(column))
          row_sum_[i] += value;
        else
          terms_.push_back({std::size_t(column - before), -value});
      }
    }
    close_row();
  }
}

// Row of node g, with its values of equal links beside it.
void Coupling::add_link_row(const Scene& s, PetscInt g) {
  const PetscInt before = node.front();
  const double unit = s.mean_K1() > 0 ? 1 / s.mean_K1() : 0;
  const Combination equal = second_difference_row(s, g), own = coupling_row(s, g);
  double own_sum = 0, equal_sum = 0;
  for (std::size_t k = 0; k < own.size(); ++k) {  // of order 2 both have the same nodes
    if (s.held(own[k].first)) {
      own_sum += unit * own[k].second;
      equal_sum += equal[k].second;
    } else {
      terms_.push_back({std::size_t(own[k].first - before), -unit * own[k].second});
      plain_.push_back(-equal[k].second);
    }
  }
  row_sum_[starts_.size() - 1] = own_sum;
  plain_sum_.push_back(equal_sum);
}

void Coupling::close_row() {
  const std::size_t i = starts_.size() - 1;
  starts_.push_back(terms_.size());
  for (const Term& t : row(i)) band_ = std::max(band_, std::abs(int(position(t.column)) - int(position(i))));
}

Coupling Coupling::segment(std::size_t first, std::size_t count) const {
  Coupling part;
  const auto cut = [&](auto& to, const auto& from) {
    to.assign(from.begin() + first, from.begin() + first + count);
  };
  cut(part.node, node);
  cut(part.weight, weight);
  cut(part.row_sum_, row_sum_);
  if (!plain_.empty()) cut(part.plain_sum_, plain_sum_);
  part.symmetric = symmetric;
  for (std::size_t i = 0; i < count; ++i) {
    for (const Term& t : row(first + i)) {
      if (t.column < first || t.column >= first + count)
        part.row_sum_[i] -= t.value;
      else
        part.terms_.push_back({t.column - first, t.value});
    }
    for (std::size_t k = starts_[first + i]; k < starts_[first + i + 1] && !plain_.empty(); ++k) {
      const std::size_t column = terms_[k].column;
      if (column < first || column >= first + count)
        part.plain_sum_[i] -= plain_[k];
      else
        part.plain_.push_back(plain_[k]);
    }
    part.close_row();
  }
  return part;
}

std::vector<Complex> Coupling::minus_d2(const std::vector<Complex>& p, bool plain) const {
  std::vector<Complex> y(size());
  for (std::size_t i = 0; i < size() && plain && !plain_.empty(); ++i) {
    y[i] = plain_sum_[i] * p[i];
    for (std::size_t k = starts_[i]; k < starts_[i + 1]; ++k)
      y[i] += plain_[k] * (p[terms_[k].column] - p[i]);
  }
  if (plain && !plain_.empty()) return y;
  for (std::size_t i = 0; i < size(); ++i) {
    y[i] = row_sum_[i] * p[i];
    for (const Term& t : row(i)) y[i] += t.value * (p[t.column] - p[i]);
  }
  return y;
}

double Coupling::largest_row() const {
  double largest = 0;
  for (std::size_t i = 0; i < size(); ++i) {
    double sum = 0;
    for (const Term& t : row(i)) sum += std::abs(t.value);
    largest = std::max(largest, sum);
  }
  return largest;
}

std::size_t Coupling::position(std::size_t i) const {
  return !folded_ ? i : i < (size() + 1) / 2 ? 2 * i : 2 * (size() - 1 - i) + 1;
}

void Coupling::add_to(BandLU& lu, Complex factor) const {
  for (std::size_t i = 0; i < size(); ++i)
    for (const Term& t : row(i)) lu.add(position(i), position(t.column), factor * t.value);
}

void Coupling::solve(const BandLU& lu, std::vector<Complex>& b, bool transposed) const {
  std::vector<Complex> ordered(size());
  for (std::size_t i = 0; i < size(); ++i) ordered[position(i)] = b[i];
  if (transposed)
    lu.solve_transposed(ordered.data());
  else
    lu.solve(ordered.data());
  for (std::size_t i = 0; i < size(); ++i) b[i] = ordered[position(i)];
}

}  // namespace stickslip
