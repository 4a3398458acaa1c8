#include "waves/viscous_train.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "numerics/kinks.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/periodic_equations.hpp"

namespace stickslip {

namespace {

using std::size_t;

// y = (f, z[, s], g).
class TrainField : public VectorField {
 public:
  TrainField(std::shared_ptr<const Oscillator> oscillator, double N, double V)
      : o_(std::move(oscillator)), N_(N), V_(V), r2_(1 - o_->c2() / (V * V)) {}
  int dim() const override { return o_->dim() + 1; }
  void rates(const double* y, double* f) const override { viscous_rhs(*o_, N_, V_, r2_, y, f, nullptr); }
  void jacobian(const double* y, double* J) const override {
    double f[train_max_dim + 1];
    viscous_rhs(*o_, N_, V_, r2_, y, f, J);
  }

 private:
  std::shared_ptr<const Oscillator> o_;
  double N_, V_, r2_;
};

// The equations at a viscosity and a speed or length, with a solution of them.
class ViscousProfile {
 public:
  // The plain train, of which this is nearly one.
  ViscousProfile(const Scene& scene, const Train& plain, double N)
      : o_(plain.oscillator), pulses_(double(plain.pulses)), v_(scene.v), problem_(at(plain, N)) {
    x_ = problem_.fill(
        [&](double phase, double* y) {
          double dy[4];
          plain.at(phase, y);
          o_->rhs(plain.r2, y, dy, nullptr);
          y[o_->dim()] = dy[0];
        },
        std::log(plain.period));
  }

  double N() const { return N_; }
  double T() const { return std::exp(problem_.q(x_)); }
  double V() const { return length_ > 0 ? std::exp(problem_.lambda(x_)) : speed_; }
  double L() const { return pulses_ * V() * T(); }
  const PeriodicEquations& problem() const { return problem_; }
  const std::vector<double>& x() const { return x_; }
  void value(double phase, double* y) const { problem_.at(x_, phase, y); }

  // Newton's method where this stands; false where it does not converge to a train.
  bool solve() {
    const PeriodicEquations::Newton newton = problem_.newton(x_, conditions());
    last_step_ = newton.last_step;
    residual_ = newton.residual;
    return newton.converged && oscillates() && V() * V() > o_->c2();
  }
  // To another viscosity, or another length.
  bool move(double N, double length) {
    const ViscousProfile before = *this;
    N_ = N;
    if (length_ > 0) length_ = length;
    remesh(equidistribute(mesh(), rough(), mesh().size() - 1));
    if (solve()) return true;
    *this = before;
    return false;
  }
  // On a mesh of so many intervals that suits the profile.
  bool refine(size_t intervals) {
    remesh(equidistribute(mesh(), rough(), intervals));
    return solve();
  }
  bool halve() {
    remesh(halved(mesh()));
    return solve();
  }
  // With nodes at the kinks; what a change by halving is to be divided by.
  double converge() {
    return settle_on_kinks({[&]() -> const std::vector<double>& { return mesh(); },
                            [&] {
                              return kinks_of(
                                  mesh(), x_.data(), problem_.dim(), {0},
                                  [&](const double* y, double* J) { problem_.field().jacobian(y, J); });
                            },
                            [&](std::vector<double> nodes) {
                              const ViscousProfile before = *this;
                              remesh(std::move(nodes));
                              if (solve()) return true;
                              *this = before;
                              return false;
                            }});
  }
  double intervals_wanted(double error) const { return intervals_for(mesh(), rough(), error); }
  double residual() const { return residual_; }
  double last_step() const { return last_step_; }
  const std::vector<double>& mesh() const { return problem_.mesh(); }

  // Largest change of psi between two of the same train, at the points of the finer.
  double change_from(const ViscousProfile& coarse) const {
    const std::vector<double> from = problem_.fill(coarse.problem_, coarse.x_);
    double change = 0;
    for (size_t i = 0; i + size_t(problem_.parameters()) < x_.size(); i += size_t(problem_.dim()))
      change = std::max(change, std::abs(from[i] - x_[i]));
    return change;
  }

 private:
  PeriodicEquations at(const Train& plain, double N) {
    N_ = N;
    if (plain.length_given) length_ = plain.length;
    speed_ = std::abs(plain.speed);
    return equations(plain.mesh, std::log(speed_));
  }
  PeriodicEquations equations(const std::vector<double>& mesh, double log_speed) const {
    if (!(length_ > 0)) return PeriodicEquations(mesh, std::make_shared<const TrainField>(o_, N_, speed_));
    const FieldFamily family = [o = o_, N = N_](double log_V) -> std::shared_ptr<const VectorField> {
      return std::make_shared<const TrainField>(o, N, std::exp(log_V));
    };
    return PeriodicEquations(mesh, family, log_speed, 1);
  }
  void remesh(const std::vector<double>& mesh) {
    PeriodicEquations next = equations(mesh, std::log(V()));
    x_ = next.fill(problem_, x_);
    problem_ = std::move(next);
  }
  // f(0) = v, and ln V + ln T = ln(L/n)
  std::vector<Condition> conditions() const {
    Condition phase;
    phase.y0.assign(size_t(problem_.dim()), 0.);
    phase.y0[0] = 1;
    phase.right = v_;
    if (!(length_ > 0)) return {phase};
    Condition fits;
    fits.y0.assign(size_t(problem_.dim()), 0.);
    fits.q = fits.lambda = 1;
    fits.right = std::log(length_ / pulses_);
    return {phase, fits};
  }
  bool oscillates() const {
    double low = 1e300, high = -1e300;
    for (size_t i = 0; i + size_t(problem_.parameters()) < x_.size(); i += size_t(problem_.dim())) {
      low = std::min(low, x_[i]);
      high = std::max(high, x_[i]);
    }
    return high - low > 1e-6 * (1 + std::abs(v_));
  }
  std::vector<double> rough() const { return roughness(mesh(), x_.data(), problem_.dim()); }

  std::shared_ptr<const Oscillator> o_;
  double pulses_, v_, N_ = 0, length_ = 0, speed_ = 0, residual_ = 0, last_step_ = 0;
  PeriodicEquations problem_;
  std::vector<double> x_;
};

// From N, L where the course stands to others, in steps of either's logarithm that adapt. False where it does
// not get there.
bool lead(ViscousProfile& course, double N, double L) {
  const double from[] = {std::log(course.N()), std::log(course.L())}, to[] = {std::log(N), std::log(L)};
  double done = 0,
         step = std::min(1., 0.7 / std::max({std::abs(to[0] - from[0]), 5 * std::abs(to[1] - from[1]), 0.7}));
  for (int k = 0; done < 1; ++k) {
    if (k == 400 || step < 1e-4) return false;
    const double next = std::min(1., done + step);
    const auto at = [&](int i) { return std::exp(from[i] + next * (to[i] - from[i])); };
    if (course.move(next == 1 ? N : at(0), next == 1 ? L : at(1))) {
      done = next;
      step *= 1.4;
    } else {
      step /= 2;
    }
  }
  return true;
}

// A course at a viscosity so small that the plain train is nearly one.
std::optional<ViscousProfile> begin(const Scene& scene, const Train& plain) {
  const double V2 = plain.speed * plain.speed, excess = V2 * plain.r2;  // V^2 - c^2
  double N = std::min(scene.N(), 0.01 * excess * excess / V2 / (scene.A() * scene.A()));
  for (int k = 0; k < 6; ++k, N /= 10) {
    ViscousProfile course(scene, plain, N);
    if (course.solve()) return course;
  }
  return std::nullopt;
}

[[noreturn]] void fail(const TrainRequest& request, const std::string& why) {
  const std::string what = request.length ? "of length " + rounded_text(*request.length, 8)
                                          : "at the speed " + rounded_text(*request.speed, 8);
  throw Failure("no train of " + std::to_string(request.pulses) +
                (request.pulses == 1 ? " pulse " : " pulses ") + what + ": " + why);
}

// The plain train of the request, or of a longer ring where the plain medium has none of its length.
Train plain_train(const Scene& scene, const TrainRequest& request) {
  Scene plain = scene;
  plain.nu = 0;
  TrainRequest longer = request;
  for (int k = 0;; ++k) {
    try {
      return solve_train(plain, longer, 1e-8);
    } catch (const Failure&) {
      if (!request.length || k == 24) throw;
      *longer.length *= 1.25;
    }
  }
}

Train packed(const Scene& scene, const TrainRequest& request, const ViscousProfile& course,
             std::shared_ptr<const Oscillator> oscillator) {
  Train train;
  const double V = course.V();
  train.pulses = request.pulses;
  train.length_given = bool(request.length);
  train.speed = request.speed ? *request.speed : V;
  train.period = course.T();
  train.length = request.length ? *request.length : course.L();
  train.r2 = 1 - oscillator->c2() / (V * V);
  train.nu = scene.nu;
  train.oscillator = std::move(oscillator);
  train.method = &Collocation::gauss5();
  train.mesh = course.mesh();
  set_viscous_values(train, {course.x().begin(), course.x().end() - course.problem().parameters()});
  find_extrema(train);
  train.residual = course.residual();
  return train;
}

}  // namespace

void viscous_rhs(const Oscillator& oscillator, double N, double V, double r2, const double* y, double* dy,
                 double* J) {
  const int d = oscillator.dim(), n = d + 1;
  const double stiffness = V * V / N / oscillator.A();
  double inner[train_max_dim * train_max_dim];
  oscillator.rhs(1, y, dy, J ? inner : nullptr);
  dy[d] = stiffness * (r2 * y[d] - dy[0]);
  dy[0] = y[d];
  if (!J) return;
  std::fill(J, J + n * n, 0.);
  for (int j = 0; j < d; ++j) {
    J[d * n + j] = -stiffness * inner[j];
    for (int i = 1; i < d; ++i) J[i * n + j] = inner[i * d + j];
  }
  J[d] = 1;
  J[d * n + d] = stiffness * r2;
}

void set_viscous_values(Train& train, std::vector<double> y) {
  const Oscillator& o = *train.oscillator;
  const size_t d = size_t(o.dim());
  train.values.clear();
  for (size_t k = 0; k < y.size(); k += d + 1) {
    double dy[train_max_dim];
    o.rhs(1, &y[k], dy, nullptr);
    train.values.push_back(y[k]);
    // eta = z + (K1/V^2) g - (s delta/A) f, put into Oscillator::eta and solved for its z
    train.values.push_back(y[k + 1] + (1 - train.r2) * (train.r2 * y[k + d] - dy[0]) / o.A());
    if (d == 3) train.values.push_back(y[k + 2]);
  }
  train.viscous_values = std::move(y);
}

Train solve_viscous_train(const Scene& scene, const TrainRequest& request, double tolerance) {
  const Train plain = plain_train(scene, request);
  std::optional<ViscousProfile> course = begin(scene, plain);
  if (!course) fail(request, "Newton's method does not reach it from the train without viscosity");
  if (!lead(*course, scene.N(), course->L()))
    fail(request, "followed from the train without viscosity it ends at model_nu " +
                      rounded_text(scene.nu * course->N() / scene.N(), 6));
  if (request.length && plain.length != *request.length && !lead(*course, scene.N(), *request.length))
    fail(request, "followed from longer rings it ends at length " + rounded_text(course->L(), 6) +
                      ", V = " + rounded_text(course->V(), 6));
  double least = 12;
  for (int round = 0; round < 12; ++round) {
    const double wanted = course->intervals_wanted(std::max(tolerance, 1e-12) * 10);
    const size_t intervals = size_t(std::min(20000., std::max(least, .5 * wanted)));
    least = 1.5 * double(intervals);  // should there be a next round
    ViscousProfile better = *course;
    if (!better.refine(intervals)) continue;  // too coarse
    const double gain = better.converge();
    *course = better;
    ViscousProfile finer = better;
    if (!finer.halve()) continue;
    const double estimate =
        std::abs(request.speed ? better.T() / finer.T() - 1 : better.V() / finer.V() - 1) / gain;
    if (estimate > tolerance ||
        finer.change_from(better) / 32 > std::max({1e-9, tolerance, finer.last_step()}))
      continue;
    Train train = packed(scene, request, finer, plain.oscillator);
    train.error_estimate =
        (request.length ? train.speed : train.length) * (estimate + 4 * finer.last_step() + 4e-15);
    return train;
  }
  fail(request, "it needs more than " + std::to_string(course->mesh().size()) + " mesh intervals");
}

}  // namespace stickslip
