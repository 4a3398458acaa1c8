// The branch of a cycle of smooth friction: collocation with the parameter as one more unknown.
#include <algorithm>
#include <cmath>

#include "cycles/cell_field.hpp"
#include "cycles/deviations.hpp"
#include "cycles/plane.hpp"
#include "cycles/profile.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/cycles/smooth_cycle.hpp"

namespace stickslip {

namespace {

using std::size_t;

// Of Newton's method: rate-and-state friction, nearly a logarithm of psi, takes a dozen where psi is tiny.
constexpr int most_steps = 25;

class SmoothPath : public CyclePath {
 public:
  SmoothPath(std::function<Scene(double)> at, double from, double range, const SmoothCycle& first);

  void go(double length, const Place& row, double right) override;
  Place place() const override { return place_of(there_.y0(), there_.x); }
  Place tangent(const Place& row) override;
  Cycle cycle() const override { return smooth().cycle; }
  void accept() override;
  SmoothCycle smooth() const;

 private:
  struct Stand {
    std::vector<double> mesh, x;        // the last entries of x: q and lambda
    std::vector<double> t;              // tangent in all unknowns, of length 1 in the places
    double period_error = 0;            // relative: how far two meshes differ
    double q() const { return x[x.size() - 2]; }
    std::vector<double> y0() const { return {x.begin(), x.begin() + long(d)}; }
    size_t d = 0;
  };
  PeriodicEquations equations(const std::vector<double>& mesh, double lambda) const {
    return {mesh, family_, lambda, range_};
  }
  static Condition plane(const VectorField& of, const Stand& at) {
    return plane_through(of, at.y0(), mean_of(at.mesh, at.x.data(), at.d));
  }
  Place place_of(const std::vector<double>& y0, const std::vector<double>& x) const;
  Condition condition(const Place& row, double right) const;
  const CellField& field(double lambda) const {
    last_field_ = std::make_shared<const CellField>(scene_at_(lambda));
    return *last_field_;
  }

  std::function<Scene(double)> scene_at_;
  FieldFamily family_;
  double range_;
  std::vector<double> scale_;  // the range of each unknown in the first cycle
  size_t d_;
  Stand here_, there_;
  double turn_ = 1, candidate_turn_ = 1;  // -1 once the amplitude has passed through zero
  mutable std::shared_ptr<const CellField> last_field_;
};

SmoothPath::SmoothPath(std::function<Scene(double)> at, double from, double range, const SmoothCycle& first)
    : scene_at_(std::move(at)), range_(range), d_(size_t(first.field->dim())) {
  family_ = [scene_at = scene_at_](double lambda) { return std::make_shared<const CellField>(scene_at(lambda)); };
  for (size_t a = 0; a < d_; ++a) {
    double low = 1e300, high = -1e300;
    for (size_t i = a; i < first.values.size(); i += d_) {
      low = std::min(low, first.values[i]);
      high = std::max(high, first.values[i]);
    }
    scale_.push_back(std::max(high - low, 1e-12));
  }
  there_.d = d_;
  there_.mesh = first.mesh;
  there_.x = first.values;
  there_.x.push_back(std::log(first.cycle.period));
  there_.x.push_back(from);
  there_.period_error = first.cycle.error_estimate;
  here_ = there_;
}

Place SmoothPath::place_of(const std::vector<double>& y0, const std::vector<double>& x) const {
  Place p;
  for (size_t a = 0; a < d_; ++a) p.push_back(y0[a] / scale_[a]);
  p.push_back(x[x.size() - 2]);
  p.push_back(x.back() / range_);
  return p;
}

Condition SmoothPath::condition(const Place& row, double right) const {
  Condition c;
  for (size_t a = 0; a < d_; ++a) c.y0.push_back(row[a] / scale_[a]);
  c.q = row[d_];
  c.lambda = row[d_ + 1] / range_;
  c.right = right;
  return c;
}

void SmoothPath::go(double length, const Place& row, double right) {
  const double lambda = here_.x.back();
  PeriodicEquations problem = equations(here_.mesh, lambda);
  const std::vector<Condition> conditions{plane(problem.field(), here_), condition(row, right)};
  std::vector<double> x = here_.x;
  for (size_t k = 0; k < x.size(); ++k) x[k] += length * here_.t[k];
  if (!problem.newton(x, conditions, most_steps).converged) throw Failure("Newton's method does not converge");
  // again on a mesh that suits the new motion
  const std::vector<double> rough = roughness(problem.mesh(), x.data(), int(d_));
  const double error = d_ <= 12 ? 1e-9 : 1e-7;
  const double wanted = std::min(4000., std::max(d_ <= 12 ? 24. : 12., intervals_for(problem.mesh(), rough, error)));
  PeriodicEquations better = equations(equidistribute(problem.mesh(), rough, size_t(wanted)), problem.lambda(x));
  std::vector<double> y = better.fill(problem, x);
  if (!better.newton(y, conditions, most_steps).converged) throw Failure("Newton's method does not converge");
  Stand next;
  next.d = d_;
  next.mesh = better.mesh();
  next.period_error = std::abs(std::expm1(better.q(y) - problem.q(x))) + 4e-15;
  next.x = std::move(y);
  there_ = std::move(next);
  const Condition after = plane(field(there_.x.back()), there_);
  double dot = 0;
  for (size_t a = 0; a < d_; ++a) dot += after.y0[a] * conditions[0].y0[a];
  candidate_turn_ = dot < 0 ? -turn_ : turn_;
}

Place SmoothPath::tangent(const Place& row) {
  PeriodicEquations problem = equations(there_.mesh, there_.x.back());
  there_.t = problem.tangent(there_.x, {plane(problem.field(), there_), condition(row, 0)});
  Place t = place_of(there_.t, there_.t);
  double length = 0;
  for (const double value : t) length += value * value;
  length = std::sqrt(length);
  for (double& value : t) value /= length;
  for (double& value : there_.t) value /= length;
  return t;
}

void SmoothPath::accept() {
  here_ = there_;
  turn_ = candidate_turn_;
}

SmoothCycle SmoothPath::smooth() const {
  SmoothCycle result;
  const auto cell = std::make_shared<const CellField>(scene_at_(there_.x.back()));
  result.field = cell;
  result.mesh = there_.mesh;
  result.values.assign(there_.x.begin(), there_.x.end() - 2);
  PeriodicEquations problem(there_.mesh, cell);
  const std::vector<double> x(there_.x.begin(), there_.x.end() - 1);
  const PeriodicEquations::Step step = problem.step(x, {plane(*cell, there_)});
  result.cycle = cycle_of(*cell, result.mesh, result.values, std::exp(there_.q()));
  result.cycle.residual = step.residual;
  result.cycle.error_estimate = there_.period_error;
  result.cycle.tests["hopf"] = candidate_turn_ * result.cycle.amplitude;
  set_multipliers(result);
  return result;
}

}  // namespace

std::unique_ptr<CyclePath> smooth_path(std::function<Scene(double)> at, double from, double range,
                                       const SmoothCycle& first) {
  return std::make_unique<SmoothPath>(std::move(at), from, range, first);
}

SmoothCycle smooth_candidate(const CyclePath& path) { return dynamic_cast<const SmoothPath&>(path).smooth(); }

}  // namespace stickslip
