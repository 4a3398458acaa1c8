// The oscillator behind uniform motion and travelling waves, and its limit cycle by an integrator of its own.
//
// With psi(x, t) = f(t - x/V) the semi-discrete system's continuum becomes, in t alone and with
// r2 = 1 - A K1/V^2 (1 for uniform motion, which is the train of infinite speed; 0 < r2 < 1 for |V| > c),
//     r2 f' = A [z - Bd f - F(f, s)],      Bd = B + s delta/A,
//     z'    = K0 (v - f),                  z = eta - (K1/V^2) f' + (s delta/A) f,
//     s'    = g(f, s)                      only with a state law:
// a node of the semi-discrete system (model/linear_point.hpp) with A/r2 for A, Bd for B, without neighbours
// and delta. eta = f'/A + B f + F. No derivative of F enters, so that a jump (r2 -> 0) costs no digits. f and
// v are velocities, z and eta numbers, s as stored (friction.hpp).
//
// The limit cycle is found by a Radau IIA method of order 9 and a return map on f = v; it shares nothing but
// this right-hand side with the collocation of trains (waves/train.hpp), which it starts and checks. Nothing
// here is collective.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "stickslip/model/friction.hpp"
#include "stickslip/model/linear_point.hpp"
#include "stickslip/model/scales.hpp"
#include "stickslip/model/scene.hpp"
#include "stickslip/numerics/collocation.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

constexpr int train_stages = mesh_stages;  // points of collocation an interval
constexpr int train_max_dim = 3;           // f, z and the state

// Writes y = (f, z[, s]) at a phase; room for train_max_dim values.
using Profile = std::function<void(double phase, double* y)>;

// The velocities but 0, of both directions, at which one piece of friction goes over into the next: a
// derivative of it that methods of high order rely on jumps there (FrictionParameters::piecewise).
std::vector<double> joints_of(const FrictionParameters& friction);

// The right-hand side above for the amplitude-1 friction of a scene. Throws UsageError where the law has a
// jump at rest (exact carlson-langer, coulomb), which an oscillation passes and which this smooth problem
// cannot have.
class Oscillator {
 public:
  explicit Oscillator(const Scene& scene);

  int dim() const { return friction_->has_state ? 3 : 2; }  // (f, z) or (f, z, s)
  double v() const { return v_; }
  // 1, or -1 where v < 0: side * f is positive in the plate's direction. Turns begin where side * f passes
  // side * v upwards, so that the oscillation at -v is the mirror image of that at v in every number.
  double side() const { return v_ < 0 ? -1 : 1; }
  double A() const { return node_.A; }
  double K0() const { return node_.K0; }
  double c2() const { return c2_; }  // A K1 = c^2, the square of the signal speed

  // dy = y'; J (null, or dim x dim row-major) = d(dy)/dy.
  void rhs(double r2, const double* y, double* dy, double* J) const;
  double eta(double r2, const double* y) const;
  // F with its derivatives; `state` is not looked at where the law has none.
  Partials partials(double psi, double state) const { return friction_->partials(psi, state); }
  // Friction is all but a jump at rest: where Newton's step from y for f - dt f' = given is `step`, that of f
  // to take.
  bool steep() const { return friction_->steep; }
  double newton_step(double r2, const double* y, const double* step, double dt) const;
  const std::vector<double>& joints() const { return joints_; }  // of its friction
  // The steady sliding f = v.
  void steady(double* y) const;
  // The |v| from which on uniform sliding is stable, for the cubic law without a state, whatever r2; else
  // NaN.
  double v_c() const;
  // What f, z and s are measured by.
  double scale(int component) const { return scales_.of(component); }
  // |f| beyond which uniform motion grows for ever: nothing dissipates enough to hold it; else infinite.
  double escape() const { return escape_; }
  // Does uniform sliding lose stability to the oscillation of this r2?
  bool sliding_unstable(double r2) const;

 private:
  LinearPoint linear(double r2, const Partials& F, const RatePartials& g) const;
  RatePartials rate(const double* y) const;

  std::shared_ptr<const Friction> friction_;
  LinearPoint node_;  // of that node, at r2 = 1 and without friction
  std::vector<double> joints_;
  double B_, c2_, v_, escape_;
  Scales scales_;
};

// A periodic solution as a function of phase = t/period, phase 0 where f passes v upwards (downwards where v
// < 0): the polynomials of a collocation method on a mesh of phases.
struct PeriodicMotion {
  double period = 0;
  double r2 = 1;
  std::shared_ptr<const Oscillator> oscillator;
  const Collocation* method = nullptr;  // of five points
  std::vector<double> mesh;             // 0 = mesh[0] < ... < mesh[N] = 1
  // y, dim values, at the left end and the five points of each interval in turn
  std::vector<double> values;

  std::size_t intervals() const { return mesh.size() - 1; }
  std::vector<double> phases() const;  // of `values`
  // At any phase, taken modulo 1. The state is 0 where there is none.
  void at(double phase, double* y) const;
  double psi_at(double phase) const;
  double eta_at(double phase) const;
  double state_at(double phase) const;
};

// A limit cycle, on the steps of the integrator: dense where it is steep.
struct Orbit : PeriodicMotion {
  double multiplier = 0;  // of the return map (dim 2); the orbit attracts where |multiplier| < 1
};

// The limit cycle of `oscillator` at r2 to relative accuracy `tolerance` (both of the period and of the dense
// values); to 1e-8 at least where a kink of the law does not let Newton's method further. Throws Failure
// where none is found: sliding is stable and slips die out, or what became of each slip that was tried. The
// first slip begins `slip` friction forces above steady sliding: of several cycles a large one finds the
// outermost.
Orbit find_orbit(const Oscillator& oscillator, double r2, double tolerance = 1e-12, double slip = 1);

// Whether uniform motion (r2 = 1) from a strong slip, ten friction forces above steady sliding, goes on for
// ever: on a cycle, or without repeating in 200 turns. One that grows without bound does not. The quick
// answer, at steps of 1e-6.
bool strong_slips_last(const Oscillator& oscillator);

// The uniform oscillation of a scene (r2 = 1, friction amplitude 1).
Orbit uniform_orbit(const Scene& scene);

}  // namespace stickslip
