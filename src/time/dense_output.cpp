#include "time/integrator_impl.hpp"

#include <petscts.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/base/root.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/numerics/linear_systems.hpp"

namespace stickslip {

namespace {

// Weights of slopes at the points i/(count - 1) in the integral of their interpolating polynomial over [0,
// s].
std::vector<double> integration_weights(int count, double s) {
  std::vector<double> powers(count * count), weights(count);
  double power = s;
  for (int k = 0; k < count; ++k, power *= s) {
    weights[k] = power / (k + 1);
    for (int i = 0; i < count; ++i) powers[k * count + i] = std::pow(double(i) / (count - 1), double(k));
  }
  solve_dense(count, powers.data(), 1, weights.data());
  return weights;
}

VecHandle& at(std::vector<VecHandle>& list, int i) { return list[i]; }

}  // namespace

void DenseOutput::interpolate(Vec before, Vec after, double t, double dt, double s, Vec into) {
  refine(before, after, t, dt);
  polynomial(before, after, dt, s, into);
}

void DenseOutput::refine(Vec before, Vec after, double t, double dt) {
  if (degree_now_ == degree_) return;
  while (static_cast<int>(slopes_.size()) < std::max(2, degree_)) {
    slopes_.push_back(model_.create_vector());
    better_slopes_.push_back(model_.create_vector());
  }
  const auto slope = [&](double part, Vec u, Vec f) {
    model_.set_time(t + part * dt);
    model_.rhs(Part::full, u, f);
  };
  slope(0, before, at(slopes_, 0));
  slope(1, after, at(slopes_, 1));
  degree_now_ = 3;
  for (int degree = 4; degree <= degree_; ++degree) {
    const int count = degree;  // slopes of a polynomial of this degree
    const int last = degree_now_ == 3 ? 1 : degree_now_ - 1;
    for (int i = 1; i + 1 < count; ++i) {
      const double part = double(i) / double(count - 1);
      polynomial(before, after, dt, part, work_);
      slope(part, work_, at(better_slopes_, i));
    }
    std::swap(at(better_slopes_, 0), at(slopes_, 0));
    std::swap(at(better_slopes_, count - 1), at(slopes_, last));
    std::swap(slopes_, better_slopes_);
    degree_now_ = degree;
  }
}

void DenseOutput::polynomial(Vec before, Vec after, double dt, double s, Vec into) const {
  std::vector<double> weights;
  std::vector<Vec> terms;
  if (degree_now_ == 3) {
    weights = {(1 + 2 * s) * (1 - s) * (1 - s), s * s * (3 - 2 * s), dt * s * (1 - s) * (1 - s),
               dt * s * s * (s - 1)};
    terms = {before, after, slopes_[0], slopes_[1]};
  } else {
    weights = integration_weights(degree_now_, s);
    for (double& w : weights) w *= dt;
    for (int i = 0; i < degree_now_; ++i) terms.push_back(slopes_[i]);
    weights.push_back(1);
    terms.push_back(before);
  }
  SS_TRY(VecZeroEntries(into));
  SS_TRY(VecMAXPY(into, terms.size(), weights.data(), terms.data()));
}

// The memory of several steps does not begin anew within one: its polynomial goes through values alone.
void ShorterStep::set_up(FusedStepper* fused, const Method& method, Implicit implicit, bool adaptive) {
  fused_ = fused;
  implicit_ = implicit;
  adaptive_ = adaptive;
  const Capabilities can = capabilities(method);
  // a polynomial in eta says nothing of a psi that goes by its exponential
  always_ = can.falls_short || (fused && model_.scene().massless() && can.degree > 0);
  asks_ = always_ || (implicit != Implicit::none && !can.remembers);
  spec_.type = method.type;
  spec_.subtype = method.subtype;
  spec_.implicit = to_string(implicit);
}

// The fastest of what is taken implicitly; without mass that is how eta goes back to where psi lets it.
double ShorterStep::rate(Vec u) const {
  double fastest = 0;
  if (const Scene& s = model_.scene(); s.massless()) {
    const Reading a(u);
    for (PetscInt i = 0; i < model_.local(); ++i) {
      const double* const at = a + i * model_.dof();
      const double slope = s.B() + model_.friction(i, at[0], model_.dof() == 3 ? at[2] : 0).F_psi;
      if (slope > 0) fastest = std::max(fastest, (s.K0() + 4 * s.K1()) / slope);
    }
    return std::max(largest_over(model_.comm(), fastest), model_.friction_rate(u));
  }
  if (implicit_ != Implicit::wave) fastest = model_.friction_rate(u);
  if (implicit_ != Implicit::friction) fastest = std::max(fastest, stencil_rate(model_.scene()));
  return fastest;
}

bool ShorterStep::is_needed(Vec before, Vec after, double dt) {
  if (always_ || !asks_) return always_;
  if (looked_) return stiff_;
  looked_ = true;
  return stiff_ = 4. / 27 * dt * std::max(rate(before), rate(after)) > 1;
}

// Where a shorter step has no solution although the step had one, what is left is the line between its ends.
void ShorterStep::take(Vec before, Vec after, double t, double dt, double s, const Tolerances& tolerances,
                       Vec into) {
  if (fused_ ? fused_->shorter(s, into) : take_by_library(before, t, s * dt, tolerances, into)) return;
  SS_TRY(VecCopy(before, into));
  SS_TRY(VecAXPBY(into, s, 1 - s, after));
}

bool ShorterStep::take_by_library(Vec before, double t, double length, const Tolerances& tolerances, Vec u) {
  SS_TRY(VecCopy(before, u));
  if (!own_) {
    MethodSpec spec = spec_;
    if (!adaptive_) spec.step = length;
    own_ = std::make_unique<Integrator>(model_, spec, u, "between_");
  }
  own_->set_tolerances(tolerances);
  own_->set_next_step(length);
  const double time = model_.time();
  bool done = true;
  try {
    own_->advance(u, t, t + length, {});
  } catch (const Failure&) {
    done = false;
  }
  model_.set_time(time);
  return done;
}

}  // namespace stickslip
