#include "cycles/cell_field.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/model/stencil.hpp"
#include "stickslip/numerics/continuation.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

Frictions smooth_friction(const Scene& scene, bool forced) {
  const FrictionParameters& p = scene.friction;
  if (p.sticks() && !forced)
    throw UsageError("friction_law " + to_string(p.law) +
                     " jumps at rest, which collocation in time cannot follow: set "
                     "friction_stick to regularised");
  Frictions laws(scene, 0, scene.n);
  if (scene.massless() && !laws[0].steep)
    throw UsageError("-model_m 0: friction_law " + to_string(p.law) +
                     " may fall with psi, where a block without mass has several velocities under one "
                     "force; take model_m > 0, or friction with a direct effect (rate-and-state)");
  return laws;
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
      by_d2_(slope_in_d2(no_friction_)), massless_(scene.massless()),
      dof_(scene.friction.has_state() ? 3 : 2), periods_(periods),
      sliding_(!scene.friction.sticks() ? 0
               : scene.v < 0            ? -1
                                        : 1) {
  scales_ = scales_of(scene).slip;
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
  last_psi_.assign(node_.size(), scene.v);
}

double CellField::psi(const double* y, std::size_t k) const {
  const double* const at = y + k * std::size_t(width());
  if (!massless_) return at[0];
  const double found = massless(k).velocity(at[0], dof_ == 3 ? at[1] : 0, last_psi_[k]);
  if (std::isfinite(found)) last_psi_[k] = found;
  return found;
}
void CellField::numbers(const double* y, std::size_t k, double* into) const {
  const std::size_t w = std::size_t(width());
  into[0] = psi(y, k);
  std::copy_n(y + k * w + (massless_ ? 0 : 1), dof_ - 1, into + 1);
}

Joints CellField::joints() const {
  Joints joints{{}, joints_of(scene_.friction)};
  for (int a = 0; a < dim() && !massless_; a += dof_) joints.velocities.push_back(a);
  return joints;
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

// By differences, which keep the digits that 1/h^2 would eat.
double CellField::d2_of_psi(std::size_t k, const std::vector<double>& psi) const {
  double d2 = held_[k].sum - held_[k].weight * psi[k];
  for (const TurnedTerm& t : row_[k]) d2 += t.weight * (psi[std::size_t(t.node)] - psi[k]);
  return d2;
}

void CellField::massless_rates(const Loads& loads, const double* y, double* f) const {
  const std::size_t w = std::size_t(width());
  std::vector<double> velocity;
  for (std::size_t k = 0; k < node_.size(); ++k) velocity.push_back(psi(y, k));
  for (std::size_t k = 0; k < node_.size(); ++k) {
    double* out = f + k * w;
    out[0] = coefficients(k, 0).K0 * (loads.v - velocity[k]) + by_d2_.eta_psi * d2_of_psi(k, velocity);
    if (dof_ == 3) out[1] = rate_at(k, velocity[k], y[k * w + 1]).g;
  }
}

void CellField::massless_jacobian(const double* y, double* J) const {
  const std::size_t d = std::size_t(dim()), w = std::size_t(width());
  std::fill(J, J + d * d, 0.);
  std::vector<std::array<double, 2>> by;  // dpsi by eta and by the state
  for (std::size_t k = 0; k < node_.size(); ++k) {
    const double velocity = psi(y, k), state = dof_ == 3 ? y[k * w + 1] : 0;
    const MasslessNode::Slopes slopes = massless(k).slopes(velocity, state);
    by.push_back({slopes.by_eta, slopes.by_state});
    if (dof_ < 3) continue;
    const RatePartials g = rate_at(k, velocity, state);
    double* const row = J + (k * w + 1) * d + k * w;
    row[0] = g.g_psi * slopes.by_eta;
    row[1] = g.g_state + g.g_psi * slopes.by_state;
  }
  for (std::size_t k = 0; k < node_.size(); ++k) {
    double* const row = J + k * w * d;
    const double K0 = coefficients(k, 0).K0;
    for (std::size_t b = 0; b < w; ++b) row[k * w + b] -= K0 * by[k][b];
    for (const TurnedTerm& t : row_[k])
      for (std::size_t b = 0; b < w; ++b)
        row[std::size_t(t.node) * w + b] += t.weight * by_d2_.eta_psi * by[std::size_t(t.node)][b];
  }
}

void CellField::rates_under(const Loads& loads, const double* y, double* f) const {
  if (massless_) return massless_rates(loads, y, f);
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
  if (massless_) return massless_jacobian(y, J);
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
  if (massless_) return;  // the force is an unknown
  const double N = loads_at(phase).N;
  for (std::size_t k = 0; k < node_.size(); ++k) {
    if (!friction(k).steep || amplitude_[k] == 0) continue;
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
    const std::size_t first = k * std::size_t(width());
    if (!massless_) into[first] = by_d2_.psi_psi;
    into[first + (massless_ ? 0 : 1)] = by_d2_.eta_psi;
    feed.into.push_back(std::move(into));
    feed.of.push_back(first);
  }
  if (massless_) feed.width = std::size_t(width());
  return feed;
}

std::vector<double> CellField::feed_slopes(const double* y) const {
  std::vector<double> by;
  for (const std::size_t k : massless_ ? nodes_at_ends(row_) : std::vector<std::size_t>()) {
    const auto [by_eta, by_state] = massless(k).slopes(psi(y, k), dof_ == 3 ? y[k * width() + 1] : 0);
    by.push_back(by_eta);
    if (dof_ == 3) by.push_back(by_state);
  }
  return by;
}

double CellField::fastest(double kappa2) const {
  const double stiffness = scene_.K0() + scene_.K1() * kappa2;
  if (massless_) return std::abs(stiffness);
  const double decay = scene_.A() * scene_.N() * std::abs(kappa2);  // by viscosity between neighbours
  return std::max(decay, std::sqrt(std::max(0., scene_.A() * stiffness)));
}

double CellField::reach(double h, const std::vector<double>& slopes) const {
  double most = massless_ ? 0 : 1;
  for (std::size_t k = 0; k < slopes.size(); k += std::size_t(width())) most = std::max(most, slopes[k]);
  return most * h;
}

// Without mass a deviation obeys lambda^2 + c1 lambda + c0 = 0 with c0 = K r dpsi/deta (linear_point.hpp).
double CellField::speed(const double* y) const {
  if (!massless_) return std::sqrt(scene_.A() * scene_.K1());
  double most = 0;
  for (std::size_t k = 0; k < node_.size() && dof_ == 3; ++k) {
    const double velocity = psi(y, k), state = y[k * 2 + 1];
    most = std::max(most, -massless(k).slopes(velocity, state).by_eta * rate_at(k, velocity, state).g_state);
  }
  return std::sqrt(scene_.K1() * most);
}

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

namespace {

using std::size_t;

// Place of the field's k-th node among all that are solved for, from left to right.
size_t place(const CellField& field, size_t k) {
  return size_t(field.node(k) - (field.scene().left == End::velocity ? 1 : 0));
}

// Friction smoothed over eps is that of a node at rest, to 1e-3 of the threshold, where |psi| is below this
// many eps.
constexpr double rest_in_eps = 4;

// A linear functional of y along a profile: its polynomials between the points of a mesh.
class Trace {
 public:
  Trace(const std::vector<double>& mesh, const std::vector<double>& values, size_t d,
        std::vector<double> weights)
      : mesh_(mesh), points_(mesh_stages + 1) {
    for (size_t i = 0; i < values.size() / d; ++i) {
      double sum = 0;
      for (size_t a = 0; a < d; ++a) sum += weights[a] * values[i * d + a];
      at_.push_back(sum);
    }
  }
  size_t intervals() const { return mesh_.size() - 1; }
  double extremum(int sign) const { return stickslip::extremum(at_, sign); }
  // Part of the period in which |value| < bound; two crossings between neighbouring points are not seen.
  double share_below(double bound) const {
    double share = 0;
    const std::vector<double>& points = Collocation::gauss5().basis.points();
    for (size_t i = 0; i < intervals(); ++i)
      for (size_t j = 0; j < points_; ++j) {
        const double begin = points[j], end = j + 1 < points_ ? points[j + 1] : 1;
        share += (mesh_[i + 1] - mesh_[i]) * length_below(bound, i, begin, end);
      }
    return share;
  }

 private:
  double length_below(double bound, size_t i, double begin, double end) const {
    const auto excess = [&](double part) { return std::abs(value_within(at_, i, part)) - bound; };
    const double a = excess(begin), b = excess(end);
    if (a < 0 && b < 0) return end - begin;
    if (a >= 0 && b >= 0) return 0;
    const double crossing = find_root(excess, {begin, a, end, b}, 1e-9);
    return a < 0 ? crossing - begin : end - crossing;
  }

  const std::vector<double>& mesh_;
  size_t points_;
  std::vector<double> at_;
};

}  // namespace

std::vector<double> in_band_order(const CellField& field, const double* natural) {
  const size_t dof = size_t(field.dof()), width = size_t(field.width());
  std::vector<double> y(size_t(field.dim()));
  for (size_t k = 0; k < field.nodes(); ++k)
    std::copy_n(natural + place(field, k) * dof + (dof - width), width, &y[k * width]);
  return y;
}

void unfold(const CellField& field, const double* y, double* natural) {
  const size_t dof = size_t(field.dof());
  for (size_t k = 0; k < field.nodes(); ++k) field.numbers(y, k, natural + place(field, k) * dof);
}

Cycle cycle_of(const CellField& field, const std::vector<double>& mesh, const std::vector<double>& values,
               double period) {
  const size_t dof = size_t(field.dof()), nodes = field.nodes(), d = nodes * dof,
               width = size_t(field.dim());
  Cycle cycle;
  cycle.nodes = PetscInt(nodes);
  cycle.dof = field.dof();
  cycle.period = period;
  cycle.forcing_periods = field.periods();
  const std::vector<double>& points = Collocation::gauss5().basis.points();
  for (size_t i = 0; i + 1 < mesh.size(); ++i)
    for (const double part : points)
      cycle.times.push_back(period * (mesh[i] + (mesh[i + 1] - mesh[i]) * part));
  std::vector<double> all(cycle.times.size() * d);  // what there is of each node, in the order of the field
  for (size_t k = 0; k < cycle.times.size(); ++k)
    for (size_t node = 0; node < nodes; ++node)
      field.numbers(&values[k * width], node, &all[k * d + node * dof]);
  std::vector<double> shown(all);  // without the harmonic force
  for (size_t k = 0; k < cycle.times.size(); ++k)
    for (size_t node = 0; node < nodes; ++node)
      shown[k * d + node * dof + 1] -= field.scene().push(cycle.times[k]);
  cycle.states.resize((cycle.times.size() + 1) * d);
  for (size_t k = 0; k < cycle.times.size(); ++k)
    for (size_t node = 0; node < nodes; ++node)
      std::copy_n(&shown[k * d + node * dof], dof, &cycle.states[k * d + place(field, node) * dof]);
  std::copy_n(cycle.states.begin(), d, cycle.states.end() - long(d));
  cycle.times.push_back(period);
  measure(cycle);
  const bool rests = field.scene().friction.regularised && field.scene().friction.jumps_at_rest();
  double range = 0, rest = 0;
  for (size_t k = 0; k < nodes; ++k) {
    std::vector<double> psi(d);
    psi[k * dof] = 1;
    const Trace trace(mesh, all, d, psi);
    const double low = trace.extremum(-1), high = trace.extremum(1);
    cycle.psi_min = std::min(cycle.psi_min, low);
    cycle.psi_max = std::max(cycle.psi_max, high);
    range = std::max(range, high - low);
    if (rests) rest += trace.share_below(rest_in_eps * field.scene().friction.eps) / double(nodes);
  }
  cycle.amplitude = range / 2;
  cycle.rest_fraction = rest;
  std::vector<double> mean_eta(d);
  for (size_t k = 0; k < nodes; ++k) mean_eta[k * dof + 1] = 1 / double(nodes);
  const Trace force(mesh, shown, d, mean_eta);
  cycle.force_drop = force.extremum(1) - force.extremum(-1);
  return cycle;
}

Condition plane_through(const VectorField& field, const std::vector<double>& y,
                        const std::vector<double>& middle) {
  Condition plane;
  std::vector<double>& normal = plane.y0;
  normal.resize(y.size());
  field.rates(y.data(), normal.data());
  std::vector<double> radius = y;
  for (std::size_t a = 0; a < y.size(); ++a) {  // both in units of the components
    radius[a] = (radius[a] - middle[a]) / field.unit(int(a));
    normal[a] /= field.unit(int(a));
  }
  const double part = dot(radius, radius) > 0 ? dot(normal, radius) / dot(radius, radius) : 0;
  for (std::size_t a = 0; a < y.size(); ++a) normal[a] -= part * radius[a];
  const double length = std::sqrt(dot(normal, normal));
  for (std::size_t a = 0; a < y.size(); ++a) normal[a] /= length * field.unit(int(a));
  plane.right = dot(normal, y);
  return plane;
}

Condition plane_across(const VectorField& field, const std::vector<double>& y) {
  return plane_through(field, y, y);
}

Condition plane_of(std::size_t k, const std::vector<double>& y) {
  Condition plane;
  plane.y0.assign(y.size(), 0.);
  plane.y0[k] = 1;
  plane.right = y[k];
  return plane;
}

Condition number_of(std::size_t unknowns, std::size_t k) {
  Condition condition;
  condition.y0.assign(unknowns, 0.);
  condition.y0[k] = 1;
  condition.q = -1;
  return condition;
}

std::vector<double> mean_of(const std::vector<double>& mesh, const double* x, std::size_t d) {
  const Collocation& gauss = Collocation::gauss5();
  std::vector<double> mean(d);
  for (std::size_t i = 0; i + 1 < mesh.size(); ++i)
    for (std::size_t j = 0; j < mesh_stages; ++j)
      for (std::size_t a = 0; a < d; ++a)
        mean[a] += (mesh[i + 1] - mesh[i]) * gauss.b[j] * x[(i * (mesh_stages + 1) + j + 1) * d + a];
  return mean;
}

}  // namespace stickslip
