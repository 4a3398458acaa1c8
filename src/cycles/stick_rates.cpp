// What stands on the right-hand side of a motion with exact stick and of its deviations, thresholds included.
#include <algorithm>
#include <array>

#include "cycles/stick_motion.hpp"
#include "stickslip/model/model.hpp"

namespace stickslip {

bool StickMotion::held(int node) const { return scene_.held(node); }

// Under a load of the plate alone N is 1.
double StickMotion::normal(const double* u) const {
  return scene_.normal.varies() ? scene_.normal(u[size() - 1]) : 1;
}
// The product in the order of rates(), so that a node at its threshold is there to the last bit.
double StickMotion::threshold(int node, const double* u) const {
  return normal(u) * amplitude_[node] * law_threshold(node, u);
}
double StickMotion::threshold_rate(int node, const double* u) const {
  if (!scene_.normal.varies()) return 0;
  return scene_.normal.slope(u[size() - 1]) * amplitude_[node] * law_threshold(node, u);
}
double StickMotion::law_threshold(int node, const double* u) const {
  return law_[node].threshold(dof_ == 3 ? u[node * dof_ + 2] : 0).value;
}
double StickMotion::threshold_slope(int node, const double* u) const {
  return dof_ == 2 ? 0 : normal(u) * amplitude_[node] * law_[node].threshold(u[node * dof_ + 2]).slope;
}
double StickMotion::neighbour_force(int node, const double* u) const {
  double sum = 0;
  if (d2_.empty() || scene_.nu == 0) return sum;
  for (const auto& [other, weight] : d2_[node])
    if (other != node) sum += weight * u[other * dof_];
  return scene_.N() * sum;
}

void StickMotion::rates(const std::vector<double>& direction, const double* u, double* f) const {
  std::array<double, 8> around{};
  for (std::size_t j = 0; j < halo_.size(); ++j)
    for (const auto& [node, weight] : halo_[j]) around[j] += weight * u[node * dof_];
  const double v = scene_.load.varies() ? scene_.load(u[size() - 1]) : scene_.v;
  if (forced()) f[size() - 1] = 1;
  const double* amplitude = scene_.unit_amplitude() ? nullptr : amplitude_.data();
  if (scene_.normal.varies()) {
    const double N = normal(u);
    std::transform(amplitude_.begin(), amplitude_.end(), factors_.begin(), [N](double a) { return N * a; });
    amplitude = factors_.data();
  }
  right_hand_side_.take(
      half_width_ > 0 ? Part::full : Part::pointwise, v,
      {u, amplitude, f, nodes_, around.data(), around.data() + half_width_, direction.data()});
  for (int i = 0; i < nodes_; ++i)
    if (held(i)) f[i * dof_] = f[i * dof_ + 1] = 0;  // its eta, which nothing feels, would drift
}

// J of each node alone.
void StickMotion::blocks(const std::vector<double>& direction, const double* u,
                         std::vector<NodeBlock>& at) const {
  at.resize(nodes_);
  const double N = normal(u);
  for (int i = 0; i < nodes_; ++i) {
    const double psi = u[i * dof_], s = dof_ == 3 ? u[i * dof_ + 2] : 0, going = direction[i];
    const double a = N * amplitude_[i];
    LinearPoint point = own_.empty() ? point_ : LinearPoint(scene_, own_[std::size_t(i)]);
    const Partials p = going == 0 ? Partials{0, 0, 0} : law_[i].sliding_partials(psi, s, going);
    point.set({a * p.F, a * p.F_psi, a * p.F_state}, law_[i].sliding_rate(psi, s, going));
    NodeBlock& block = at[i];
    block = going == 0 ? point.block_at_rest(Part::full) : point.block(Part::full);
    if (!held(i)) continue;
    block.psi_psi = block.psi_eta = block.psi_state = 0;
    block.eta_psi = block.eta_eta = block.eta_state = 0;
  }
}

// The right-hand side of the motion and of the first `count` deviations that stand behind it.
void StickMotion::derivative(const StickState& p, const double* y, std::size_t count, double* f) const {
  rates(p.direction, y, f);
  if (count == 0) return;
  std::vector<NodeBlock> at;
  blocks(p.direction, y, at);
  for (std::size_t c = 1; c <= count; ++c) {
    const double* x = y + c * size();
    double* g = f + c * size();
    if (forced()) g[size() - 1] = 0;
    for (int i = 0; i < nodes_; ++i) {
      const NodeBlock& b = at[i];
      const double *xi = x + i * dof_, s = dof_ == 3 ? xi[2] : 0;
      double* gi = g + i * dof_;
      gi[0] = b.psi_psi * xi[0] + b.psi_eta * xi[1] + b.psi_state * s;
      gi[1] = b.eta_psi * xi[0] + b.eta_eta * xi[1] + b.eta_state * s;
      if (dof_ == 3) gi[2] = b.state_psi * xi[0] + b.state_state * s;
      if (d2_.empty() || held(i)) continue;
      double coupling = 0;
      for (const auto& [node, weight] : d2_[i]) coupling += weight * x[node * dof_];
      gi[1] += point_.K1 * coupling;
      if (scene_.nu == 0 || p.direction[i] == 0) continue;
      gi[0] += point_.A * point_.N * coupling;
      gi[1] -= point_.s_delta * point_.N * coupling;
    }
  }
}

void StickMotion::jacobian(const std::vector<double>& direction, const double* u, double* J) const {
  std::fill(J, J + size() * size(), 0.);
  std::vector<NodeBlock> at;
  blocks(direction, u, at);
  const std::size_t dof = std::size_t(dof_);
  for (std::size_t i = 0; i < at.size(); ++i) {
    double rows[9];
    at[i].write(dof_, rows);
    for (std::size_t a = 0; a < dof; ++a)
      std::copy_n(rows + a * dof, dof, J + (i * dof + a) * size() + i * dof);
    if (d2_.empty() || held(int(i))) continue;
    const bool slides = direction[i] != 0;
    for (const auto& [node, weight] : d2_[i]) {
      J[(i * dof + 1) * size() + std::size_t(node) * dof] +=
          weight * (point_.K1 - (slides ? point_.s_delta * point_.N : 0));
      if (slides) J[i * dof * size() + std::size_t(node) * dof] += weight * point_.A * point_.N;
    }
  }
}

}  // namespace stickslip
