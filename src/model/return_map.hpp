// The motion of an oscillator turn by turn: steps of Radau's method of order 9, and the map from one passage
// of psi = v upwards (downwards where v < 0) to the next. Local to the process.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/linear_systems.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

struct OrbitStep {
  double t, h;
  double values[(train_stages + 1) * train_max_dim];  // at 0 and the train_stages
};

// The polynomial of a step with d components, by weights for its points.
inline void combine(const OrbitStep& step, int d, const double* weights, double* y) {
  for (int k = 0; k < d; ++k) {
    y[k] = 0;
    for (int j = 0; j <= train_stages; ++j) y[k] += weights[j] * step.values[j * d + k];
  }
}

class OrbitIntegrator {
 public:
  OrbitIntegrator(const Oscillator& oscillator, double r2, double tolerance)
      : o_(oscillator), r2_(r2), tolerance_(tolerance), d_(oscillator.dim()) {
    Collocation::radau5().basis.derivative_weights(test_point, slope_);
    Collocation::radau5().basis.weights(test_point, value_);
  }

  // One step of size h from y. False where Newton's method fails. It starts from the polynomial of the step
  // `near`, which begins `offset` of its length before y (null: from y). `error`: of the dense output against
  // the tolerance.
  bool try_step(const double* y, double h, const OrbitStep* near, double offset, OrbitStep& step,
                double& error) {
    step.h = h;
    std::copy(y, y + d_, step.values);
    for (int i = 0; i < train_stages; ++i) {
      double* stage = step.values + (i + 1) * d_;
      if (near) {
        double w[train_stages + 1];
        Collocation::radau5().basis.weights(offset + Collocation::radau5().c[i] * h / near->h, w);
        combine(*near, d_, w, stage);
      } else {
        std::copy(y, y + d_, stage);
      }
    }
    if (!solve_stages(step)) return false;
    error = defect(step);
    return std::isfinite(error);
  }

  // Advances y, t by one accepted step.
  void step(double& t, double* y, double& h, OrbitStep& out) {
    for (int attempt = 0; attempt < 200; ++attempt) {
      double error = 0;
      if (!try_step(y, h, have_last_ ? &last_ : nullptr, 1, out, error)) {
        if (!(have_last_ && at_rest_)) h /= 4;
        have_last_ = have_last_ && !at_rest_ && attempt < 2;
        continue;
      }
      const double factor =
          std::min(4., std::max(.2, .85 * std::pow(std::max(error, 1e-12), -1. / (train_stages + 1))));
      const double taken = h;
      h *= factor;
      if (error > 1) continue;
      out.t = t;
      t += taken;
      std::copy(out.values + train_stages * d_, out.values + (train_stages + 1) * d_, y);
      last_ = out;
      have_last_ = true;
      return;
    }
    throw Failure("the oscillation's integrator cannot go on: step " + std::to_string(h));
  }

  void restart() { have_last_ = at_rest_ = false; }
  // From now on psi may be all but zero, held there by friction so steep that Newton's own steps shoot
  // through zero, and that what is extrapolated from the last step is noise.
  void at_rest() { at_rest_ = o_.steep(); }

 private:
  bool solve_stages(OrbitStep& step) const {
    const int d = d_, n = train_stages * d;
    const double* y = step.values;
    double *stage = step.values + d, previous = 0;
    const Collocation& method = Collocation::radau5();
    for (int iteration = 0; iteration < 12; ++iteration) {
      double G[train_stages * train_max_dim], J[train_stages * train_max_dim * train_max_dim];
      for (int i = 0; i < train_stages; ++i) o_.rhs(r2_, stage + i * d, G + i * d, J + i * d * d);
      double a[train_stages * train_max_dim * train_stages * train_max_dim], b[train_stages * train_max_dim];
      stage_matrix(method, d, step.h, J, a);
      for (int i = 0; i < n; ++i) {
        b[i] = y[i % d] - stage[i];
        for (int j = 0; j < train_stages; ++j)
          b[i] += step.h * method.a[i / d * train_stages + j] * G[j * d + i % d];
      }
      if (!solve_dense(n, a, 1, b)) return false;
      if (at_rest_)
        for (int i = 0; i < train_stages; ++i)
          b[i * d] = o_.newton_step(r2_, stage + i * d, b + i * d, step.h * method.a[i * train_stages + i]);
      double norm = 0;
      for (int i = 0; i < n; ++i) {
        stage[i] += b[i];
        norm = std::max(norm, std::abs(b[i]) / (o_.scale(i % d) + std::abs(stage[i])));
      }
      if (!std::isfinite(norm)) return false;
      if (norm < 1e-14 || (norm < 1e-10 && iteration > 0 && norm > previous / 4)) return true;
      if (iteration > 2 && norm > 2 * previous) return false;
      previous = norm;
    }
    return false;
  }

  // The defect of the polynomial between the train_stages against the tolerance, filtered so that stiff
  // directions do not exaggerate it.
  double defect(const OrbitStep& step) const {
    double u[train_max_dim], e[train_max_dim], g[train_max_dim], J[train_max_dim * train_max_dim], error = 0;
    combine(step, d_, value_, u);
    combine(step, d_, slope_, e);
    o_.rhs(r2_, u, g, J);
    for (int k = 0; k < d_; ++k) e[k] = filter * (e[k] - step.h * g[k]);
    for (int k = 0; k < d_ * d_; ++k) J[k] = (k % (d_ + 1) == 0 ? 1. : 0.) - filter * step.h * J[k];
    if (!solve_dense(d_, J, 1, e)) return std::nan("");
    for (int k = 0; k < d_; ++k)
      error = std::max(error, std::abs(e[k]) / (tolerance_ * (o_.scale(k) + std::abs(u[k]))));
    return error;
  }

  static constexpr double test_point = .5 * 0.85, filter = .15;
  const Oscillator& o_;
  double r2_, tolerance_;
  int d_;
  double slope_[train_stages + 1], value_[train_stages + 1];
  OrbitStep last_;
  bool have_last_ = false, at_rest_ = false;
};

// From y on the section f = v to the next passage of f = v upwards (downwards where v < 0); y becomes the
// point there, the time is returned. Steps (the last cut at the section) are appended where asked for.
// `divergence`: integral of the trace of J.
class ReturnMap {
 public:
  ReturnMap(const Oscillator& o, double r2, double tolerance)
      : o_(o), r2_(r2), integrator_(o, r2, tolerance) {}

  // Throws Failure where the motion settles (after 200,000 steps at most) or grows without bound.
  double operator()(double* y, std::vector<OrbitStep>* steps = nullptr, double* divergence = nullptr) {
    const int d = o_.dim();
    integrator_.restart();
    beat("turns");
    double t = 0, g[train_max_dim], scale = 0;
    o_.rhs(r2_, y, g, nullptr);
    for (int k = 0; k < d; ++k) scale = std::max(scale, std::abs(g[k]) / (o_.scale(k) + std::abs(y[k])));
    double h = .01 / std::max(scale, 1e-6 * std::sqrt(o_.K0() * o_.A()));
    bool below = false;
    if (divergence) *divergence = 0;
    constexpr long many_steps = 2000;  // a turn takes some hundred
    for (long count = 0; count < 200000 && t <= 1e9 / std::sqrt(o_.K0() * o_.A()); ++count) {
      if (count == many_steps) integrator_.at_rest();
      OrbitStep step;
      integrator_.step(t, y, h, step);
      if (std::abs(y[0]) > o_.escape()) throw Failure("the motion grows without bound");
      const double above = o_.side() * (y[0] - o_.v());
      const bool passed = below && above >= 0;
      if (passed) cut_at_section(step, y);
      add(step, steps, divergence);
      if (passed) return step.t + step.h;
      below = below || above < 0;
    }
    throw Failure("nothing oscillates: the motion settles without passing the plate velocity again");
  }

 private:
  // The passage lies in this step: found on the polynomial, then a step is made to end there.
  void cut_at_section(OrbitStep& step, double* y) {
    const int d = o_.dim();
    const auto above = [&](double part) {
      double w[train_stages + 1], at[train_max_dim];
      Collocation::radau5().basis.weights(part, w);
      combine(step, d, w, at);
      return o_.side() * (at[0] - o_.v());
    };
    const double begins = o_.side() * (step.values[0] - o_.v()), ends = o_.side() * (y[0] - o_.v());
    double end = find_root(above, {0, begins, 1, ends}, 1e-15) * step.h, error;
    OrbitStep cut;
    double* last = cut.values + train_stages * d;
    for (int k = 0; k < 6; ++k) {
      if (!integrator_.try_step(step.values, end, &step, 0, cut, error))
        throw Failure("the oscillation's integrator cannot go on at the section");
      double slope[train_max_dim];
      o_.rhs(r2_, last, slope, nullptr);
      const double correction = (o_.v() - last[0]) / slope[0];
      if (std::abs(correction) <= 1e-15 * step.h) break;
      end += correction;
    }
    cut.t = step.t;
    step = cut;
    std::copy(last, last + d, y);
    y[0] = o_.v();
  }

  void add(const OrbitStep& step, std::vector<OrbitStep>* steps, double* divergence) {
    if (steps) steps->push_back(step);
    if (!divergence) return;
    const int d = o_.dim();
    for (int j = 0; j < train_stages; ++j) {
      double g[train_max_dim], J[train_max_dim * train_max_dim];
      o_.rhs(r2_, step.values + (j + 1) * d, g, J);
      for (int k = 0; k < d; ++k) *divergence += step.h * Collocation::radau5().b[j] * J[k * d + k];
    }
  }

  const Oscillator& o_;
  double r2_;
  OrbitIntegrator integrator_;
};

}  // namespace stickslip
