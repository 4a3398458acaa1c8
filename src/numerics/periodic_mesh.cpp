
#include "stickslip/numerics/periodic_equations.hpp"

#include <algorithm>
#include <cmath>

#include "numerics/mesh_solve.hpp"
#include "stickslip/numerics/roots.hpp"

namespace stickslip {

void evaluate(const Collocation& method, const std::vector<double>& mesh, const double* x, int d,
              double phase, double* y) {
  phase -= std::floor(phase);
  const size_t n = mesh.size() - 1;
  const size_t i =
      std::min(size_t(std::upper_bound(mesh.begin(), mesh.end(), phase) - mesh.begin() - 1), n - 1);
  double w[mesh_stages + 1];
  method.basis.weights((phase - mesh[i]) / (mesh[i + 1] - mesh[i]), w);
  const double* points = x + i * d * (mesh_stages + 1);
  for (int a = 0; a < d; ++a) {
    y[a] = 0;
    for (int j = 0; j <= mesh_stages; ++j) y[a] += w[j] * points[j * d + a];
  }
}

std::vector<double> roughness(const std::vector<double>& mesh, const double* x, int d) {
  const size_t n = mesh.size() - 1, b = d * (mesh_stages + 1);
  std::vector<double> low(d, 1e300), high(d, -1e300), top(n * d);
  const std::vector<double>& coefficient = Collocation::gauss5().basis.leading();
  for (size_t i = 0; i < n; ++i)
    for (int a = 0; a < d; ++a) {
      double sum = 0;
      for (size_t j = 0; j <= mesh_stages; ++j) {
        const double value = x[i * b + j * d + a];
        low[a] = std::min(low[a], value);
        high[a] = std::max(high[a], value);
        sum += coefficient[j] * value;
      }
      top[i * d + a] = sum / std::pow(mesh[i + 1] - mesh[i], mesh_stages);
    }
  std::vector<double> range(d), jump(n), result(n);
  for (int a = 0; a < d; ++a)  // of one that stands still round-off is no range
    range[a] = std::max({high[a] - low[a], 1e-12 * std::max(std::abs(high[a]), std::abs(low[a])), 1e-300});
  for (size_t i = 0; i < n; ++i) {
    const size_t next = i + 1 < n ? i + 1 : 0;
    const double h = (mesh[i + 1] - mesh[i] + mesh[next + 1] - mesh[next]) / 2;
    for (int a = 0; a < d; ++a)
      jump[i] = std::max(
          jump[i], std::abs(top[next * d + a] - top[i * d + a]) / h / range[a]);
  }
  for (size_t i = 0; i < n; ++i) result[i] = std::max(jump[i], jump[i > 0 ? i - 1 : n - 1]);
  return result;
}

namespace {

std::vector<double> densities(std::vector<double> rough) {
  for (double& r : rough) r = std::pow(r, 1. / (mesh_stages + 1));
  return rough;
}

double whole(const std::vector<double>& mesh, const std::vector<double>& density) {
  double total = 0;
  for (size_t i = 0; i < density.size(); ++i) total += density[i] * (mesh[i + 1] - mesh[i]);
  return total;
}

}  // namespace

double intervals_for(const std::vector<double>& mesh, const std::vector<double>& rough, double error) {
  return whole(mesh, densities(rough)) / std::pow(error, 1. / (mesh_stages + 1));
}

std::vector<double> equidistribute(const std::vector<double>& mesh, const std::vector<double>& rough,
                                   size_t intervals) {
  const size_t n = mesh.size() - 1;
  const std::vector<double> density = densities(rough);
  const double total = whole(mesh, density);
  // a tenth of the points spread evenly in phase, a tenth over the old mesh, so that no part is left bare
  std::vector<double> sum(n + 1, 0.);
  for (size_t i = 0; i < n; ++i)
    sum[i + 1] = sum[i] + (.8 * density[i] / total + .1) * (mesh[i + 1] - mesh[i]) + .1 / double(n);
  std::vector<double> result{0};
  size_t i = 0;
  for (size_t k = 1; k < intervals; ++k) {
    const double target = sum[n] * double(k) / double(intervals);
    while (sum[i + 1] < target) ++i;
    result.push_back(mesh[i] + (mesh[i + 1] - mesh[i]) * (target - sum[i]) / (sum[i + 1] - sum[i]));
  }
  result.push_back(1);
  return result;
}

bool suits(const std::vector<double>& mesh, const std::vector<double>& rough, double error) {
  constexpr double uneven = 1.6, few = .8, many = 2;  // of the share, and of the intervals wanted
  const std::vector<double> density = densities(rough);
  const double n = double(density.size()), total = whole(mesh, density);
  const double wanted = total / std::pow(error, 1. / (mesh_stages + 1));
  if (n < few * wanted || n > many * wanted) return false;
  for (size_t i = 0; i < density.size(); ++i)
    if (density[i] * (mesh[i + 1] - mesh[i]) > uneven * total / n) return false;
  return true;
}

std::vector<double> halved(const std::vector<double>& mesh) {
  std::vector<double> result;
  for (size_t i = 0; i + 1 < mesh.size(); ++i) {
    result.push_back(mesh[i]);
    result.push_back((mesh[i] + mesh[i + 1]) / 2);
  }
  result.push_back(1);
  return result;
}

std::vector<double> ranges(const double* x, std::size_t points, int d) {
  std::vector<double> result;
  for (int a = 0; a < d; ++a) {
    double low = 1e300, high = -1e300;
    for (std::size_t i = 0; i < points; ++i) {
      const double value = x[i * d + a];
      low = std::min(low, value);
      high = std::max(high, value);
    }
    result.push_back(high - low);
  }
  return result;
}

double value_within(const std::vector<double>& values, std::size_t interval, double part) {
  double w[mesh_stages + 1], sum = 0;
  Collocation::gauss5().basis.weights(part, w);
  for (std::size_t j = 0; j <= mesh_stages; ++j) sum += w[j] * values[interval * (mesh_stages + 1) + j];
  return sum;
}

// The best point, then the polynomials' own extremum beside it.
double extremum(const std::vector<double>& values, int sign) {
  std::size_t best = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (sign * values[i] > sign * values[best]) best = i;
  const std::size_t interval = best / (mesh_stages + 1), n = values.size() / (mesh_stages + 1);
  double value = values[best];
  for (const std::size_t i : {interval, (interval + n - 1) % n, (interval + 1) % n}) {
    // flat on top: a place known to 1e-9 tells the value to the last digit
    const Least least = find_least([&](double part) { return -sign * value_within(values, i, part); }, 0, 1,
                                   1e-9, [](double) { return false; });
    value = sign * std::max(sign * value, -least.value);
  }
  return value;
}

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
