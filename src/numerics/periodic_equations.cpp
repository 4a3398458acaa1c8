#include "stickslip/numerics/periodic_equations.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "numerics/cyclic.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/dense.hpp"

namespace stickslip {

namespace {

using std::size_t;
constexpr size_t stages = mesh_stages;
const Collocation& gauss() { return Collocation::gauss5(); }

// Deviations may grow so much within a group before the digits that they cost are felt.
constexpr double growth_of_group = 1e3;

// d x columns: the value at the right end of stage values R, beside that at the left end.
template <class T>
Matrix<T> at_end(const Collocation& method, int d, const Matrix<T>& R) {
  Matrix<T> sum = Matrix<T>::Zero(d, R.cols());
  for (size_t j = 0; j < stages; ++j) sum += method.end[j + 1] * R.middleRows(j * d, d);
  return sum;
}

// Intervals in groups within which nothing grows by much, and the product over each.
template <class T>
struct Groups {
  std::vector<size_t> begin;  // first interval of each, and the number of intervals
  std::vector<T> products;
  size_t count() const { return begin.size() - 1; }

  Groups(int d, const std::vector<T>& matrices) {
    const size_t dd = d * d, n = matrices.size() / dd;
    double growth = 0;
    for (size_t i = 0; i < n; ++i) {
      const auto here = as_matrix(&matrices[i * dd], d, d);
      const double norm = std::max(1., here.cwiseAbs().rowwise().sum().maxCoeff());
      if (i == 0 || growth * norm > growth_of_group) {
        begin.push_back(i);
        products.insert(products.end(), here.data(), here.data() + dd);
        growth = norm;
      } else {
        auto product = as_matrix(&products[products.size() - dd], d, d);
        product = here * product;
        growth *= norm;
      }
    }
    begin.push_back(n);
  }
};

// With Y and R as below; Eigen for full blocks, elimination that keeps within the band for wide ones.
void solve_stages(const Collocation& method, int d, int band, double h, const double* J, Matrix<double>& R) {
  const int s = stages, n = d * s;
  Matrix<double> M = Matrix<double>::Zero(n, n);
  bool solved = true;
  if (2 * band + 1 >= d) {
    stage_matrix(method, d, h, J, M.data());
    R = M.partialPivLu().solve(R).eval();
    solved = R.allFinite();
  } else {  // unknown by unknown, the stages together: a band
    Matrix<double> ordered(n, R.cols());
    for (int p = 0; p < d; ++p)
      for (int i = 0; i < s; ++i) {
        ordered.row(p * s + i) = R.row(i * d + p);
        M(p * s + i, p * s + i) = 1;
        for (int q = std::max(0, p - band); q < std::min(d, p + band + 1); ++q)
          for (int j = 0; j < s; ++j)
            M(p * s + i, q * s + j) -= h * method.a[i * s + j] * J[(j * d + p) * d + q];
      }
    solved = solve_banded(n, s * (band + 1) - 1, M.data(), int(R.cols()), ordered.data());
    for (int p = 0; p < d; ++p)
      for (int i = 0; i < s; ++i) R.row(i * d + p) = ordered.row(p * s + i);
  }
  if (!solved) throw Failure("the collocation equations of an interval are singular");
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
  const Groups<T> groups(d, matrices);
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
// ----------------------------------------------------------------------------------------

// What the elimination of each interval's Gauss points leaves. Columns: y at the left node, the parameters,
// the right-hand side.
struct PeriodicEquations::Linear {
  std::vector<Matrix<double>> response;  // of the Gauss points of each interval
  std::vector<double> phi;               // y at the right node, for y at the left one
  Matrix<double> chain;                  // the same for the other columns, interval by interval
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
  width_ = 0;
  const double eps = 1e-6 * scale_;
  const auto beside = [&](double by) {  // at an end of what lambda may be the difference is one-sided
    try {
      const SharedField field = family_(lambda + by);
      width_ += std::abs(by);
      return field;
    } catch (const Error&) {
      return field_;
    }
  };
  lower_ = beside(-eps);
  upper_ = beside(eps);
  if (!(width_ > 0)) throw Failure("the parameter cannot be varied at " + rounded_text(lambda, 12));
  lambda_ = lambda;
}

PeriodicEquations::Linear PeriodicEquations::linear(const std::vector<double>& x, bool zero_right) {
  set_lambda(lambda(x));
  const int d = d_, p = parameters(), s = stages;
  const size_t b = block();
  const double period = std::exp(q(x));
  Linear out;
  out.phi.resize(n_ * d * d);
  out.chain.resize(n_ * d, p + 1);
  const auto a = as_matrix(gauss().a.data(), s, s);
  const auto unit = Matrix<double>::Identity(d, d);
  Matrix<double> f(s, d), low(s, d), high(s, d), rate, by_lambda, off, R(s * d, d + p + 1);
  std::vector<double> J(s * d * d);
  for (size_t i = 0; i < n_; ++i) {
    const double h = (mesh_[i + 1] - mesh_[i]) * period;
    const auto y = as_matrix(&x[i * b], 1, d), next = as_matrix(&x[(i + 1 < n_ ? i + 1 : 0) * b], 1, d);
    const auto Y = as_matrix(&x[i * b + d], s, d);
    for (int j = 0; j < s; ++j) {
      field_->rates(Y.row(j).data(), f.row(j).data());
      field_->jacobian(Y.row(j).data(), &J[j * d * d]);
      if (!family_) continue;
      lower_->rates(Y.row(j).data(), low.row(j).data());
      upper_->rates(Y.row(j).data(), high.row(j).data());
    }
    rate = h * a * f;
    off = Y - y.replicate(s, 1) - rate;
    out.residual = std::max(out.residual, off.cwiseAbs().maxCoeff());
    R.leftCols(d) = unit.replicate(s, 1);
    R.col(d) = rate.reshaped<Eigen::RowMajor>();
    if (family_) {
      by_lambda = h / width_ * a * (high - low);
      R.col(d + 1) = by_lambda.reshaped<Eigen::RowMajor>();
    }
    if (zero_right)
      R.col(d + p).setZero();
    else
      R.col(d + p) = -off.reshaped<Eigen::RowMajor>();
    solve_stages(gauss(), d, field_->band(), h, J.data(), R);
    out.response.push_back(R);
    Matrix<double> right = next - gauss().end[0] * y;
    for (int j = 0; j < s; ++j) right -= gauss().end[j + 1] * Y.row(j);
    out.residual = std::max(out.residual, right.cwiseAbs().maxCoeff());
    Matrix<double> end = at_end(gauss(), d, R);
    if (!zero_right) end.col(d + p) -= right.transpose();
    as_matrix(&out.phi[i * d * d], d, d) = end.leftCols(d) + gauss().end[0] * unit;
    out.chain.middleRows(i * d, d) = end.rightCols(p + 1);
  }
  if (!std::isfinite(out.residual)) throw Failure("the equations of the cycle are not finite");
  return out;
}

// Solves what is left: the nodes in groups, y_0 and the parameters with the conditions, then everything
// inside.
std::vector<double> PeriodicEquations::closed(const Linear& system, const std::vector<Condition>& conditions,
                                              const std::vector<double>& rights) const {
  const int d = d_, p = parameters();
  const size_t b = block();
  const auto phi = [&](size_t i) { return as_matrix(&system.phi[i * d * d], d, d); };
  const auto chain = [&](size_t i) { return system.chain.middleRows(i * d, d); };
  const Groups<double> groups(d, system.phi);
  std::vector<double> reduced(groups.count() * d * (p + 1));
  for (size_t g = 0; g < groups.count(); ++g) {
    auto sum = as_matrix(&reduced[g * d * (p + 1)], d, p + 1);
    for (size_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i) sum = (phi(i) * sum + chain(i)).eval();
  }
  const CyclicChain<double> cyclic(d, groups.count(), groups.products);
  const Matrix<double> right = cyclic.reduce(p + 1, reduced);
  Matrix<double> S = Matrix<double>::Zero(d + p, d + p), z(d + p, 1);
  S.topLeftCorner(d, d) = cyclic.closure(1.);
  S.topRightCorner(d, p) = -right.leftCols(p);
  z.topRows(d) = right.col(p);
  for (int k = 0; k < p; ++k) {
    S.row(d + k).head(d) = as_matrix(conditions[k].y0.data(), 1, d);
    S(d + k, d) = conditions[k].q;
    if (p > 1) S(d + k, d + 1) = conditions[k].lambda;
    z(d + k) = rights[k];
  }
  z = S.partialPivLu().solve(z).eval();
  if (!z.allFinite()) throw Failure("the equations of the cycle are singular");
  Matrix<double> w = Matrix<double>::Ones(p + 1, 1);
  w.topRows(p) = z.bottomRows(p);
  std::vector<double> dx(size());
  std::copy_n(w.data(), p, &dx[n_ * b]);
  const std::vector<double> nodes = cyclic.expand(p + 1, reduced, w.data(), z.data(), 1.);
  for (size_t g = 0; g < groups.count(); ++g) {
    Matrix<double> yw(d + p + 1, 1);  // y at the left node, the parameters, 1
    yw << as_matrix(&nodes[g * d], d, 1), w;
    for (size_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i) {
      std::copy_n(yw.data(), d, &dx[i * b]);
      as_matrix(&dx[i * b + d], stages * d, 1) = system.response[i] * yw;
      yw.topRows(d) = (phi(i) * yw.topRows(d) + chain(i) * w).eval();
    }
  }
  return dx;
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
  result.dx = closed(system, conditions, rights);
  return result;
}

std::vector<double> PeriodicEquations::tangent(const std::vector<double>& x,
                                               const std::vector<Condition>& rows) {
  std::vector<double> rights(rows.size());
  rights.back() = 1;
  return closed(linear(x, true), rows, rights);
}

// Converged by the step: the residual cannot fall below the round-off of stiff intervals. In a front of width
// w (in phase) y cannot be known better than 1e-16/w, so that there the numbers sought decide.
PeriodicEquations::Newton PeriodicEquations::newton(std::vector<double>& x,
                                                    const std::vector<Condition>& conditions, int most) {
  Newton result;
  double last = -1;
  const size_t d = d_, b = block();
  for (int it = 0; it < most; ++it) {
    beat("Newton steps");
    Step s = step(x, conditions);
    const double period = std::exp(q(x));
    for (size_t i = 0; i < n_; ++i)
      for (size_t j = 0; j < stages; ++j) {
        const size_t at = i * b + (j + 1) * d;
        field_->safeguard_step(&x[at], gauss().a[j * (stages + 1)] * (mesh_[i + 1] - mesh_[i]) * period,
                               &s.dx[at]);
      }
    double size = 0, numbers = 0;
    for (size_t k = 0; k < x.size(); ++k) {
      x[k] += s.dx[k];
      size = std::max(size, std::abs(s.dx[k]));
      if (k >= n_ * block()) numbers = std::max(numbers, std::abs(s.dx[k]));
    }
    result.residual = s.residual;
    result.last_step = size;
    result.q_step = std::abs(s.dx[n_ * block()]);
    if (!(size < 1e6) || !(std::abs(q(x)) < 600)) return result;
    const bool stagnant = last >= 0 && size > .2 * last;
    if (size < 1e-12 || (stagnant && size < 1e-8) || (stagnant && size < 1e-3 && numbers < 1e-11)) {
      result.converged = true;
      return result;
    }
    last = size;
  }
  return result;
}

}  // namespace stickslip
