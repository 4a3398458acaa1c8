// The collocation equations of a train on a given mesh, their linearisation, and Newton's method for them.
// Alike on every rank; SNES on PETSC_COMM_SELF.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "stickslip/waves/train.hpp"
#include "stickslip/numerics/periodic_mesh.hpp"

namespace stickslip {

// The fixed part of the equations: the oscillator, and what is given of the train.
struct TrainSetting {
  std::shared_ptr<const Oscillator> oscillator;
  TrainRequest request;
  double N = 0;  // viscosity between neighbours; with it y = (f, z[, s], g) of waves/viscous_train.hpp

  static TrainSetting of(const Scene& scene, const TrainRequest& request) {
    return {std::make_shared<const Oscillator>(scene), request, scene.nu > 0 ? scene.N() : 0};
  }

  // Period and r2, with their derivatives, as functions of the unknown number q: ln T where the speed is
  // given, ln sqrt(V^2 - c^2) where the length is.
  struct At {
    double T, r2, T_q, r2_q, speed, speed_q;
  };
  At at(double q) const;
  int dim() const { return oscillator->dim() + (N > 0); }
  // dy = y'; J (null, or dim x dim row-major) = d(dy)/dy.
  void rhs(const At& at, const double* y, double* dy, double* J) const;
  // The equation whose stages are weighted: that of psi, which is the stiff one.
  int stiff() const { return N > 0 ? dim() - 1 : 0; }
  // d(dy)/dq of that equation at fixed y, where dy = y'.
  double stiff_slope(const At& at, const double* y, const double* dy) const;
  double decay(const At& at) const;  // its rate at B + F_psi = 1
  // The number q of a train.
  double number_of(const Train& train) const;
};

// That of a case which has trains at all; Failure for others.
TrainSetting setting_of(const TrainCase& asked);

// Discrete equations of a train on a given mesh. Unknowns, interval by interval: y at the left node, y at the
// Gauss points; then the number q and, on a branch, the parameter lambda. Equations, interval by interval:
//     Y_j - y_i - h sum_k a_jk T rhs(Y_k) = 0
//     y_{i+1} - (the polynomial through y_i and Y at the right end) = 0
// then f(0) - v = 0 and, on a branch, the arclength. The stage equations of the stiff component are weighted
// with 1/(1 + h T A/r2), which makes their round-off that of psi; with viscosity 1/(1 + h T V^2/(A N)).
class TrainEquations {
 public:
  using Family = std::function<TrainSetting(double)>;  // the setting as a function of lambda

  TrainEquations(TrainSetting setting, std::vector<double> mesh, double q);

  // With lambda as an unknown; its derivatives by differences over 1e-6 lambda_scale to either side.
  TrainEquations(Family family, double lambda_scale, std::vector<double> mesh, double q, double lambda);
  // Its equation: row . (z(0), q, lambda) = right.
  void condition(std::vector<double> row, double right);
  // The same on another mesh, near x.
  TrainEquations on(std::vector<double> mesh, const std::vector<double>& x) const;

  int parameters() const { return family_ ? 2 : 1; }
  size_t block() const { return size_t(d_) * (train_stages + 1); }
  size_t size() const { return n_ * block() + size_t(parameters()); }
  const std::vector<double>& mesh() const { return mesh_; }
  const TrainSetting& setting() const { return setting_; }
  int dim() const { return d_; }
  double q(const std::vector<double>& x) const { return x[n_ * block()]; }
  // Of the rates at y.
  void jacobian(const std::vector<double>& x, const double* y, double* J) const {
    double dy[train_max_dim + 1];
    setting_.rhs(setting_.at(q(x)), y, dy, J);
  }

  // The unknowns of a profile; lambda, if it is one, stays 0. Or those of a solution on another mesh.
  std::vector<double> fill(const Profile& profile, double q) const;
  std::vector<double> fill(const Train& train, double q) const;
  std::vector<double> fill(const TrainEquations& from, const std::vector<double>& x) const;
  void residual(const double* x, double* F);
  double largest_residual(const std::vector<double>& x, std::vector<double>& F);  // which F becomes
  // Keeps the linearisation at x, which the next two use.
  void linearise(const double* x);
  // out = Jacobian x in.
  void multiply(const double* in, double* out) const;
  // dx = Jacobian^-1 rhs. Throws Failure where it is singular.
  void solve(const double* rhs, double* dx) const;
  // The direction in which a solution on a branch may move at x, where row . (z(0), q, lambda) of it is 1.
  std::vector<double> tangent(const std::vector<double>& x, std::vector<double> row);

 private:
  // The setting at lambda. Throws Failure where viscosity comes in or goes, and with it the order of the
  // equation.
  TrainSetting at_lambda(double lambda) const;
  void set_mesh(std::vector<double> mesh, double q);
  // The rows of interval i of out, from those of in and the slopes G at its Gauss points.
  void interval_rows(size_t i, const double* in, const double* G, double scale, double* out) const;

  TrainSetting setting_;
  std::vector<double> mesh_;
  int d_;
  size_t n_;
  std::vector<double> weight_;
  Family family_;
  double lambda_scale_ = 1, right_ = 0, v_lambda_ = 0;
  std::vector<double> row_{0, 0, 1};
  std::vector<double> J_, Gp_;
};

// Solves the equations from x; false where Newton's method does not converge. The size of the last step tells
// how far round-off lets the answer be known.
bool newton(TrainEquations& problem, std::vector<double>& x, double* last_step = nullptr, int max_it = 20);

// The train of a solution; its residual and errors stay 0.
Train pack(const TrainEquations& problem, const std::vector<double>& x);

}  // namespace stickslip
