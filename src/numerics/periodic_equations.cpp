#include "stickslip/numerics/periodic_equations.hpp"

#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/text.hpp"
#include "stickslip/numerics/cyclic.hpp"
#include "stickslip/numerics/dense.hpp"

namespace stickslip {

namespace {

using std::size_t;
constexpr size_t stages = mesh_stages;
const Collocation& gauss() { return Collocation::gauss5(); }

// Deviations may grow so much within a group before the digits that they cost are felt.
constexpr double growth_of_group = 1e3;

// The value at the right end of stage values in columns (component p, column l), beside that at the left end.
template <class T>
T at_end(const Collocation& method, size_t d, size_t columns, const std::vector<T>& R, size_t p, size_t l) {
  T sum = 0;
  for (size_t j = 0; j < stages; ++j) sum += method.end[j + 1] * R[(j * d + p) * columns + l];
  return sum;
}

// out = a b + c, d x d times d x columns; c and out may be the same.
template <class T>
void multiply_add(size_t d, size_t columns, const T* a, const T* b, const T* c, T* out) {
  std::vector<T> sum(c, c + d * columns);
  for (size_t i = 0; i < d; ++i)
    for (size_t k = 0; k < d; ++k)
      for (size_t j = 0; j < columns; ++j) sum[i * columns + j] += a[i * d + k] * b[k * columns + j];
  std::copy(sum.begin(), sum.end(), out);
}

template <class T>
double largest_row(size_t d, const T* a) {
  double norm = 0;
  for (size_t i = 0; i < d; ++i) {
    double sum = 0;
    for (size_t j = 0; j < d; ++j) sum += std::abs(a[i * d + j]);
    norm = std::max(norm, sum);
  }
  return norm;
}

// Intervals in groups within which nothing grows by much, and the product over each.
template <class T>
struct Groups {
  std::vector<size_t> begin;  // first interval of each, and the number of intervals
  std::vector<T> products;
  size_t count() const { return begin.size() - 1; }

  Groups(size_t d, const std::vector<T>& matrices) {
    const size_t dd = d * d, n = matrices.size() / dd;
    const std::vector<T> zero(dd, T(0));
    double growth = 0;
    for (size_t i = 0; i < n; ++i) {
      const T* here = &matrices[i * dd];
      const double norm = std::max(1., largest_row(d, here));
      if (i == 0 || growth * norm > growth_of_group) {
        begin.push_back(i);
        products.insert(products.end(), here, here + dd);
        growth = norm;
      } else {
        T* product = &products[products.size() - dd];
        multiply_add(d, d, here, product, zero.data(), product);
        growth *= norm;
      }
    }
    begin.push_back(n);
  }
};

}  // namespace

template <class T>
void solve_stages(const Collocation& method, int d, int band, double h, const T* J, int columns,
                  std::vector<T>& R) {
  const size_t s = stages, n = size_t(d) * s;
  std::vector<T> M(n * n);
  const auto solved = [&](bool fine) {
    if (!fine) throw Failure("the collocation equations of an interval are singular");
  };
  if (2 * band + 1 >= d) {
    stage_matrix(method, d, h, J, M.data());
    return solved(solve_dense(int(n), M.data(), columns, R.data()));
  }
  // unknown by unknown, the stages together: a band
  for (size_t p = 0; p < size_t(d); ++p) {
    const size_t low = p > size_t(band) ? p - size_t(band) : 0,
                 high = std::min(size_t(d), p + size_t(band) + 1);
    for (size_t i = 0; i < s; ++i)
      for (size_t q = low; q < high; ++q)
        for (size_t j = 0; j < s; ++j)
          M[(p * s + i) * n + q * s + j] =
              (i == j && p == q ? 1. : 0.) - h * method.a[i * s + j] * J[(j * size_t(d) + p) * size_t(d) + q];
  }
  const size_t c = size_t(columns);
  std::vector<T> ordered(n * c);
  for (size_t i = 0; i < s; ++i)
    for (size_t p = 0; p < size_t(d); ++p)
      std::copy_n(&R[(i * size_t(d) + p) * c], c, &ordered[(p * s + i) * c]);
  solved(solve_banded(int(n), int(s) * (band + 1) - 1, M.data(), columns, ordered.data()));
  for (size_t i = 0; i < s; ++i)
    for (size_t p = 0; p < size_t(d); ++p)
      std::copy_n(&ordered[(p * s + i) * c], c, &R[(i * size_t(d) + p) * c]);
}
template void solve_stages(const Collocation&, int, int, double, const double*, int, std::vector<double>&);

template <class T>
std::vector<T> carried(const Collocation& method, int d, int band, double h, const T* J) {
  const size_t n = size_t(d);
  std::vector<T> R(stages * n * n, T(0)), result(n * n);
  for (size_t j = 0; j < stages; ++j)
    for (size_t p = 0; p < n; ++p) R[(j * n + p) * n + p] = 1;
  solve_stages(method, d, band, h, J, d, R);
  for (size_t p = 0; p < n; ++p)
    for (size_t l = 0; l < n; ++l)
      result[p * n + l] = at_end(method, n, n, R, p, l) + (p == l ? method.end[0] : 0.);
  return result;
}
template std::vector<double> carried(const Collocation&, int, int, double, const double*);

template <class T>
Pencil<T> pencil_of(int d, const std::vector<T>& matrices) {
  const Groups<T> groups(size_t(d), matrices);
  const CyclicChain<T> chain(d, groups.count(), groups.products);
  return {chain.first(), chain.last()};
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
  std::vector<double> response;  // of the Gauss points, for all columns
  std::vector<double> phi;       // y at the right node, for y at the left one
  std::vector<double> chain;     // the same for the other columns
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
  const size_t d = size_t(d_);
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
  const size_t d = size_t(d_), b = block(), p = size_t(parameters()), columns = d + p + 1;
  const double period = std::exp(q(x));
  Linear out;
  out.response.resize(n_ * stages * d * columns);
  out.phi.resize(n_ * d * d);
  out.chain.resize(n_ * d * (p + 1));
  std::vector<double> f(stages * d), slope(stages * d), J(stages * d * d), R(stages * d * columns), low(d),
      high(d);
  for (size_t i = 0; i < n_; ++i) {
    const double h = (mesh_[i + 1] - mesh_[i]) * period;
    const double *y = &x[i * b], *Y = y + d, *next = &x[(i + 1 < n_ ? i + 1 : 0) * b];
    for (size_t j = 0; j < stages; ++j) {
      field_->rates(Y + j * d, &f[j * d]);
      field_->jacobian(Y + j * d, &J[j * d * d]);
      if (!family_) continue;
      lower_->rates(Y + j * d, low.data());
      upper_->rates(Y + j * d, high.data());
      for (size_t a = 0; a < d; ++a) slope[j * d + a] = (high[a] - low[a]) / width_;
    }
    for (size_t j = 0; j < stages; ++j)
      for (size_t a = 0; a < d; ++a) {
        double* row = &R[(j * d + a) * columns];
        double rate = 0, by_lambda = 0;
        for (size_t k = 0; k < stages; ++k) {
          rate += gauss().a[j * stages + k] * f[k * d + a];
          by_lambda += gauss().a[j * stages + k] * slope[k * d + a];
        }
        const double right = Y[j * d + a] - y[a] - h * rate;
        out.residual = std::max(out.residual, std::abs(right));
        std::fill(row, row + d, 0.);
        row[a] = 1;
        row[d] = h * rate;
        if (family_) row[d + 1] = h * by_lambda;
        row[d + p] = zero_right ? 0 : -right;
      }
    solve_stages(gauss(), d_, field_->band(), h, J.data(), int(columns), R);
    std::copy(R.begin(), R.end(), out.response.begin() + long(i * R.size()));
    for (size_t a = 0; a < d; ++a) {
      double right = next[a] - gauss().end[0] * y[a];
      for (size_t j = 0; j < stages; ++j) right -= gauss().end[j + 1] * Y[j * d + a];
      out.residual = std::max(out.residual, std::abs(right));
      for (size_t l = 0; l < columns; ++l) {
        const double end = at_end(gauss(), d, columns, R, a, l);
        if (l < d)
          out.phi[(i * d + a) * d + l] = end + (a == l ? gauss().end[0] : 0.);
        else
          out.chain[(i * d + a) * (p + 1) + l - d] = end - (l == d + p && !zero_right ? right : 0.);
      }
    }
  }
  if (!std::isfinite(out.residual)) throw Failure("the equations of the cycle are not finite");
  return out;
}

// Solves what is left: the nodes in groups, y_0 and the parameters with the conditions, then everything
// inside.
std::vector<double> PeriodicEquations::closed(const Linear& system, const std::vector<Condition>& conditions,
                                              const std::vector<double>& rights) const {
  const size_t d = size_t(d_), p = size_t(parameters()), b = block(), columns = d + p + 1, c = p + 1;
  const Groups<double> groups(d, system.phi);
  std::vector<double> chain(groups.count() * d * c);
  for (size_t g = 0; g < groups.count(); ++g) {
    double* sum = &chain[g * d * c];
    for (size_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i)
      multiply_add(d, c, &system.phi[i * d * d], sum, &system.chain[i * d * c], sum);
  }
  const CyclicChain<double> cyclic(d_, groups.count(), groups.products);
  const std::vector<double> right = cyclic.reduce(int(c), chain), closure = cyclic.closure(1.);
  const size_t size = d + p;
  std::vector<double> S(size * size), z(size);
  for (size_t a = 0; a < d; ++a) {
    for (size_t l = 0; l < d; ++l) S[a * size + l] = closure[a * d + l];
    for (size_t l = 0; l < p; ++l) S[a * size + d + l] = -right[a * c + l];
    z[a] = right[a * c + p];
  }
  for (size_t k = 0; k < p; ++k) {
    double* row = &S[(d + k) * size];
    std::copy(conditions[k].y0.begin(), conditions[k].y0.end(), row);
    row[d] = conditions[k].q;
    if (p > 1) row[d + 1] = conditions[k].lambda;
    z[d + k] = rights[k];
  }
  if (!solve_dense(int(size), S.data(), 1, z.data()))
    throw Failure("the equations of the cycle are singular");
  std::vector<double> w(c, 1.), dx(this->size());
  for (size_t l = 0; l < p; ++l) w[l] = dx[n_ * b + l] = z[d + l];
  const std::vector<double> nodes = cyclic.expand(int(c), chain, w.data(), z.data(), 1.);
  std::vector<double> y(d);
  for (size_t g = 0; g < groups.count(); ++g) {
    std::copy_n(&nodes[g * d], d, y.begin());
    for (size_t i = groups.begin[g]; i < groups.begin[g + 1]; ++i) {
      std::copy(y.begin(), y.end(), &dx[i * b]);
      const double* R = &system.response[i * stages * d * columns];
      for (size_t row = 0; row < stages * d; ++row) {
        double sum = R[row * columns + d + p];
        for (size_t l = 0; l < d; ++l) sum += R[row * columns + l] * y[l];
        for (size_t l = 0; l < p; ++l) sum += R[row * columns + d + l] * w[l];
        dx[i * b + d + row] = sum;
      }
      std::vector<double> forced(d);
      for (size_t a = 0; a < d; ++a)
        for (size_t l = 0; l < c; ++l) forced[a] += system.chain[(i * d + a) * c + l] * w[l];
      multiply_add(d, 1, &system.phi[i * d * d], y.data(), forced.data(), y.data());
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
    for (size_t a = 0; a < size_t(d_); ++a) right -= c.y0[a] * x[a];
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
  const size_t d = size_t(d_), b = block();
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
