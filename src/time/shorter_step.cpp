#include "time/shorter_step.hpp"

#include <algorithm>
#include <cmath>

#include "base/broadcast.hpp"
#include "base/local_values.hpp"
#include "stickslip/base/error.hpp"

namespace stickslip {

// The memory of several steps does not begin anew within one: its polynomial goes through values alone.
void ShorterStep::set_up(FusedTs* fused, const Method& method, Implicit implicit, bool adaptive) {
  fused_ = fused;
  implicit_ = implicit;
  adaptive_ = adaptive;
  asks_ = implicit != Implicit::none && method.type != std::string(TSBDF) &&
          method.type != std::string(TSALPHA);
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

bool ShorterStep::is_stiff(Vec before, Vec after, double dt) {
  if (!asks_) return false;
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
  SS_TRY(TSSetTimeStep(own_->ts(), length));
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
