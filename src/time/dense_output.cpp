#include "time/dense_output.hpp"

#include <petscts.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/dense.hpp"

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

int DenseOutput::degree_for(const Method& method) {
  const std::string name = method.name();
  if (name == "rk:5dp" || name == "arkimex:4" || name == "arkimex:5" || method.type == std::string(TSBDF))
    return 0;
  return method.kind == MethodKind::explicit_ ? std::max(3, method.order - 1) : 3;
}

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

}  // namespace stickslip
