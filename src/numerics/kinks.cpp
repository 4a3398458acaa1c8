#include "numerics/kinks.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/numerics/periodic_mesh.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

namespace {

using std::size_t;
constexpr double same_place = 1e-14;  // of a zero, in phase
constexpr double moves = .3;          // of an interval: how near a node is that is moved

size_t nearest_node(const std::vector<double>& mesh, double phase) {
  const size_t above = size_t(std::lower_bound(mesh.begin(), mesh.end(), phase) - mesh.begin());
  if (above == 0 || above == mesh.size()) return above == 0 ? 0 : mesh.size() - 1;
  return phase - mesh[above - 1] < mesh[above] - phase ? above - 1 : above;
}

bool differ(const std::vector<double>& a, const std::vector<double>& b) {
  for (size_t k = 0; k < a.size(); ++k)
    if (!(std::abs(a[k] - b[k]) <= 1e-9 * (std::abs(a[k]) + std::abs(b[k])))) return true;
  return false;
}

}  // namespace

double Kinks::farthest_off(const std::vector<double>& mesh) const {
  double off = 0;
  for (const double phase : phases) off = std::max(off, std::abs(mesh[nearest_node(mesh, phase)] - phase));
  return off;
}

Kinks kinks_of(const std::vector<double>& mesh, const double* x, int d, const Joints& joints,
               const std::function<void(const double*, double*)>& jacobian) {
  Kinks kinks;
  std::vector<double> passed;  // phases of levels
  const std::vector<double>& at = Collocation::gauss5().basis.points();
  std::vector<double> y(d);
  const auto jacobian_beside = [&](int velocity, double value) {
    std::vector<double> J(y.size() * y.size());
    y[velocity] = value;
    jacobian(y.data(), J.data());
    return J;
  };
  const size_t n = mesh.size() - 1, points = mesh_stages + 1;
  const auto look_for = [&](int velocity, double level) {
    const auto value = [&](double phase) {
      evaluate(Collocation::gauss5(), mesh, x, d, phase, y.data());
      return y[velocity] - level;
    };
    for (size_t k = 0; k < n * points; ++k) {
      const size_t next = k + 1 < n * points ? k + 1 : 0;
      const double low = x[k * d + velocity] - level, high = x[next * d + velocity] - level;
      if (!(low * high < 0) && high != 0) continue;
      const auto phase_of = [&](size_t j) {
        return mesh[j / points] + (mesh[j / points + 1] - mesh[j / points]) * at[j % points];
      };
      const double begin = phase_of(k), end = next == 0 ? 1 : phase_of(next);
      const double zero = high == 0 ? end : find_root(value, {begin, low, end, high}, same_place);
      if (std::isnan(zero)) continue;
      if (level != 0) {
        passed.push_back(zero);
        continue;
      }
      (void)value(zero);
      const std::vector<double> above = jacobian_beside(velocity, 1e-30),
                                below = jacobian_beside(velocity, -1e-30);
      if (!differ(above, below)) continue;
      kinks.phases.push_back(zero);
      kinks.singular = kinks.singular || differ(above, jacobian_beside(velocity, 1e-40));
    }
  };
  for (const int velocity : joints.velocities) {
    look_for(velocity, 0);
    for (const double level : joints.levels) look_for(velocity, level);
  }
  if (passed.size() <= n) kinks.phases.insert(kinks.phases.end(), passed.begin(), passed.end());
  std::sort(kinks.phases.begin(), kinks.phases.end());
  return kinks;
}

std::vector<double> with_nodes(std::vector<double> mesh, const Kinks& kinks) {
  std::vector<double> fixed{0, 1};  // nodes that stay where they are
  for (const double phase : kinks.phases) {
    const size_t k = nearest_node(mesh, phase);
    const double off = phase - mesh[k];
    if (off == 0) continue;
    const double interval = off > 0 ? mesh[k + 1] - mesh[k] : mesh[k] - mesh[k - 1];
    const bool stays = std::find(fixed.begin(), fixed.end(), mesh[k]) != fixed.end();
    fixed.push_back(phase);
    if (!stays && std::abs(off) < moves * interval)
      mesh[k] = phase;
    else if (std::abs(off) > 1e-3 * interval)
      mesh.insert(mesh.begin() + long(off > 0 ? k + 1 : k), phase);
  }
  return mesh;
}

}  // namespace stickslip
