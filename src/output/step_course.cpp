#include "output/step_course.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// Steeper than three times the way from end to end a cubic between two values is not monotone: slopes that
// are (of stiff steps) say nothing of where it passes between them.
double bounded(double slope, double way) { return std::clamp(slope, -3 * std::abs(way), 3 * std::abs(way)); }

}  // namespace

NodeRates::NodeRates(const Model& model) : model_(model) {
  const bool steep = model.local() > 0 && model.friction_law(0).steep && model.scene().K1() != 0;
  if (model.viscous() || model.scene().massless() || steep)
    halo_.emplace(model.scene(), NodeRange::of(model));
}

void NodeRates::look_beside(const double* u) {
  psi_.resize(std::size_t(model_.local()));
  for (std::size_t i = 0; i < psi_.size(); ++i) psi_[i] = u[i * std::size_t(model_.dof())];
  fetched_ = halo_->fetch(psi_);
}

double NodeRates::beside(PetscInt local_node) const {
  const Scene& s = model_.scene();
  const PetscInt node = model_.first() + local_node;
  double sum = 0;
  for (const auto& [j, factor] : model_.viscous() ? second_difference_row(s, node) : coupling_row(s, node))
    sum += factor * halo_->at(j, psi_, fetched_);
  return model_.viscous() ? s.N() * sum : sum;
}

double NodeRates::of(PetscInt local_node, const NodeMoment& at, double aside, double dt) const {
  if (model_.held(model_.first() + local_node)) return 0;
  const Scene& s = model_.scene();
  const double least = std::copysign(std::numeric_limits<double>::min(), aside);
  const double psi = at.psi == 0 && s.friction.sticks() ? least : at.psi;
  const NodeCoefficients c = model_.coefficients(local_node);
  Partials F = model_.friction_law(local_node).partials(psi, at.state);
  const double factor = at.normal * model_.amplitude()[local_node];
  F = {factor * F.F, factor * F.F_psi, factor * F.F_state};
  if (!s.massless() && (model_.viscous() || !(4. / 27 * dt * c.A * (c.B + F.F_psi) > 1)))
    return c.A * (at.eta + (model_.viscous() ? at.beside : 0) - c.B * psi - F.F);
  // the balance, along which psi goes: that of eta and the state, of neighbours too
  if (s.forced() || (!halo_ && s.n > 1)) return unknown;
  const double of_state = model_.dof() == 3 ? F.F_state * model_.state_rate(local_node, psi, at.state).g : 0;
  return (c.K0 * (s.v - psi) + at.beside - of_state) / (c.B + F.F_psi);
}

StepCourse::StepCourse(double psi0, double psi1, double rate0, double rate1, double dt)
    : HermiteCubic(psi0, psi1, std::isfinite(rate0) ? dt * rate0 : psi1 - psi0,
                   std::isfinite(rate1) ? dt * rate1 : psi1 - psi0) {}

double StepCourse::rise_to(double level) const {
  const double y1 = (*this)(1), m1 = slope(1), way = y1 - y0;
  const HermiteCubic between(y0, y1, bounded(m0, way), bounded(m1, way));
  return find_root([&](double s) { return between(s) - level; },
                   {0, y0 - level, 1, std::max(0., y1 - level)}, 0);
}

double StepCourse::part_below(double level, double begin) const {
  std::array<double, 4> turns = {begin, 1, 1, 1};  // from one to the next it is monotone
  std::size_t count = 1;
  extrema([&](double s) { turns[count++] = std::max(s, begin); });
  if (count == 3 && turns[2] < turns[1]) std::swap(turns[1], turns[2]);
  double sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double a = turns[k], b = turns[k + 1], at_a = (*this)(a) - level, at_b = (*this)(b) - level;
    if ((at_a <= 0) == (at_b <= 0)) {
      sum += at_a <= 0 ? b - a : 0;
    } else {
      const double s = find_root([&](double x) { return (*this)(x) - level; }, {a, at_a, b, at_b}, 0);
      sum += at_a <= 0 ? s - a : b - s;
    }
  }
  return sum;
}

double StepCourse::part_within(double level, double begin) const {
  return part_below(level, begin) - part_below(-level, begin);
}

}  // namespace stickslip
