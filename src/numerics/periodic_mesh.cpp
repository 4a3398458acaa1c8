#include "stickslip/numerics/periodic_mesh.hpp"

#include <algorithm>
#include <cmath>

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

}  // namespace stickslip
