#include "stickslip/model/oscillator.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/model/scales.hpp"

namespace stickslip {

namespace {

const Scene& with_one_medium(const Scene& s) {
  if (s.medium.varies())
    throw UsageError(s.medium.profiles.begin()->first +
                     "_profile: what is asked for here needs a medium that is the same everywhere");
  return s;
}

}  // namespace

Oscillator::Oscillator(const Scene& scene)
    : node_(with_one_medium(scene)), B_(scene.B()), c2_(scene.A() * scene.K1()), v_(scene.v) {
  const FrictionParameters& p = scene.friction;
  if (p.sticks())
    throw UsageError("friction_law " + to_string(p.law) +
                     " jumps at rest, which an oscillation passes: set friction_stick to regularised");
  friction_ = Friction::of(p);
  escape_ = escape_velocity(scene);
  scales_ = scales_of(scene).slip;
  if (scene.has_profile())
    throw UsageError(
        "friction_amplitude_profile: what is asked for here needs friction that is the same everywhere");
  node_.B += node_.s_delta / node_.A;
  node_.s_delta = node_.K1 = 0;
}

RatePartials Oscillator::rate(const double* y) const {
  return friction_->has_state ? friction_->rate_partials(y[0], y[2]) : RatePartials{0, 0, 0};
}

LinearPoint Oscillator::linear(double r2, const Partials& F, const RatePartials& g) const {
  LinearPoint point = node_;
  point.A /= r2;
  point.set(F, g);
  return point;
}

void Oscillator::rhs(double r2, const double* y, double* dy, double* J) const {
  const Partials F = friction_->partials(y[0], dim() == 3 ? y[2] : 0);
  const RatePartials g = rate(y);
  dy[0] = node_.A / r2 * (y[1] - node_.B * y[0] - F.F);
  dy[1] = node_.K0 * (v_ - y[0]);
  if (dim() == 3) dy[2] = g.g;
  if (J) linear(r2, F, g).block(Part::pointwise).write(dim(), J);
}

double Oscillator::eta(double r2, const double* y) const {
  const double F = friction_->force(y[0], dim() == 3 ? y[2] : 0);
  return (y[1] - node_.B * y[0] - F) / r2 + B_ * y[0] + F;
}

double Oscillator::newton_step(double r2, const double* y, const double* step, double dt) const {
  const bool state = dim() == 3;
  return friction_->newton_psi(y[0], state ? y[2] : 0, y[0] + step[0], state ? y[2] + step[2] : 0,
                               node_.B + r2 / (node_.A * dt)) -
         y[0];
}

void Oscillator::steady(double* y) const {
  const double s = dim() == 3 ? friction_->steady_state(v_) : 0;
  y[0] = v_;
  y[1] = node_.B * v_ + friction_->force(v_, s);
  if (dim() == 3) y[2] = s;
}

double Oscillator::v_c() const {
  return friction_->van_der_pol ? std::sqrt(std::max(0., 1 - node_.B)) : std::nan("");
}

bool Oscillator::sliding_unstable(double r2) const {
  double y[3];
  steady(y);
  return !linear(r2, friction_->partials(v_, dim() == 3 ? y[2] : 0), rate(y)).stable(0);
}

std::vector<double> PeriodicMotion::phases() const {
  std::vector<double> result;
  for (size_t i = 0; i < intervals(); ++i)
    for (double at : method->basis.points()) result.push_back(mesh[i] + (mesh[i + 1] - mesh[i]) * at);
  return result;
}

void PeriodicMotion::at(double phase, double* y) const {
  evaluate(*method, mesh, values.data(), oscillator->dim(), phase, y);
}

double PeriodicMotion::psi_at(double phase) const {
  double y[train_max_dim];
  at(phase, y);
  return y[0];
}

double PeriodicMotion::eta_at(double phase) const {
  double y[train_max_dim];
  at(phase, y);
  return oscillator->eta(r2, y);
}

double PeriodicMotion::state_at(double phase) const {
  double y[train_max_dim];
  at(phase, y);
  return oscillator->dim() == 3 ? y[2] : 0;
}

}  // namespace stickslip
