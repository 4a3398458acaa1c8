#include "stickslip/numerics/periodic_equations.hpp"

#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "numerics/condensed_period.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/continuation.hpp"
#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

namespace {

using std::size_t;
constexpr size_t stages = mesh_stages;
const Collocation& gauss() { return Collocation::gauss5(); }

Eigen::VectorXd units_of(const VectorField& field) {
  Eigen::VectorXd units(field.dim());
  for (int a = 0; a < field.dim(); ++a) units(a) = field.unit(a);
  return units;
}

}  // namespace

void solve_stages(const Collocation& method, int d, int band, double h, const double* J, int columns,
                  std::vector<double>& R) {
  Matrix<double> right = as_matrix(R.data(), stages * d, columns);
  solve_stages(method, d, band, h, J, right);
  as_matrix(R.data(), stages * d, columns) = right;
}

std::vector<double> carried(const Collocation& method, int d, int band, double h, const double* J) {
  const auto unit = Matrix<double>::Identity(d, d);
  Matrix<double> R = unit.replicate(stages, 1);
  solve_stages(method, d, band, h, J, R);
  std::vector<double> result(d * d);
  as_matrix(result.data(), d, d) = at_end(method, d, R) + method.end[0] * unit;
  return result;
}

template <class T>
Pencil<T> pencil_of(int d, const std::vector<T>& matrices) {
  const IntervalGroups<T> groups(d, matrices);
  const CyclicChain<T> chain(d, groups.count(), groups.products);
  const Matrix<T>&first = chain.first(), &last = chain.last();
  return {{first.data(), first.data() + first.size()}, {last.data(), last.data() + last.size()}};
}
template Pencil<double> pencil_of(int, const std::vector<double>&);
template Pencil<std::complex<double>> pencil_of(int, const std::vector<std::complex<double>>&);

template <class T>
std::vector<std::complex<double>> multipliers_of(int d, const Pencil<T>& pencil) {
  std::vector<T> minus_last = pencil.last;
  for (T& entry : minus_last) entry = -entry;
  return generalised_eigenvalues(d, pencil.first, minus_last);
}
template std::vector<std::complex<double>> multipliers_of(int, const Pencil<double>&);
template std::vector<std::complex<double>> multipliers_of(int, const Pencil<std::complex<double>>&);

// ---- the nonlinear equations

struct PeriodicEquations::Linear {
  CondensedPeriod condensed;
  double residual = 0;
};

PeriodicEquations::PeriodicEquations(std::vector<double> mesh, SharedField field)
    : mesh_(std::move(mesh)), field_(std::move(field)), d_(field_->dim()), n_(mesh_.size() - 1) {}

PeriodicEquations::PeriodicEquations(std::vector<double> mesh, FieldFamily family, double lambda,
                                     double scale)
    : PeriodicEquations(std::move(mesh), family(lambda)) {
  family_ = std::move(family);
  scale_ = scale;
  lambda_ = lambda;
}

std::vector<double> PeriodicEquations::fill(const std::function<void(double, double*)>& profile,
                                            double q) const {
  const size_t d = d_;
  std::vector<double> x(size());
  for (size_t i = 0; i < n_; ++i)
    for (size_t j = 0; j <= stages; ++j)
      profile(mesh_[i] + (mesh_[i + 1] - mesh_[i]) * gauss().basis.points()[j], &x[i * block() + j * d]);
  x[n_ * block()] = q;
  if (family_) x.back() = lambda_;
  return x;
}

void PeriodicEquations::at(const std::vector<double>& x, double phase, double* y) const {
  evaluate(gauss(), mesh_, x.data(), d_, phase, y);
}

std::vector<double> PeriodicEquations::fill(const PeriodicEquations& from,
                                            const std::vector<double>& x) const {
  std::vector<double> y = fill([&](double phase, double* out) { from.at(x, phase, out); }, from.q(x));
  if (family_) y.back() = from.lambda(x);
  return y;
}

void PeriodicEquations::set_lambda(double lambda) {
  if (!family_ || (lambda == lambda_ && lower_)) return;
  field_ = family_(lambda);
  auto [below, above, width] = beside_of<Error>(family_, lambda, 1e-6 * scale_, field_);
  lower_ = std::move(below);
  upper_ = std::move(above);
  width_ = width;
  lambda_ = lambda;
}

PeriodicEquations::Linear PeriodicEquations::linear(const std::vector<double>& x, bool zero_right) {
  set_lambda(lambda(x));
  const int d = d_, p = parameters(), s = stages;
  work(double(n_) * d * (10 + d * (field_->band() + 1)));
  const size_t b = block();
  const SharedField field = at_number(field_, q(x));
  const VectorField::Period period = field->period(q(x));
  const VectorField::Stiff stiff = field->stiff();
  SharedField lower, upper;
  double low_T = 1, high_T = 1;  // over the period
  if (family_) {
    lower = at_number(lower_, q(x));
    upper = at_number(upper_, q(x));
    low_T = lower->period(q(x)).T / period.T;
    high_T = upper->period(q(x)).T / period.T;
  }
  Linear out{{d, p}};
  const Eigen::VectorXd own = units_of(*field);
  const auto a = as_matrix(gauss().a.data(), s, s);
  const auto unit = Matrix<double>::Identity(d, d);
  Matrix<double> f(s, d), low(s, d), high(s, d), slope(s, d), rate, by_number, off, sizes,
      R(s * d, d + p + 1);
  std::vector<double> J(s * d * d);
  for (size_t i = 0; i < n_; ++i) {
    const double h = (mesh_[i + 1] - mesh_[i]) * period.T;
    const auto y = as_matrix(&x[i * b], 1, d), next = as_matrix(&x[(i + 1 < n_ ? i + 1 : 0) * b], 1, d);
    const auto Y = as_matrix(&x[i * b + d], s, d);
    for (int j = 0; j < s; ++j) {
      const double* at = Y.row(j).data();
      const double phase = mesh_[i] + (mesh_[i + 1] - mesh_[i]) * gauss().c[size_t(j)];
      field->rates_at(phase, at, f.row(j).data());
      field->jacobian_at(phase, at, &J[j * d * d]);
      slope.row(j) = period.slope / period.T * f.row(j);
      field->add_slope(at, f.row(j).data(), slope.row(j).data());
      if (!family_) continue;
      lower->rates_at(phase, at, low.row(j).data());
      upper->rates_at(phase, at, high.row(j).data());
    }
    rate = h * a * f;
    off = Y - y.replicate(s, 1) - rate;
    sizes = off.cwiseAbs().colwise().maxCoeff();
    sizes(stiff.component) /= 1 + h * stiff.rate;
    out.residual = std::max(out.residual, sizes.maxCoeff());
    R.leftCols(d) = unit.replicate(s, 1);
    by_number = h * a * slope;
    R.col(d) = by_number.reshaped<Eigen::RowMajor>();
    if (family_) {
      by_number = h / width_ * a * (high_T * high - low_T * low);
      R.col(d + 1) = by_number.reshaped<Eigen::RowMajor>();
    }
    if (zero_right)
      R.col(d + p).setZero();
    else
      R.col(d + p) = -off.reshaped<Eigen::RowMajor>();
    Matrix<double> right = gauss().end[0] * y - next;
    for (int j = 0; j < s; ++j) right += gauss().end[j + 1] * Y.row(j);
    out.residual = std::max(out.residual, right.cwiseAbs().maxCoeff());
    if (zero_right) right.setZero();
    // in units of the components, so that what is eliminated next to each other is alike in size
    for (int j = 0; j < s; ++j) {
      auto block = as_matrix(&J[size_t(j) * d * d], d, d);
      block = own.cwiseInverse().asDiagonal() * block * own.asDiagonal();
      R.middleRows(j * d, d).rightCols(p + 1).array().colwise() /= own.array();
    }
    out.condensed.add(h, field->band(), J.data(), R, right.transpose().cwiseQuotient(own));
  }
  if (!std::isfinite(out.residual)) throw Failure("the periodic equations are not finite");
  return out;
}

std::vector<double> PeriodicEquations::closed(const Linear& system, const std::vector<Condition>& conditions,
                                              const std::vector<double>& rights) const {
  const Eigen::VectorXd own = units_of(*field_);
  Matrix<double> rows(parameters(), d_ + parameters());
  for (int k = 0; k < parameters(); ++k) {
    rows.row(k).head(d_) = as_matrix(conditions[k].y0.data(), 1, d_).cwiseProduct(own.transpose());
    rows(k, d_) = conditions[k].q;
    if (family_) rows(k, d_ + 1) = conditions[k].lambda;
  }
  if (family_) rows(0, d_ + 1) -= (upper_->anchor() - lower_->anchor()) / width_;
  std::vector<double> x = system.condensed.solve(rows, rights);
  for (size_t k = 0; k < n_ * block(); ++k) x[k] *= own(Eigen::Index(k % size_t(d_)));
  return x;
}

PeriodicEquations::Step PeriodicEquations::step(const std::vector<double>& x,
                                                const std::vector<Condition>& conditions) {
  const Linear system = linear(x, false);
  Step result;
  result.residual = system.residual;
  std::vector<double> rights;
  for (const Condition& c : conditions) {
    double right = c.right - c.q * q(x) - (family_ ? c.lambda * lambda(x) : 0);
    for (int a = 0; a < d_; ++a) right -= c.y0[a] * x[a];
    rights.push_back(right);
  }
  rights[0] += field_->anchor();
  result.dx = closed(system, conditions, rights);
  return result;
}

std::vector<double> PeriodicEquations::tangent(const std::vector<double>& x,
                                               const std::vector<Condition>& rows) {
  std::vector<double> rights(rows.size());
  rights.back() = 1;
  return closed(linear(x, true), rows, rights);
}

std::vector<double> PeriodicEquations::in_units(std::vector<double> dx) const {
  const size_t values = n_ * block();
  for (size_t k = 0; k < values; ++k) dx[k] /= field_->unit(int(k % size_t(d_)));
  if (family_) dx[values + 1] /= scale_;
  return dx;
}

bool PeriodicEquations::Newton::took(const std::vector<double>& dx, std::size_t numbers) {
  const double last = last_step;
  double number_step = 0;
  last_step = 0;
  for (size_t k = 0; k < dx.size(); ++k) {
    last_step = std::max(last_step, std::abs(dx[k]));
    if (k >= dx.size() - numbers) number_step = std::max(number_step, std::abs(dx[k]));
  }
  q_step = std::abs(dx[dx.size() - numbers]);
  const bool stagnant = last >= 0 && last_step > .2 * last;
  converged = last_step < 1e-12 || (stagnant && last_step < 1e-8) ||
              (stagnant && last_step < 1e-3 && number_step < 1e-11);
  return converged;
}

PeriodicEquations::Newton PeriodicEquations::newton(std::vector<double>& x,
                                                    const std::vector<Condition>& conditions, int most) {
  Newton result;
  const size_t d = d_, b = block();
  for (int it = 0; it < most; ++it) {
    beat("Newton steps");
    Step s = step(x, conditions);
    const double period = at_number(field_, q(x))->period(q(x)).T;
    for (size_t i = 0; i < n_; ++i)
      for (size_t j = 0; j < stages; ++j) {
        const size_t at = i * b + (j + 1) * d;
        const double width = mesh_[i + 1] - mesh_[i];
        field_->safeguard_step(mesh_[i] + width * gauss().c[j], &x[at],
                               gauss().a[j * (stages + 1)] * width * period, &s.dx[at]);
      }
    for (size_t k = 0; k < x.size(); ++k) x[k] += s.dx[k];
    result.residual = s.residual;
    const bool converged = result.took(in_units(std::move(s.dx)), parameters());
    result.converged = converged && std::abs(q(x)) < 600;
    if (converged || !(result.last_step < 1e6) || !(std::abs(q(x)) < 600)) return result;
  }
  return result;
}

}  // namespace stickslip
