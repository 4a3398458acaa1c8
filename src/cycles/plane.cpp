#include "cycles/plane.hpp"

#include <cmath>

namespace stickslip {

namespace {

double dot(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

}  // namespace

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
