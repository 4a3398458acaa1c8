#include "cycles/cell_field.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/stencil.hpp"

namespace stickslip {

namespace {

Frictions smooth_friction(const Scene& scene, bool forced) {
  const FrictionParameters& p = scene.friction;
  if (p.sticks() && !forced)
    throw UsageError("friction_law " + to_string(p.law) +
                     " jumps at rest, which collocation in time cannot follow: set "
                     "friction_stick to regularised");
  return Frictions(scene, 0, scene.n);
}

// f is linear in D2 psi, as in its symbol.
NodeBlock slope_in_d2(const LinearPoint& point) {
  const NodeBlock without = point.block(Part::full, 0), with = point.block(Part::full, 1);
  NodeBlock slope;
  slope.psi_psi = without.psi_psi - with.psi_psi;
  slope.eta_psi = without.eta_psi - with.eta_psi;
  return slope;
}

}  // namespace

CellField::CellField(const Scene& scene, int periods)
    : scene_(scene), friction_(smooth_friction(scene, periods > 0)),
      coefficients_(kernel::coefficients_of(scene)), no_friction_(scene, 0),
      by_d2_(slope_in_d2(no_friction_)), dof_(scene.friction.has_state() ? 3 : 2), periods_(periods),
      sliding_(!scene.friction.sticks() ? 0
               : scene.v < 0            ? -1
                                        : 1) {
  scales_ = slip_scales(scene);
  std::vector<PetscInt> all;
  for (PetscInt i = 0; i < scene.n; ++i)
    if (!scene.held(i)) all.push_back(i);
  if (all.empty()) throw UsageError("every node of the scene is held: nothing can oscillate");
  if (periods > 0 && !(scene.forcing_period() > 0)) throw UsageError("the sine of the load has no amplitude");
  for (std::size_t k = 0; k < all.size(); ++k) {
    const std::size_t half = k / 2;
    node_.push_back(!scene.ring() ? all[k] : k % 2 == 0 ? all[half] : all[all.size() - 1 - half]);
  }
  const std::vector<double> amplitude = friction_amplitude(scene, 0, scene.n);
  for (const PetscInt node : node_) {
    amplitude_.push_back(amplitude[node]);
    if (scene.linker_dieterich != 0) response_.push_back(scene.state_response(node));
    if (scene.medium.nodes_differ()) own_.push_back(scene.coefficients(node));
    couple(node);
  }
}

// The row of D2 of one node.
void CellField::couple(PetscInt node) {
  const auto place = [&](PetscInt of) {
    return std::size_t(std::find(node_.begin(), node_.end(), of) - node_.begin());
  };
  TurnedRow row;
  Held held;
  const auto add = [&](PetscInt of, double weight, int turns) {
    const std::size_t k = place(of);
    if (k == node_.size()) {
      held.weight += weight;
      held.sum += weight * (of == 0 ? scene_.left_value : scene_.right_value);
      return;
    }
    row.push_back({PetscInt(k), weight, turns});
    reach_ = std::max(reach_, std::abs(int(k) - int(place(node))));
  };
  if (scene_.ring()) {
    for (const auto& [there, weight, turns] : turned_row(scene_, node)) add(there, weight, turns);
  } else {
    for (const auto& [there, weight] : row_over_mean(scene_, node)) add(there, weight, 0);
  }
  row_.push_back(std::move(row));
  held_.push_back(held);
}

Partials CellField::friction_at(std::size_t k, double psi, double state) const {
  return sliding_ == 0 ? friction(k).partials(psi, state)
                       : friction(k).sliding_partials(psi, state, sliding_);
}

RatePartials CellField::rate_at(std::size_t k, double psi, double state) const {
  if (dof_ < 3) return {0, 0, 0};
  return sliding_ == 0 ? friction(k).rate_partials(psi, state)
                       : friction(k).sliding_rate(psi, state, sliding_);
}

VectorField::Period CellField::period(double q) const {
  if (periods_ == 0) return VectorField::period(q);
  return {periods_ * scene_.forcing_period(), 0};
}

CellField::Loads CellField::loads_at(double phase) const {
  if (periods_ == 0) return steady_loads();
  const double t = phase * period(0).T, N = scene_.normal_load(t);
  return {scene_.load.varies() ? scene_.load(t) : scene_.v, N, scene_.normal.slope(t) / N};
}

void CellField::rates_under(const Loads& loads, const double* y, double* f) const {
  for (std::size_t k = 0; k < node_.size(); ++k) {
    const double* at = y + k * std::size_t(dof_);
    const double psi = at[0], state = dof_ == 3 ? at[2] : 0;
    // by differences, which keep the digits that 1/h^2 would eat
    double d2 = held_[k].sum - held_[k].weight * psi;
    for (const TurnedTerm& t : row_[k]) d2 += t.weight * (y[std::size_t(t.node) * std::size_t(dof_)] - psi);
    const double force = loads.N * amplitude_[k] *
                         (sliding_ == 0 ? friction(k).force(psi, state) : friction_at(k, psi, state).F);
    const kernel::NodeRates rates = kernel::node_rates(coefficients(k, loads.v), psi, at[1], force, 0, 1);
    double* out = f + k * std::size_t(dof_);
    out[0] = rates.psi + by_d2_.psi_psi * d2;
    out[1] = rates.eta + by_d2_.eta_psi * d2;
    if (dof_ == 3) out[2] = rate_at(k, psi, state).g;
    if (loads.log_rate != 0 && !response_.empty()) out[2] -= response_[k] * loads.log_rate;
  }
}

// Of a node without neighbours.
kernel::Coefficients CellField::coefficients(std::size_t k, double v) const {
  if (!own_.empty()) return {own_[k].A, own_[k].B, own_[k].K0, v, own_[k].s_delta, {}};
  kernel::Coefficients c = coefficients_;
  c.v = v;
  return c;
}
LinearPoint CellField::without_friction(std::size_t k) const {
  return own_.empty() ? no_friction_ : LinearPoint(scene_, own_[k]);
}

LinearPoint CellField::point(double N, const double* y, std::size_t k) const {
  const double* at = y + k * std::size_t(dof_);
  const double psi = at[0], state = dof_ == 3 ? at[2] : 0, a = N * amplitude_[k];
  const Partials F = friction_at(k, psi, state);
  LinearPoint p = without_friction(k);
  p.set({a * F.F, a * F.F_psi, a * F.F_state}, rate_at(k, psi, state));
  return p;
}

void CellField::jacobian_under(double N, const double* y, double* J) const {
  const std::size_t d = std::size_t(dim()), dof = std::size_t(dof_);
  std::fill(J, J + d * d, 0.);
  for (std::size_t k = 0; k < node_.size(); ++k) {
    double rows[9];
    point(N, y, k).block(Part::full, 0).write(dof_, rows);
    for (std::size_t a = 0; a < dof; ++a)
      for (std::size_t b = 0; b < dof; ++b) J[(k * dof + a) * d + k * dof + b] = rows[a * dof + b];
    for (const TurnedTerm& t : row_[k]) {
      double* const by_psi = J + k * dof * d + std::size_t(t.node) * dof;
      by_psi[0] += t.weight * by_d2_.psi_psi;
      by_psi[d] += t.weight * by_d2_.eta_psi;
    }
  }
}

// Rate-and-state friction, nearly a logarithm of psi: to the psi that carries the force that Newton's step
// leads to.
void CellField::safeguard_step(double phase, const double* y, double h, double* dy) const {
  const double N = loads_at(phase).N;
  for (std::size_t k = 0; k < node_.size(); ++k) {
    if (!friction(k).steep) continue;
    const double* at = y + k * std::size_t(dof_);
    double* step = dy + k * std::size_t(dof_);
    const double state = dof_ == 3 ? at[2] : 0, new_state = dof_ == 3 ? at[2] + step[2] : 0;
    const LinearPoint own = without_friction(k);
    const double mass = (own.B + 1 / (own.A * h)) / (N * amplitude_[k]);
    step[0] = friction(k).newton_psi(at[0], state, at[0] + step[0], new_state, mass) - at[0];
  }
}

LowRankCoupling CellField::feed() const {
  LowRankCoupling feed;
  for (const std::size_t k : nodes_at_ends(row_)) {
    std::vector<double> into(dim());
    into[k * std::size_t(dof_)] = by_d2_.psi_psi;
    into[k * std::size_t(dof_) + 1] = by_d2_.eta_psi;
    feed.into.push_back(std::move(into));
    feed.of.push_back(k * std::size_t(dof_));
  }
  return feed;
}

std::vector<double> CellField::weights_of_wave(double kappa2) const { return {-kappa2}; }

std::vector<std::complex<double>> CellField::weights_of_phase(double theta) const {
  return phase_weights(row_, nodes_at_ends(row_), theta);
}

std::vector<double> CellField::sliding() const {
  std::vector<double> y;
  for (std::size_t k = 0; k < node_.size(); ++k) {
    const double state = dof_ == 3 ? friction(k).steady_state(scene_.v) : 0;
    y.push_back(scene_.v);
    y.push_back(without_friction(k).B * scene_.v + amplitude_[k] * friction_at(k, scene_.v, state).F);
    if (dof_ == 3) y.push_back(state);
  }
  return y;
}

}  // namespace stickslip
