#include "waves/train_equations.hpp"

#include <algorithm>

#include "numerics/beside.hpp"
#include "numerics/condensed_period.hpp"
#include "stickslip/base/error.hpp"
#include "waves/viscous_train.hpp"

namespace stickslip {

namespace {

constexpr int stages = train_stages, max_dim = train_max_dim + 1;  // g with viscosity
const Collocation& method() { return Collocation::gauss5(); }

}  // namespace

TrainSetting::At TrainSetting::at(double q) const {
  const double c2 = oscillator->c2();
  if (request.speed) {
    const double V = std::abs(*request.speed), c = std::sqrt(c2), T = std::exp(q);
    return {T, (V - c) * (V + c) / (V * V), T, 0, V, 0};
  }
  const double Y2 = std::exp(2 * q), V = std::sqrt(c2 + Y2), r2 = Y2 / (c2 + Y2), rest = c2 / (c2 + Y2);
  const double T = *request.length / (double(request.pulses) * V);
  return {T, r2, -T * r2, 2 * r2 * rest, V, V * r2};
}

void TrainSetting::rhs(const At& at, const double* y, double* dy, double* J) const {
  if (N > 0)
    viscous_rhs(*oscillator, N, at.speed, at.r2, y, dy, J);
  else
    oscillator->rhs(at.r2, y, dy, J);
}

double TrainSetting::decay(const At& at) const {
  return N > 0 ? at.speed * at.speed / (N * oscillator->A()) : oscillator->A() / at.r2;
}

double TrainSetting::stiff_slope(const At& at, const double* y, const double* dy) const {
  const int k = stiff();
  return N > 0 ? 2 * at.speed_q / at.speed * dy[k] + decay(at) * at.r2_q * y[k] : -at.r2_q / at.r2 * dy[k];
}

double TrainSetting::number_of(const Train& train) const {
  const double V = std::abs(train.speed), c = std::sqrt(oscillator->c2());
  return request.speed ? std::log(train.period) : .5 * std::log((V - c) * (V + c));
}

TrainSetting setting_of(const TrainCase& asked) {
  const TrainRequest& request = asked.request;
  if (request.speed && !(std::abs(*request.speed) > asked.scene.c)) throw Failure("V comes down to c");
  if (request.length && !(*request.length > 0)) throw Failure("the length vanishes");
  return TrainSetting::of(asked.scene, request);
}

TrainEquations::TrainEquations(TrainSetting setting, std::vector<double> mesh, double q)
    : setting_(std::move(setting)), d_(setting_.dim()) {
  set_mesh(std::move(mesh), q);
}

TrainEquations::TrainEquations(Family family, double lambda_scale, std::vector<double> mesh, double q,
                               double lambda)
    : TrainEquations(family(lambda), std::move(mesh), q) {
  family_ = std::move(family);
  lambda_scale_ = lambda_scale;
  right_ = lambda;
}

void TrainEquations::set_mesh(std::vector<double> mesh, double q) {
  mesh_ = std::move(mesh);
  n_ = mesh_.size() - 1;
  const TrainSetting::At at = setting_.at(q);
  weight_.clear();
  for (size_t i = 0; i < n_; ++i)
    weight_.push_back(1 / (1 + (mesh_[i + 1] - mesh_[i]) * at.T * setting_.decay(at)));
}

TrainEquations TrainEquations::on(std::vector<double> mesh, const std::vector<double>& x) const {
  TrainEquations other(*this);
  if (family_) other.setting_ = at_lambda(x.back());
  other.set_mesh(std::move(mesh), q(x));
  return other;
}

TrainSetting TrainEquations::at_lambda(double lambda) const {
  TrainSetting setting = family_(lambda);
  if (setting.dim() != d_) throw Failure("model_nu comes down to 0");
  return setting;
}

void TrainEquations::condition(std::vector<double> row, double right) {
  row_ = std::move(row);
  right_ = right;
}

std::vector<double> TrainEquations::fill(const Profile& profile, double q) const {
  const size_t d = size_t(d_);
  std::vector<double> x(size());
  double y[max_dim + 1];
  for (size_t i = 0; i < n_; ++i)
    for (size_t j = 0; j <= stages; ++j) {
      profile(mesh_[i] + (mesh_[i + 1] - mesh_[i]) * method().basis.points()[j], y);
      std::copy(y, y + d, x.begin() + long(i * block() + j * d));
    }
  x[n_ * block()] = q;
  return x;
}

std::vector<double> TrainEquations::fill(const Train& train, double q) const {
  return fill(
      [&](double phase, double* y) {
        if (setting_.N > 0)
          evaluate(*train.method, train.mesh, train.viscous_values.data(), d_, phase, y);
        else
          train.at(phase, y);
      },
      q);
}

std::vector<double> TrainEquations::fill(const TrainEquations& from, const std::vector<double>& x) const {
  std::vector<double> y =
      fill([&](double phase, double* at) { evaluate(method(), from.mesh(), x.data(), d_, phase, at); },
           x[x.size() - size_t(from.parameters())]);
  if (family_) y.back() = x.back();
  return y;
}

void TrainEquations::interval_rows(size_t i, const double* in, const double* G, double scale,
                                   double* out) const {
  const size_t b = block(), d = size_t(d_);
  const double *y = in + i * b, *Y = y + d, *next = in + (i + 1 < n_ ? i + 1 : 0) * b;
  const double h = (mesh_[i + 1] - mesh_[i]) * scale;
  const size_t stiff = size_t(setting_.stiff());
  for (size_t j = 0; j < stages; ++j)
    for (size_t a = 0; a < d; ++a) {
      double r = 0;
      for (size_t k = 0; k < stages; ++k) r += method().a[j * stages + k] * G[k * d + a];
      out[i * b + j * d + a] = (Y[j * d + a] - y[a] - h * r) * (a == stiff ? weight_[i] : 1);
    }
  for (size_t a = 0; a < d; ++a) {
    double r = next[a] - method().end[0] * y[a];
    for (size_t j = 0; j < stages; ++j) r -= method().end[j + 1] * Y[j * d + a];
    out[i * b + stages * d + a] = r;
  }
}

void TrainEquations::residual(const double* x, double* F) {
  const size_t b = block(), d = size_t(d_);
  const double q = x[n_ * b];
  if (family_) setting_ = at_lambda(x[n_ * b + 1]);
  const TrainSetting::At at = setting_.at(q);
  for (size_t i = 0; i < n_; ++i) {
    const double* Y = x + i * b + d;
    double G[stages * max_dim];
    for (size_t j = 0; j < stages; ++j) setting_.rhs(at, Y + j * d, G + j * d, nullptr);
    interval_rows(i, x, G, at.T, F);
  }
  F[n_ * b] = x[0] - setting_.oscillator->v();
  if (family_) F[n_ * b + 1] = row_[0] * x[1] + row_[1] * q + row_[2] * x[n_ * b + 1] - right_;
}

double TrainEquations::largest_residual(const std::vector<double>& x, std::vector<double>& F) {
  residual(x.data(), F.data());
  return std::abs(
      *std::max_element(F.begin(), F.end(), [](double a, double b) { return std::abs(a) < std::abs(b); }));
}

void TrainEquations::linearise(const double* x) {
  const size_t b = block(), d = size_t(d_), p = size_t(parameters());
  const double q = x[n_ * b];
  Beside<TrainSetting> sides{};
  v_lambda_ = 0;
  if (family_) {
    const double lambda = x[n_ * b + 1];
    setting_ = at_lambda(lambda);
    sides = beside_of<UsageError>([&](double at) { return at_lambda(at); }, lambda, 1e-6 * lambda_scale_,
                                  setting_);
    v_lambda_ = (sides.above.oscillator->v() - sides.below.oscillator->v()) / sides.width;
  }
  const TrainSetting::At at = setting_.at(q);
  const size_t stiff = size_t(setting_.stiff());
  J_.resize(n_ * stages * d * d);
  Gp_.resize(n_ * stages * d * p);
  for (size_t i = 0; i < n_; ++i)
    for (size_t j = 0; j < stages; ++j) {
      const double* Y = x + i * b + d + j * d;
      double g[max_dim], J[max_dim * max_dim];
      setting_.rhs(at, Y, g, J);
      double* to = &J_[(i * stages + j) * d * d];
      for (size_t a = 0; a < d * d; ++a) to[a] = at.T * J[a];
      double* slope = &Gp_[(i * stages + j) * d * p];
      for (size_t a = 0; a < d; ++a) slope[a * p] = at.T_q * g[a];
      slope[stiff * p] += at.T * setting_.stiff_slope(at, Y, g);
      if (family_) {
        double low[max_dim], high[max_dim];
        const TrainSetting::At l = sides.below.at(q), u = sides.above.at(q);
        sides.below.rhs(l, Y, low, nullptr);
        sides.above.rhs(u, Y, high, nullptr);
        for (size_t a = 0; a < d; ++a) slope[a * p + 1] = (u.T * high[a] - l.T * low[a]) / sides.width;
      }
    }
}

void TrainEquations::multiply(const double* in, double* out) const {
  const size_t b = block(), d = size_t(d_), p = size_t(parameters());
  const double* dp = in + n_ * b;
  for (size_t i = 0; i < n_; ++i) {
    const double* Y = in + i * b + d;
    double G[stages * max_dim];
    for (size_t j = 0; j < stages; ++j)
      for (size_t a = 0; a < d; ++a) {
        double sum = 0;
        for (size_t k = 0; k < d; ++k) sum += J_[((i * stages + j) * d + a) * d + k] * Y[j * d + k];
        for (size_t k = 0; k < p; ++k) sum += Gp_[((i * stages + j) * d + a) * p + k] * dp[k];
        G[j * d + a] = sum;
      }
    interval_rows(i, in, G, 1, out);
  }
  out[n_ * b] = in[0] - (family_ ? v_lambda_ * dp[1] : 0);
  if (family_) out[n_ * b + 1] = row_[0] * in[1] + row_[1] * dp[0] + row_[2] * dp[1];
}

void TrainEquations::solve(const double* rhs, double* dx) const {
  const int d = d_, p = parameters();
  const auto a = as_matrix(method().a.data(), stages, stages);
  CondensedPeriod period(d, p);
  Matrix<double> R(stages * d, d + p + 1);
  R.leftCols(d) = Matrix<double>::Identity(d, d).replicate(stages, 1);
  for (size_t i = 0; i < n_; ++i) {
    const double h = mesh_[i + 1] - mesh_[i];
    const double* right = rhs + i * block();
    for (int l = 0; l < p; ++l) {  // the slopes by a parameter, stage by stage
      const Eigen::Map<const Matrix<double>, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>> slope(
          &Gp_[i * stages * d * p + l], stages, d, {d * p, p});
      R.col(d + l) = (h * a * slope).reshaped<Eigen::RowMajor>();
    }
    R.col(d + p) = as_matrix(right, stages * d, 1);
    for (int j = 0; j < stages; ++j) R(j * d + setting_.stiff(), d + p) /= weight_[i];
    period.add(h, d - 1, &J_[i * stages * d * d], R, as_matrix(right + stages * d, d, 1));
  }
  // f_0 [- v_lambda dlambda] = rhs;  row
  Matrix<double> rows = Matrix<double>::Zero(p, d + p);
  rows(0, 0) = 1;
  if (family_) {
    rows(0, d + 1) = -v_lambda_;
    rows(1, 1) = row_[0];
    rows.row(1).tail(2) << row_[1], row_[2];
  }
  const std::vector<double> x = period.solve(rows, {rhs + n_ * block(), rhs + size()});
  std::copy(x.begin(), x.end(), dx);
}

std::vector<double> TrainEquations::tangent(const std::vector<double>& x, std::vector<double> row) {
  condition(std::move(row), 0);
  linearise(x.data());
  std::vector<double> rhs(x.size()), t(x.size());
  rhs.back() = 1;
  solve(rhs.data(), t.data());
  return t;
}

}  // namespace stickslip
