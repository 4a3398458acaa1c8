#include "stickslip/wave.hpp"

#include <petscsnes.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "stickslip/cyclic.hpp"
#include "stickslip/error.hpp"
#include "stickslip/handle.hpp"

namespace stickslip {

namespace {

constexpr int stages = 5, max_dim = 3;

std::string number(double x, int digits = 8) {
  char text[40];
  std::snprintf(text, sizeof text, "%.*g", digits, x);
  return text;
}

// The fixed part of a problem: the oscillator, and what is given of the train.
struct Setting {
  std::shared_ptr<const Oscillator> oscillator;
  TrainRequest request;

  // Period and r2, with their derivatives, as functions of the unknown number q: ln T where the speed is given,
  // ln sqrt(V^2 - c^2) where the length is.
  struct At {
    double T, r2, T_q, r2_q, speed;
  };
  At at(double q) const {
    const double c2 = oscillator->c2();
    if (request.speed) {
      const double V = std::abs(*request.speed), c = std::sqrt(c2), T = std::exp(q);
      return {T, (V - c) * (V + c) / (V * V), T, 0, V};
    }
    const double Y2 = std::exp(2 * q), V = std::sqrt(c2 + Y2), r2 = Y2 / (c2 + Y2), rest = c2 / (c2 + Y2);
    const double T = *request.length / (double(request.pulses) * V);
    return {T, r2, -T * r2, 2 * r2 * rest, V};
  }
};

Setting setting_of(const Scene& scene, const TrainRequest& request) {
  return {std::make_shared<const Oscillator>(scene), request};
}

// Discrete equations of a train on a given mesh. Unknowns, interval by interval: y at the left node, y at the
// Gauss points; then the number q and, on a branch, the parameter lambda. Equations, interval by interval:
//     Y_j - y_i - h sum_k a_jk T rhs(Y_k) = 0
//     y_{i+1} - (the polynomial through y_i and Y at the right end) = 0
// then f(0) - v = 0 and, on a branch, the arclength. The first component's stage equations are weighted with
// 1/(1 + h T A/r2), which makes their round-off that of psi.
class Problem {
 public:
  using Family = std::function<Setting(double)>;  // the setting as a function of lambda

  Problem(Setting setting, std::vector<double> mesh, double q_scale)
      : setting_(std::move(setting)), mesh_(std::move(mesh)), d_(setting_.oscillator->dim()), n_(mesh_.size() - 1) {
    const Setting::At at = setting_.at(q_scale);
    for (size_t i = 0; i < n_; ++i)
      weight_.push_back(1 / (1 + (mesh_[i + 1] - mesh_[i]) * at.T * setting_.oscillator->A() / at.r2));
    train_dense().weights(1, end_);
  }

  // Adds lambda as an unknown, with row . (z(0), q, lambda) = right as its equation.
  void extend(Family family, double lambda_scale, std::vector<double> row, double right) {
    family_ = std::move(family);
    lambda_scale_ = lambda_scale;
    row_ = std::move(row);
    right_ = right;
  }

  int parameters() const { return family_ ? 2 : 1; }
  size_t block() const { return size_t(d_) * (stages + 1); }
  size_t size() const { return n_ * block() + size_t(parameters()); }
  const std::vector<double>& mesh() const { return mesh_; }
  const Setting& setting() const { return setting_; }
  int dim() const { return d_; }

  void residual(const double* x, double* F) {
    const size_t b = block(), d = size_t(d_);
    const double q = x[n_ * b];
    if (family_) setting_ = family_(x[n_ * b + 1]);
    const Oscillator& o = *setting_.oscillator;
    const Setting::At at = setting_.at(q);
    for (size_t i = 0; i < n_; ++i) {
      const double *y = x + i * b, *Y = y + d, *next = x + (i + 1 < n_ ? i + 1 : 0) * b;
      const double hT = (mesh_[i + 1] - mesh_[i]) * at.T;
      double G[stages * max_dim];
      for (size_t j = 0; j < stages; ++j) o.rhs(at.r2, Y + j * d, G + j * d, nullptr);
      for (size_t j = 0; j < stages; ++j)
        for (size_t a = 0; a < d; ++a) {
          double r = 0;
          for (size_t k = 0; k < stages; ++k) r += train_tableau().a[j * stages + k] * G[k * d + a];
          F[i * b + j * d + a] = (Y[j * d + a] - y[a] - hT * r) * (a == 0 ? weight_[i] : 1);
        }
      for (size_t a = 0; a < d; ++a) {
        double r = next[a] - end_[0] * y[a];
        for (size_t j = 0; j < stages; ++j) r -= end_[j + 1] * Y[j * d + a];
        F[i * b + stages * d + a] = r;
      }
    }
    F[n_ * b] = x[0] - o.v();
    if (family_) F[n_ * b + 1] = row_[0] * x[1] + row_[1] * q + row_[2] * x[n_ * b + 1] - right_;
  }

  // Keeps the linearisation at x.
  void linearise(const double* x) {
    const size_t b = block(), d = size_t(d_), p = size_t(parameters());
    const double q = x[n_ * b];
    Setting lower, upper;
    double eps = 0;
    v_lambda_ = 0;
    if (family_) {
      const double lambda = x[n_ * b + 1];
      setting_ = family_(lambda);
      eps = 1e-6 * lambda_scale_;
      lower = family_(lambda - eps);
      upper = family_(lambda + eps);
      v_lambda_ = (upper.oscillator->v() - lower.oscillator->v()) / (2 * eps);
    }
    const Oscillator& o = *setting_.oscillator;
    const Setting::At at = setting_.at(q);
    J_.resize(n_ * stages * d * d);
    Gp_.resize(n_ * stages * d * p);
    for (size_t i = 0; i < n_; ++i)
      for (size_t j = 0; j < stages; ++j) {
        const double* Y = x + i * b + d + j * d;
        double g[max_dim], J[max_dim * max_dim];
        o.rhs(at.r2, Y, g, J);
        double* to = &J_[(i * stages + j) * d * d];
        for (size_t a = 0; a < d * d; ++a) to[a] = at.T * J[a];
        double* slope = &Gp_[(i * stages + j) * d * p];
        for (size_t a = 0; a < d; ++a)
          slope[a * p] = at.T_q * g[a] - (a == 0 ? at.T * at.r2_q / at.r2 * g[0] : 0.);
        if (family_) {
          double low[max_dim], high[max_dim];
          const Setting::At l = lower.at(q), u = upper.at(q);
          lower.oscillator->rhs(l.r2, Y, low, nullptr);
          upper.oscillator->rhs(u.r2, Y, high, nullptr);
          for (size_t a = 0; a < d; ++a) slope[a * p + 1] = (u.T * high[a] - l.T * low[a]) / (2 * eps);
        }
      }
  }

  // out = Jacobian x in.
  void multiply(const double* in, double* out) const {
    const size_t b = block(), d = size_t(d_), p = size_t(parameters());
    const double* dp = in + n_ * b;
    for (size_t i = 0; i < n_; ++i) {
      const double *y = in + i * b, *Y = y + d, *next = in + (i + 1 < n_ ? i + 1 : 0) * b, h = mesh_[i + 1] - mesh_[i];
      double G[stages * max_dim];
      for (size_t j = 0; j < stages; ++j)
        for (size_t a = 0; a < d; ++a) {
          double sum = 0;
          for (size_t k = 0; k < d; ++k) sum += J_[((i * stages + j) * d + a) * d + k] * Y[j * d + k];
          for (size_t k = 0; k < p; ++k) sum += Gp_[((i * stages + j) * d + a) * p + k] * dp[k];
          G[j * d + a] = sum;
        }
      for (size_t j = 0; j < stages; ++j)
        for (size_t a = 0; a < d; ++a) {
          double r = 0;
          for (size_t k = 0; k < stages; ++k) r += train_tableau().a[j * stages + k] * G[k * d + a];
          out[i * b + j * d + a] = (Y[j * d + a] - y[a] - h * r) * (a == 0 ? weight_[i] : 1);
        }
      for (size_t a = 0; a < d; ++a) {
        double r = next[a] - end_[0] * y[a];
        for (size_t j = 0; j < stages; ++j) r -= end_[j + 1] * Y[j * d + a];
        out[i * b + stages * d + a] = r;
      }
    }
    out[n_ * b] = in[0] - (family_ ? v_lambda_ * dp[1] : 0);
    if (family_) out[n_ * b + 1] = row_[0] * in[1] + row_[1] * dp[0] + row_[2] * dp[1];
  }

  // dx = Jacobian^-1 rhs: the Gauss points of each interval first, then the chain of nodes, then what closes it.
  void solve(const double* rhs, double* dx) const {
    const size_t b = block(), d = size_t(d_), p = size_t(parameters()), md = stages * d;
    const size_t columns = d + p + 1;
    std::vector<double> response(n_ * md * columns), phi(n_ * d * d), chain(n_ * d * (p + 1));
    std::vector<double> M(md * md);
    for (size_t i = 0; i < n_; ++i) {
      const double h = mesh_[i + 1] - mesh_[i];
      double* R = &response[i * md * columns];
      for (size_t j = 0; j < stages; ++j)
        for (size_t a = 0; a < d; ++a) {
          const size_t row = j * d + a;
          for (size_t k = 0; k < stages; ++k)
            for (size_t l = 0; l < d; ++l)
              M[row * md + k * d + l] = (j == k && a == l ? 1. : 0.) -
                                        h * train_tableau().a[j * stages + k] * J_[((i * stages + k) * d + a) * d + l];
          for (size_t l = 0; l < d; ++l) R[row * columns + l] = a == l ? 1. : 0.;
          for (size_t l = 0; l < p; ++l) {
            double sum = 0;
            for (size_t k = 0; k < stages; ++k)
              sum += train_tableau().a[j * stages + k] * Gp_[((i * stages + k) * d + a) * p + l];
            R[row * columns + d + l] = h * sum;
          }
          R[row * columns + d + p] = rhs[i * b + row] / (a == 0 ? weight_[i] : 1);
        }
      if (!solve_dense(int(md), M.data(), int(columns), R))
        throw Failure("the collocation equations of an interval are singular");
      for (size_t a = 0; a < d; ++a) {
        for (size_t l = 0; l < columns; ++l) {
          double sum = 0;
          for (size_t j = 0; j < stages; ++j) sum += end_[j + 1] * R[(j * d + a) * columns + l];
          if (l < d) {
            phi[(i * d + a) * d + l] = sum + (a == l ? end_[0] : 0.);
          } else {
            chain[(i * d + a) * (p + 1) + l - d] = sum + (l == d + p ? rhs[i * b + md + a] : 0.);
          }
        }
      }
    }
    const CyclicChain<double> cyclic(d_, n_, phi);
    const std::vector<double> right = cyclic.reduce(int(p) + 1, chain);
    const std::vector<double> closure = cyclic.closure(1.);
    // closure y_0 - right_p dp = right_r;  f_0 [- v_lambda dlambda] = rhs;  row
    const size_t size = d + p;
    std::vector<double> S(size * size), z(size);
    for (size_t a = 0; a < d; ++a) {
      for (size_t l = 0; l < d; ++l) S[a * size + l] = closure[a * d + l];
      for (size_t l = 0; l < p; ++l) S[a * size + d + l] = -right[a * (p + 1) + l];
      z[a] = right[a * (p + 1) + p];
    }
    S[d * size] = 1;
    z[d] = rhs[n_ * b];
    if (family_) {
      S[d * size + d + 1] = -v_lambda_;
      S[(d + 1) * size + 1] = row_[0];
      S[(d + 1) * size + d] = row_[1];
      S[(d + 1) * size + d + 1] = row_[2];
      z[d + 1] = rhs[n_ * b + 1];
    }
    if (!solve_dense(int(size), S.data(), 1, z.data())) throw Failure("the equations of the train are singular");
    std::vector<double> w(p + 1, 1.);
    for (size_t l = 0; l < p; ++l) w[l] = z[d + l];
    const std::vector<double> y = cyclic.expand(int(p) + 1, chain, w.data(), z.data(), 1.);
    for (size_t i = 0; i < n_; ++i) {
      for (size_t a = 0; a < d; ++a) dx[i * b + a] = y[i * d + a];
      const double* R = &response[i * md * columns];
      for (size_t row = 0; row < md; ++row) {
        double sum = R[row * columns + d + p];
        for (size_t l = 0; l < d; ++l) sum += R[row * columns + l] * y[i * d + l];
        for (size_t l = 0; l < p; ++l) sum += R[row * columns + d + l] * w[l];
        dx[i * b + d + row] = sum;
      }
    }
    for (size_t l = 0; l < p; ++l) dx[n_ * b + l] = w[l];
  }

 private:
  Setting setting_;
  std::vector<double> mesh_;
  int d_;
  size_t n_;
  std::vector<double> weight_;
  double end_[stages + 1];
  Family family_;
  double lambda_scale_ = 1, right_ = 0, v_lambda_ = 0;
  std::vector<double> row_;
  std::vector<double> J_, Gp_;
};

// ---- Newton's method by SNES --------------------------------------------------------------------------------------

struct Steps {
  PetscInt numbers = 1;  // q, or q and lambda: the last entries
  double last = -1;
};

PetscErrorCode form_function(SNES, Vec x, Vec f, void* context) {
  return guarded([&] {
    const PetscScalar* in;
    PetscScalar* out;
    SS_TRY(VecGetArrayRead(x, &in));
    SS_TRY(VecGetArray(f, &out));
    static_cast<Problem*>(context)->residual(in, out);
    SS_TRY(VecRestoreArray(f, &out));
    SS_TRY(VecRestoreArrayRead(x, &in));
  });
}

PetscErrorCode form_jacobian(SNES, Vec x, Mat, Mat, void* context) {
  return guarded([&] {
    const PetscScalar* in;
    SS_TRY(VecGetArrayRead(x, &in));
    static_cast<Problem*>(context)->linearise(in);
    SS_TRY(VecRestoreArrayRead(x, &in));
  });
}

PetscErrorCode shell_multiply(Mat J, Vec x, Vec y) {
  return guarded([&] {
    void* context;
    SS_TRY(MatShellGetContext(J, &context));
    const PetscScalar* in;
    PetscScalar* out;
    SS_TRY(VecGetArrayRead(x, &in));
    SS_TRY(VecGetArray(y, &out));
    static_cast<Problem*>(context)->multiply(in, out);
    SS_TRY(VecRestoreArray(y, &out));
    SS_TRY(VecRestoreArrayRead(x, &in));
  });
}

PetscErrorCode shell_solve(PC pc, Vec x, Vec y) {
  return guarded([&] {
    void* context;
    SS_TRY(PCShellGetContext(pc, &context));
    const PetscScalar* in;
    PetscScalar* out;
    SS_TRY(VecGetArrayRead(x, &in));
    SS_TRY(VecGetArray(y, &out));
    static_cast<Problem*>(context)->solve(in, out);
    SS_TRY(VecRestoreArray(y, &out));
    SS_TRY(VecRestoreArrayRead(x, &in));
  });
}

// Converged by the step, not the residual, which cannot fall below the round-off of stiff intervals. In a front of
// width w (in phase) psi itself cannot be known better than 1e-16/w, so that there the numbers sought decide.
PetscErrorCode converged(SNES snes, PetscInt it, PetscReal, PetscReal, PetscReal fnorm, SNESConvergedReason* reason,
                         void* context) {
  return guarded([&] {
    auto* steps = static_cast<Steps*>(context);
    *reason = SNES_CONVERGED_ITERATING;
    if (!std::isfinite(fnorm)) {
      *reason = SNES_DIVERGED_FNORM_NAN;
      return;
    }
    if (it == 0) return;
    Vec dx;
    PetscReal step, number_step = 0;
    PetscInt size;
    const PetscScalar* values;
    SS_TRY(SNESGetSolutionUpdate(snes, &dx));
    SS_TRY(VecNorm(dx, NORM_INFINITY, &step));
    SS_TRY(VecGetSize(dx, &size));
    SS_TRY(VecGetArrayRead(dx, &values));
    for (PetscInt i = size - steps->numbers; i < size; ++i) number_step = std::max(number_step, std::abs(values[i]));
    SS_TRY(VecRestoreArrayRead(dx, &values));
    const bool stagnant = steps->last >= 0 && step > .2 * steps->last;
    if (step < 1e-12 || (stagnant && step < 1e-8) || (stagnant && step < 1e-3 && number_step < 1e-11)) {
      *reason = SNES_CONVERGED_SNORM_RELATIVE;
    } else if (step > 1e6) {
      *reason = SNES_DIVERGED_DTOL;
    }
    steps->last = step;
  });
}

// Solves the problem from x; false where Newton's method does not converge. The size of the last step tells how far
// round-off lets the answer be known.
bool newton(Problem& problem, std::vector<double>& x, double* last_step = nullptr, int max_it = 20) {
  const PetscInt n = PetscInt(problem.size());
  SnesHandle snes;
  VecHandle u, f;
  MatHandle J;
  Steps steps{problem.parameters()};
  SS_TRY(VecCreateSeqWithArray(PETSC_COMM_SELF, 1, n, x.data(), u.out()));
  SS_TRY(VecDuplicate(u, f.out()));
  SS_TRY(MatCreateShell(PETSC_COMM_SELF, n, n, n, n, &problem, J.out()));
  SS_TRY(MatShellSetOperation(J, MATOP_MULT, reinterpret_cast<void (*)()>(shell_multiply)));
  SS_TRY(SNESCreate(PETSC_COMM_SELF, snes.out()));
  SS_TRY(SNESSetFunction(snes, f, form_function, &problem));
  SS_TRY(SNESSetJacobian(snes, J, J, form_jacobian, &problem));
  SS_TRY(SNESSetConvergenceTest(snes, converged, &steps, nullptr));
  SS_TRY(SNESSetTolerances(snes, PETSC_DEFAULT, PETSC_DEFAULT, PETSC_DEFAULT, max_it, PETSC_DEFAULT));
  SNESLineSearch search;
  SS_TRY(SNESGetLineSearch(snes, &search));
  SS_TRY(SNESLineSearchSetType(search, SNESLINESEARCHBASIC));
  KSP ksp;
  PC pc;
  SS_TRY(SNESGetKSP(snes, &ksp));
  SS_TRY(KSPSetType(ksp, KSPPREONLY));
  SS_TRY(KSPGetPC(ksp, &pc));
  SS_TRY(PCSetType(pc, PCSHELL));
  SS_TRY(PCShellSetContext(pc, &problem));
  SS_TRY(PCShellSetApply(pc, shell_solve));
  if (problem.setting().request.library_options) SS_TRY(SNESSetFromOptions(snes));
  SS_TRY(SNESSolve(snes, nullptr, u));
  SNESConvergedReason reason;
  SS_TRY(SNESGetConvergedReason(snes, &reason));
  if (last_step) *last_step = steps.last;
  return reason > 0;
}

// ---- meshes and profiles ------------------------------------------------------------------------------------------

// y at a phase from unknowns laid out as in Problem (block of (stages + 1) points an interval).
void evaluate(const std::vector<double>& mesh, const double* x, int d, double phase, double* y) {
  phase -= std::floor(phase);
  const size_t n = mesh.size() - 1;
  const size_t i = std::min(size_t(std::upper_bound(mesh.begin(), mesh.end(), phase) - mesh.begin() - 1), n - 1);
  double w[stages + 1];
  train_dense().weights((phase - mesh[i]) / (mesh[i + 1] - mesh[i]), w);
  const double* points = x + i * size_t(d) * (stages + 1);
  for (int a = 0; a < d; ++a) {
    y[a] = 0;
    for (int j = 0; j <= stages; ++j) y[a] += w[j] * points[j * d + a];
  }
}

// The size of the derivative of order stages + 1 on each interval, each component by its own range: from the jumps
// of the derivative of order `stages` between neighbours.
std::vector<double> roughness(const std::vector<double>& mesh, const double* x, int d) {
  const size_t n = mesh.size() - 1, b = size_t(d) * (stages + 1);
  std::vector<double> low(size_t(d), 1e300), high(size_t(d), -1e300), top(n * size_t(d));
  std::vector<double> coefficient(stages + 1);  // divided difference
  const std::vector<double>& points = train_dense().points();
  for (size_t j = 0; j <= stages; ++j) {
    coefficient[j] = 1;
    for (size_t k = 0; k <= stages; ++k)
      if (k != j) coefficient[j] /= points[j] - points[k];
  }
  for (size_t i = 0; i < n; ++i)
    for (size_t a = 0; a < size_t(d); ++a) {
      double sum = 0;
      for (size_t j = 0; j <= stages; ++j) {
        const double value = x[i * b + j * size_t(d) + a];
        low[a] = std::min(low[a], value);
        high[a] = std::max(high[a], value);
        sum += coefficient[j] * value;
      }
      top[i * size_t(d) + a] = sum / std::pow(mesh[i + 1] - mesh[i], stages);
    }
  std::vector<double> jump(n), result(n);
  for (size_t i = 0; i < n; ++i) {
    const size_t next = i + 1 < n ? i + 1 : 0;
    const double h = (mesh[i + 1] - mesh[i] + mesh[next + 1] - mesh[next]) / 2;
    for (size_t a = 0; a < size_t(d); ++a)
      jump[i] = std::max(jump[i], std::abs(top[next * size_t(d) + a] - top[i * size_t(d) + a]) / h /
                                      std::max(high[a] - low[a], 1e-12));
  }
  for (size_t i = 0; i < n; ++i) result[i] = std::max(jump[i], jump[i > 0 ? i - 1 : n - 1]);
  return result;
}

// Mesh of `intervals` intervals that carry equal shares of roughness^(1/(stages + 1)); `share` (if given) becomes
// the whole of it, so that (share/intervals)^(stages + 1) is the size of the interpolation error.
std::vector<double> equidistribute(const std::vector<double>& mesh, std::vector<double> rough, size_t intervals,
                                   double* share = nullptr) {
  const size_t n = mesh.size() - 1;
  double total = 0;
  for (double& r : rough) r = std::pow(r, 1. / (stages + 1));
  for (size_t i = 0; i < n; ++i) total += rough[i] * (mesh[i + 1] - mesh[i]);
  if (share) *share = total;
  // a tenth of the points spread evenly in phase, a tenth over the old mesh, so that no part is left bare
  std::vector<double> sum(n + 1, 0.);
  for (size_t i = 0; i < n; ++i)
    sum[i + 1] = sum[i] + (.8 * rough[i] / total + .1) * (mesh[i + 1] - mesh[i]) + .1 / double(n);
  std::vector<double> result{0};
  size_t i = 0;
  for (size_t k = 1; k < intervals; ++k) {
    const double target = sum[n] * double(k) / double(intervals);
    while (sum[i + 1] < target) ++i;
    result.push_back(mesh[i] + (mesh[i + 1] - mesh[i]) * (target - sum[i]) / (sum[i + 1] - sum[i]));
  }
  result.push_back(1);
  return result;
}

std::vector<double> halved(const std::vector<double>& mesh) {
  std::vector<double> result;
  for (size_t i = 0; i + 1 < mesh.size(); ++i) {
    result.push_back(mesh[i]);
    result.push_back((mesh[i] + mesh[i + 1]) / 2);
  }
  result.push_back(1);
  return result;
}

// Unknowns of a problem, filled from a profile.
template <class Profile>
std::vector<double> fill(const Problem& problem, Profile&& profile, double q) {
  const std::vector<double>& mesh = problem.mesh();
  const size_t d = size_t(problem.dim());
  std::vector<double> x(problem.size());
  double y[max_dim + 1];
  for (size_t i = 0; i + 1 < mesh.size(); ++i)
    for (size_t j = 0; j <= stages; ++j) {
      profile(mesh[i] + (mesh[i + 1] - mesh[i]) * train_dense().points()[j], y);
      std::copy(y, y + d, x.begin() + long(i * problem.block() + j * d));
    }
  x[(mesh.size() - 1) * problem.block()] = q;
  return x;
}

Train pack(const Problem& problem, const std::vector<double>& x) {
  Train train;
  const Setting& setting = problem.setting();
  const std::vector<double>& mesh = problem.mesh();
  const size_t d = size_t(problem.dim()), n = mesh.size() - 1, b = problem.block();
  const Setting::At at = setting.at(x[n * b]);
  train.pulses = setting.request.pulses;
  train.length_given = bool(setting.request.length);
  train.speed = setting.request.speed ? *setting.request.speed : at.speed;
  train.period = at.T;
  train.length = setting.request.length ? *setting.request.length : double(train.pulses) * at.speed * at.T;
  train.r2 = at.r2;
  train.oscillator = setting.oscillator;
  train.mesh = mesh;
  for (size_t i = 0; i < n; ++i) {
    train.nodes.insert(train.nodes.end(), x.begin() + long(i * b), x.begin() + long(i * b + d));
    train.stages.insert(train.stages.end(), x.begin() + long(i * b + d), x.begin() + long((i + 1) * b));
  }
  // extrema of psi: the best point, then the parabola's way down to the polynomial's own extremum
  for (int sign : {1, -1}) {
    size_t best = 0;
    for (size_t i = 0; i < n; ++i)
      for (size_t j = 0; j <= stages; ++j)
        if (sign * x[i * b + j * d] > sign * x[best]) best = i * b + j * d;
    double value = x[best];
    const size_t at_interval = best / b;
    for (size_t i : {at_interval, (at_interval + n - 1) % n, (at_interval + 1) % n}) {
      double low = mesh[i], high = mesh[i + 1], y[max_dim];
      const double golden = (std::sqrt(5.) - 1) / 2;
      for (int k = 0; k < 60; ++k) {
        const double p1 = high - golden * (high - low), p2 = low + golden * (high - low);
        double f1, f2;
        evaluate(mesh, x.data(), int(d), p1, y);
        f1 = y[0];
        evaluate(mesh, x.data(), int(d), std::min(p2, std::nextafter(1., 0.)), y);
        f2 = y[0];
        value = sign * std::max({sign * value, sign * f1, sign * f2});
        (sign * f1 > sign * f2 ? high : low) = sign * f1 > sign * f2 ? p2 : p1;
      }
    }
    (sign > 0 ? train.psi_max : train.psi_min) = value;
  }
  return train;
}

// Solves on the mesh of `x`'s profile (adapted), then on the mesh halved; refines until the answer is good enough.
template <class Profile>
bool solve_to(const Setting& setting, std::vector<double> mesh, Profile&& start, double q, double tolerance,
              bool adapt, Train& train) {
  Problem problem(setting, mesh, q);
  std::vector<double> x = fill(problem, start, q);
  if (!newton(problem, x)) return false;
  const int d = problem.dim();
  double least = 12;
  for (int round = 0; round < 12; ++round) {
    // the profile to 1e-9 of its range or the tolerance asked for, whichever is finer, within reason
    if (adapt) {
      double share;
      const std::vector<double> rough = roughness(mesh, x.data(), d);
      equidistribute(mesh, rough, 1, &share);
      const double wanted = share / std::pow(std::max(tolerance, 1e-12) * 10, 1. / (stages + 1));
      const size_t intervals = size_t(std::min(20000., std::max(least, .5 * wanted)));
      least = 1.5 * double(intervals);  // should there be a next round
      std::vector<double> better = equidistribute(mesh, rough, intervals);
      Problem on_better(setting, better, x.back());
      std::vector<double> guess =
          fill(on_better, [&](double phase, double* y) { evaluate(mesh, x.data(), d, phase, y); }, x.back());
      if (!newton(on_better, guess)) continue;  // too coarse
      problem = on_better;
      mesh = better;
      x = guess;
    }
    Problem finer(setting, halved(mesh), x.back());
    std::vector<double> y =
        fill(finer, [&](double phase, double* to) { evaluate(mesh, x.data(), d, phase, to); }, x.back());
    double last_step = 0;
    if (!newton(finer, y, &last_step)) {
      if (adapt) continue;
      return false;
    }
    // Halving divides the error of q by 2^10 once the mesh is fine, and by less before; 8 is on the safe side.
    double profile = 0;
    const std::vector<double>& fine_mesh = finer.mesh();
    for (size_t i = 0; i + 1 < fine_mesh.size(); ++i)
      for (size_t j = 0; j <= stages; ++j) {
        double at[max_dim];
        evaluate(mesh, x.data(), d, fine_mesh[i] + (fine_mesh[i + 1] - fine_mesh[i]) * train_dense().points()[j], at);
        profile = std::max(profile, std::abs(at[0] - y[i * finer.block() + j * size_t(d)]));
      }
    const Setting::At coarse = setting.at(x.back()), fine = setting.at(y.back());
    const double relative = std::abs(setting.request.speed ? coarse.T / fine.T - 1 : coarse.speed / fine.speed - 1);
    const double estimate = relative / 8;
    const bool good = estimate <= tolerance && profile / 32 <= std::max({1e-9, tolerance, last_step});
    if (good || round == 11 || fine_mesh.size() > 40000) {
      if (!good) throw Failure("the train needs more than " + std::to_string(fine_mesh.size()) + " mesh intervals");
      train = pack(finer, y);
      const double unknown = setting.request.speed ? train.length : std::abs(train.speed);
      std::vector<double> F(finer.size()), noise(finer.size());
      finer.residual(y.data(), F.data());
      for (double r : F) train.residual = std::max(train.residual, std::abs(r));
      // round-off: what one more step of Newton's method would move q by, and a few units of the last place
      finer.linearise(y.data());
      finer.solve(F.data(), noise.data());
      train.error_estimate = unknown * (estimate + 4 * std::abs(noise.back()) + 4e-15);
      train.profile_error = profile / 32 + last_step;
      return true;
    }
    if (!adapt) {
      problem = finer;
      mesh = fine_mesh;
      x = y;
    }
  }
  return false;
}

double cubic_shortest(const Scene& scene) {
  const double a2 = 1 - scene.s_delta() / scene.gamma, w2 = scene.v * scene.v / a2;
  if (!(a2 > 0) || w2 >= 1) return 0;
  return scene.gamma * a2 * scene.c * (3 - (1 - w2) * std::log((4 - w2) / (1 - w2)));
}

bool plain_cubic(const Scene& scene) {
  return scene.friction.law == Law::cubic && scene.friction.state == StateLaw::none;
}

}  // namespace

TrainRequest train_request(const Options& options) {
  TrainRequest request{options.integer("wave_pulses"), options.real_if_set("wave_length"),
                       options.real_if_set("wave_speed"), true};
  if (bool(request.length) == bool(request.speed))
    throw UsageError(request.length ? "wave_length and wave_speed are both set: exactly one of the two is needed"
                                    : "wave_length or wave_speed is needed: exactly one of the two");
  return request;
}

const Tableau& train_tableau() {
  static const Tableau t = Tableau::gauss(stages);
  return t;
}

const Lagrange& train_dense() {
  static const Lagrange l = [] {
    std::vector<double> points{0};
    for (double c : train_tableau().c) points.push_back(c);
    return Lagrange(points);
  }();
  return l;
}

void Train::at(double phase, double* y) const {
  phase -= std::floor(phase);
  const size_t n = intervals(), d = size_t(oscillator->dim());
  const size_t i = std::min(size_t(std::upper_bound(mesh.begin(), mesh.end(), phase) - mesh.begin() - 1), n - 1);
  double w[stickslip::stages + 1];
  train_dense().weights((phase - mesh[i]) / (mesh[i + 1] - mesh[i]), w);
  for (size_t a = 0; a < d; ++a) {
    y[a] = w[0] * nodes[i * d + a];
    for (size_t j = 0; j < stickslip::stages; ++j) y[a] += w[j + 1] * stages[(i * stickslip::stages + j) * d + a];
  }
}

double Train::psi_at(double phase) const {
  double y[max_dim];
  at(phase, y);
  return y[0];
}

double Train::eta_at(double phase) const {
  double y[max_dim];
  at(phase, y);
  return oscillator->eta(r2, y);
}

double Train::state_at(double phase) const {
  double y[max_dim];
  at(phase, y);
  return oscillator->dim() == 3 ? y[2] : 0;
}

void check_train_scene(const Scene& scene) {
  if (scene.form == Form::chain)
    throw UsageError("model_form chain: travelling trains are solved for in the continuum only (the chain's obey an "
                     "advance-delay equation); use model_form continuum");
  if (scene.spread > 0)
    throw UsageError("friction_spread " + number(scene.spread) +
                     ": a train travels through a uniform medium only; set friction_spread to 0");
  (void)Oscillator(scene);  // refuses a law that jumps
}

double shortest_pulse(const Scene& scene) {
  if (plain_cubic(scene)) return cubic_shortest(scene);
  if (scene.c == 0) return 0;
  return scene.c * find_orbit(Oscillator(scene), 2e-12, 1e-8, 0).period;
}

Train correct_train(const Scene& scene, const TrainRequest& request, const Train& guess, bool adapt) {
  const Setting setting = setting_of(scene, request);
  const double V = guess.speed, c = scene.c;
  const double q = request.speed ? std::log(guess.period) : .5 * std::log((std::abs(V) - c) * (std::abs(V) + c));
  Train train;
  if (!solve_to(setting, guess.mesh, [&](double phase, double* y) { guess.at(phase, y); }, q, 1e-10, adapt, train))
    throw Failure("Newton's method does not reach a train from the one nearby");
  return train;
}

Train solve_train(const Scene& scene, const TrainRequest& request, double tolerance) {
  check_train_scene(scene);
  if (request.pulses < 1) throw UsageError("wave_pulses " + std::to_string(request.pulses) + ": at least 1 is needed");
  if (bool(request.length) == bool(request.speed))
    throw UsageError("wave_length and wave_speed: exactly one of the two is needed");
  if (request.length && !(*request.length > 0))
    throw UsageError("wave_length " + number(*request.length) + ": a positive length is needed");
  const double c = scene.c;
  if (request.speed && !(std::abs(*request.speed) > c))
    throw UsageError("wave_speed " + number(*request.speed) +
                     ": periodic waves need a speed beyond c, |V| > model_c = " + number(c));
  if (plain_cubic(scene)) {
    const double a2 = 1 - scene.s_delta() / scene.gamma, vc = a2 > 0 ? std::sqrt(a2) : 0;
    if (std::abs(scene.v) >= vc)
      throw Failure("no train: uniform sliding at model_v = " + number(scene.v) + " is stable (|v| >= v_c = " +
                    number(vc) + ")");
  }
  const Setting setting = setting_of(scene, request);
  const Oscillator& o = *setting.oscillator;
  const double rough = 1e-5;
  Train train;
  auto from_orbit = [&](const Orbit& orbit, double q) {
    auto attempt = [&](const Orbit& guess) {
      return solve_to(setting, guess.steps(), [&](double phase, double* y) { guess.at(phase, y); }, q, tolerance, true,
                      train);
    };
    if (attempt(orbit)) return true;
    // fronts so steep that Newton's method wants a better start
    for (double finer : {1e-7, 1e-9, 1e-11})
      if (attempt(find_orbit(o, setting.at(q).r2, finer, 0))) return true;
    return false;
  };
  auto orbit_at = [&](double r2) {
    try {
      return find_orbit(o, r2, rough, 0);
    } catch (const Failure& e) {
      throw Failure(std::string("no train: ") + e.what());
    }
  };
  if (request.speed) {
    const Orbit orbit = orbit_at(setting.at(0).r2);
    if (!from_orbit(orbit, std::log(orbit.period)))
      throw Failure("Newton's method does not converge to the train from the integrated orbit");
    return train;
  }
  const double pulse = *request.length / double(request.pulses);
  // mismatch(q) = ln(V T/(length of a pulse)), from high speed down; the first change of sign is the fastest train
  const Orbit uniform = orbit_at(1);
  auto mismatch = [&](double q, Orbit& orbit) {
    const Setting::At at = setting.at(q);
    orbit = orbit_at(at.r2);
    return std::log(at.speed * orbit.period / pulse);
  };
  Orbit orbit;
  double high = std::log(pulse / uniform.period), at_high = mismatch(high, orbit);
  while (at_high <= 0) at_high = mismatch(high += .5, orbit);
  const double floor = std::log(std::max(c, 1e-30)) - 14;  // V/c - 1 = 3e-13
  double step = .5;
  while (high > floor) {
    double low = high - step, at_low = mismatch(low, orbit);
    if (c == 0 && low < high - 40) break;
    if (at_low > 0) {
      high = low;
      at_high = at_low;
      step = std::min(1., step * 1.5);
      continue;
    }
    double a = low, b = high, fa = at_low, fb = at_high, q = low;
    for (int k = 0; k < 60 && b - a > 1e-5 * std::max(1., std::abs(b)); ++k) {
      q = k % 3 == 2 ? (a + b) / 2 : b - fb * (b - a) / (fb - fa);
      const double fq = mismatch(q, orbit);
      if (std::abs(fq) < 1e-6) break;
      if (fq > 0) {
        b = q;
        fb = fq;
      } else {
        a = q;
        fa = fq;
      }
    }
    if (from_orbit(orbit, q)) return train;
    high = low;  // a jump of the period, not a root: go on below
    at_high = at_low;
    while (high > floor && at_high <= 0) at_high = mismatch(high -= .5, orbit);
  }
  const double l = shortest_pulse(scene);
  const double most = std::ceil(*request.length / l) - 1;
  const std::string fits =
      most < 1 ? "none fits" : "at most " + number(most) + (most == 1 ? " fits" : " fit");
  throw Failure("no train of " + std::to_string(request.pulses) + (request.pulses == 1 ? " pulse" : " pulses") +
                " on a ring of length " + number(*request.length) + ": as V falls to c a pulse still takes " +
                number(l) + ", so that " + fits);
}

// ---- branches -----------------------------------------------------------------------------------------------------

namespace {

// What the arclength is measured in.
struct Scales {
  double z, lambda;
};

// (z(0), q, lambda) of a vector of unknowns.
std::vector<double> place(const Problem& problem, const std::vector<double>& x) {
  const size_t last = problem.mesh().size() - 1;
  return {x[1], x[last * problem.block()], x[last * problem.block() + 1]};
}

std::vector<double> interpolated(const Problem& from, const Problem& to, const std::vector<double>& x) {
  std::vector<double> y = fill(
      to, [&](double phase, double* at) { evaluate(from.mesh(), x.data(), from.dim(), phase, at); }, x[x.size() - 2]);
  y.back() = x.back();
  return y;
}

}  // namespace

void check_branch(const Options& options) {
  const std::string name = options.text("wave_continue");
  if (options.is_set("wave_continue") != options.is_set("wave_to"))
    throw UsageError("wave_continue and wave_to belong together: which option to vary, and up to which value");
  if (!options.is_set("wave_continue")) return;
  const std::vector<OptionSpec>& table = option_table();
  const auto spec = std::find_if(table.begin(), table.end(), [&](const OptionSpec& o) { return o.name == name; });
  if (spec == table.end()) {
    std::vector<std::string> names;
    for (const OptionSpec& o : table)
      if (o.type == OptionType::real) names.push_back(o.name);
    const std::string near = nearest_name(name, names);
    throw UsageError("wave_continue " + name + ": no such option" +
                     (near.empty() ? "" : "; did you mean " + near + "?"));
  }
  if (spec->type != OptionType::real && spec->type != OptionType::real_or_word)
    throw UsageError("wave_continue " + name + ": a branch follows a real option, which this is not");
  if ((name == "wave_length" || name == "wave_speed") && !options.is_set(name))
    throw UsageError("wave_continue " + name + ": needs -" + name + " as the start of the branch");
  if (options.real("wave_to") == options.real(name))
    throw UsageError("wave_to " + options.text("wave_to") + ": the branch starts there");
  (void)options.with(name, options.real("wave_to"));  // must be a value that the option can take
}

Branch continue_train(const Options& options, const std::string& name, double to, int steps) {
  const TrainRequest asked = train_request(options);
  const double from = options.real(name);
  const Problem::Family family = [&](double lambda) {
    const Options here = options.with(name, lambda);
    TrainRequest request = train_request(here);
    const Scene scene = Scene::from(here, true);
    const double c = scene.c;
    if (request.speed && !(std::abs(*request.speed) > c)) throw Failure("V comes down to c");
    if (request.length && !(*request.length > 0)) throw Failure("the length vanishes");
    return setting_of(scene, request);
  };
  const Setting start = family(from);
  const Train first = solve_train(Scene::from(options, true), asked);
  Branch branch;
  branch.points.push_back({from, first, false});

  const int d = start.oscillator->dim();
  const double c2 = start.oscillator->c2(), V = std::abs(first.speed);
  const double q0 = asked.speed ? std::log(first.period) : .5 * std::log((V - std::sqrt(c2)) * (V + std::sqrt(c2)));
  double z_low = 1e300, z_high = -1e300;
  for (size_t i = 0; i < first.intervals(); ++i) {
    z_low = std::min(z_low, first.nodes[i * size_t(d) + 1]);
    z_high = std::max(z_high, first.nodes[i * size_t(d) + 1]);
  }
  const Scales scale{z_high - z_low, std::abs(to - from)};
  const double amplitude = first.psi_max - first.psi_min;

  auto problem_on = [&](const std::vector<double>& mesh, double q, double lambda) {
    Problem problem(family(lambda), mesh, q);
    problem.extend(family, scale.lambda, {0, 0, 1}, lambda);
    return problem;
  };
  auto along = [&](const std::vector<double>& tangent) {  // the arclength equation's row
    return std::vector<double>{tangent[0] / (scale.z * scale.z), tangent[1],
                               tangent[2] / (scale.lambda * scale.lambda)};
  };
  // Tangent in all unknowns, of length 1 in the scaled (z, q, lambda), on the side of `row`.
  auto tangent_at = [&](Problem& problem, const std::vector<double>& x, const std::vector<double>& row) {
    problem.extend(family, scale.lambda, row, 0);
    problem.linearise(x.data());
    std::vector<double> rhs(x.size()), t(x.size());
    rhs.back() = 1;
    problem.solve(rhs.data(), t.data());
    const std::vector<double> p = place(problem, t);
    const double length = std::hypot(p[0] / scale.z, std::hypot(p[1], p[2] / scale.lambda));
    for (double& value : t) value /= length;
    return t;
  };

  Problem problem = problem_on(first.mesh, q0, from);
  std::vector<double> x = fill(problem, [&](double phase, double* y) { first.at(phase, y); }, q0);
  x.back() = from;
  // begin along the parameter
  std::vector<double> t;
  try {
    t = tangent_at(problem, x, {0, 0, (to > from ? 1 : -1) / scale.lambda});
  } catch (const Failure&) {
    throw Failure("wave_continue " + name + ": the train does not change with it, or turns back at once");
  }
  if (!(std::abs(place(problem, t)[1]) + std::abs(place(problem, t)[0]) > 0) && !asked.speed) {
    const Setting moved = family(from + .01 * (to - from));
    if (moved.oscillator->A() == start.oscillator->A() && moved.oscillator->v() == start.oscillator->v())
      throw Failure("wave_continue " + name + ": this option does not enter the train");
  }

  const double longest = std::max(.02, std::min(.2, 4. / steps));
  double ds = longest / 2;
  // A canard's parameter stands still to the last digit: only a change of direction beyond round-off is a fold.
  double heading = to > from ? 1 : -1;
  branch.end = "wave_steps " + std::to_string(steps) + " taken";
  for (int k = 0; k < steps;) {
    const std::vector<double> here = place(problem, x), direction = place(problem, t), row = along(direction);
    if (ds < 1e-9) {
      branch.end = "no train is found beyond " + name + " = " + number(x.back(), 12);
      break;
    }
    try {
      // the last step goes to the end value exactly
      const double ahead = direction[2] != 0 ? (to - here[2]) / direction[2] : -1;
      const bool arrive = ahead > 0 && ahead <= 1.5 * ds;
      const double length = arrive ? ahead : ds;
      const std::vector<double> equation = arrive ? std::vector<double>{0, 0, 1} : row;
      double right = arrive ? to : length;
      if (!arrive)
        for (size_t i = 0; i < 3; ++i) right += row[i] * here[i];
      std::vector<double> guess = x;
      for (size_t i = 0; i < x.size(); ++i) guess[i] += length * t[i];
      problem.extend(family, scale.lambda, equation, right);
      if (!newton(problem, guess, nullptr, 10)) throw Failure("Newton's method does not converge");
      // again on a mesh that suits the new profile
      double share;
      const std::vector<double> rough = roughness(problem.mesh(), guess.data(), d);
      equidistribute(problem.mesh(), rough, 1, &share);
      const size_t wanted = size_t(std::min(4000., std::max(60., share / std::pow(1e-9, 1. / (stages + 1)))));
      Problem better = problem_on(equidistribute(problem.mesh(), rough, wanted), guess[guess.size() - 2], guess.back());
      std::vector<double> y = interpolated(problem, better, guess);
      better.extend(family, scale.lambda, equation, right);
      if (!newton(better, y, nullptr, 10)) throw Failure("Newton's method does not converge");
      const std::vector<double> there = place(better, y);
      const double moved = std::hypot((there[0] - here[0]) / scale.z,
                                      std::hypot(there[1] - here[1], (there[2] - here[2]) / scale.lambda));
      if (moved > 2 * length) throw Failure("the step left the branch");
      std::vector<double> t_next = tangent_at(better, y, row);
      // turning by more than a quarter of a right angle: the step was too long to trust
      const std::vector<double> new_direction = place(better, t_next);
      double cosine = 0;
      for (size_t i = 0; i < 3; ++i) cosine += row[i] * new_direction[i];
      if (cosine < .92 && ds > 1e-4 && !arrive) {
        ds /= 2;
        continue;
      }
      // y[0] = v rises where the orbit is a true one; past the Hopf point the branch repeats itself half a turn on
      std::vector<double> F(better.size());
      better.residual(y.data(), F.data());
      double slope[max_dim];
      const Setting at = better.setting();
      at.oscillator->rhs(at.at(there[1]).r2, y.data(), slope, nullptr);
      Train train = pack(better, y);
      for (double r : F) train.residual = std::max(train.residual, std::abs(r));
      train.error_estimate = 1e-9 * (asked.speed ? train.length : std::abs(train.speed));
      const bool vanished = slope[0] <= 0 || train.psi_max - train.psi_min < 1e-3 * amplitude;
      if (vanished) {
        // lambda is even in the amplitude: extrapolate to zero from the last two points
        const BranchPoint& last = branch.points.back();
        const double a1 = std::pow(last.train.psi_max - last.train.psi_min, 2);
        const double a2 = std::pow(train.psi_max - train.psi_min, 2);
        const double hopf = a1 != a2 ? (there[2] * a1 - last.value * a2) / (a1 - a2) : there[2];
        branch.end = "the amplitude vanishes at " + name + " = " + number(hopf, 8) + ", where sliding becomes stable";
        break;
      }
      const bool fold = new_direction[2] * heading < -1e-9 * scale.lambda;
      if (fold) heading = -heading;
      problem = better;
      x = y;
      t = t_next;
      branch.points.push_back({there[2], train, fold});
      ++k;
      if (arrive) {
        branch.end = "reached " + name + " = " + number(to);
        break;
      }
      if ((there[2] - from) * (to - from) < 0) {
        branch.end = "the branch came back past its start, " + name + " = " + number(from);
        break;
      }
      if (cosine > .98) ds = std::min(longest, 1.4 * ds);
    } catch (const Error&) {
      ds /= 2;
    }
  }
  return branch;
}

}  // namespace stickslip
