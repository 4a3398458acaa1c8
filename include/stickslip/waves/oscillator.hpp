// The oscillator behind uniform motion and travelling waves, and its limit cycle by an integrator of its own.
//
// With psi(x, t) = f(t - x/V) the semi-discrete system's continuum becomes, in t alone and with
// r2 = 1 - A K1/V^2 (1 for uniform motion, which is the train of infinite speed; 0 < r2 < 1 for |V| > c),
//     r2 f' = A [z - Bd f - F(f, s)],      Bd = B + s delta/A,
//     z'    = K0 (v - f),                  z = eta - (K1/V^2) f' + (s delta/A) f,
//     s'    = g(f, s)                      only with a state law.
// eta = f'/A + B f + F. No derivative of F enters, so that a jump (r2 -> 0) costs no digits.
//
// The limit cycle is found by a Radau IIA method of order 9 and a return map on f = v; it shares nothing but this
// right-hand side with the collocation in train.hpp, which it starts and checks. Nothing here is collective.
#pragma once

#include <memory>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/dense.hpp"
#include "stickslip/numerics/interpolation.hpp"

namespace stickslip {

// The right-hand side above for the amplitude-1 friction of a scene. Throws UsageError where the law has a jump at
// rest (exact carlson-langer, coulomb), which an oscillation passes and which this smooth problem cannot have.
class Oscillator {
 public:
  explicit Oscillator(const Scene& scene);
  ~Oscillator();
  Oscillator(Oscillator&&) noexcept;

  int dim() const { return dim_; }  // 2: (f, z); 3: (f, z, s)
  double v() const { return v_; }
  double A() const { return A_; }
  double B() const { return B_; }
  double K0() const { return K0_; }
  double c2() const { return c2_; }  // A K1 = c^2, the square of the signal speed
  double s_delta() const { return sd_; }

  // dy = y'; J (null, or dim x dim row-major) = d(dy)/dy.
  void rhs(double r2, const double* y, double* dy, double* J) const;
  // eta and F with its derivatives at y.
  double eta(double r2, const double* y) const;
  Partials partials(double psi, double state) const;
  RatePartials rate(double psi, double state) const;
  // The steady sliding f = v.
  void steady(double* y) const;
  // Does uniform sliding lose stability to the oscillation of this r2? (Routh-Hurwitz on the dim x dim Jacobian.)
  bool sliding_unstable(double r2) const;

 private:
  struct Law;
  std::unique_ptr<Law> law_;
  int dim_ = 2;
  double A_, B_, Bd_, K0_, c2_, sd_, v_;
};

// A periodic orbit as a function of phase = t/period, phase 0 where f passes v upwards.
class Orbit {
 public:
  double period = 0;
  double multiplier = 0;  // of the return map (dim 2); the orbit attracts where |multiplier| < 1
  // Equally spaced in phase: phase i/samples. `state` is empty without a state law.
  std::vector<double> psi, eta, state;

  double psi_at(double phase) const;
  double eta_at(double phase) const;
  double state_at(double phase) const;  // as stored (see friction.hpp)
  // (f, z, s), then eta, at a phase: dim + 1 values.
  void at(double phase, double* y) const;
  // Phases of the integrator's steps, from 0 to 1: dense where the orbit is steep.
  const std::vector<double>& steps() const { return steps_; }

 private:
  friend Orbit find_orbit(const Oscillator&, double, double, int);
  int dim_ = 2;
  std::vector<double> steps_;
  std::vector<double> values_;  // of step i: (s + 1) points of (f, z, s, eta)
};

// The limit cycle of `oscillator` at r2 to relative accuracy `tolerance` (both of the period and of the dense
// values), sampled at `samples` phases. Throws Failure where sliding is stable and nothing oscillates.
Orbit find_orbit(const Oscillator& oscillator, double r2, double tolerance = 1e-12, int samples = 256);

// The uniform oscillation of a scene (r2 = 1, friction amplitude 1).
Orbit uniform_orbit(const Scene& scene);

}  // namespace stickslip
