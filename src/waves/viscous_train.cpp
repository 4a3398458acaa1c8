// Trains in a medium with viscosity between neighbours: that of the plain medium, at the same speed or
// length, with N made larger step by step.
#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <optional>

#include "stickslip/base/error.hpp"
#include "waves/train_field.hpp"

namespace stickslip {

namespace {

// A train at a viscosity and a speed or length, by its collocation equations.
class ViscousProfile {
 public:
  // The plain train, of which this is nearly one.
  ViscousProfile(const Train& plain, const TrainRequest& request, double N)
      : field_(at(plain, request, N)), solution_{PeriodicEquations(plain.mesh, field_), {}} {
    solution_.x = solution_.equations.fill(
        [&](double phase, double* y) {
          double dy[train_max_dim];
          plain.at(phase, y);
          plain.oscillator->rhs(plain.r2, y, dy, nullptr);
          y[plain.oscillator->dim()] = dy[0];
        },
        field_->number_of(plain));
  }

  double N() const { return field_->N(); }
  double V() const { return field_->placed(solution_.q()).speed(); }
  double L() const {
    const double q = solution_.q();
    return double(field_->request().pulses) * V() * field_->placed(q).period(q).T;
  }
  const TrainSolution& solution() const { return solution_; }
  // Newton's method; false where it does not converge to a train.
  bool solve() { return solve(solution_); }
  // To another viscosity, or another length.
  bool move(double N, double length) {
    TrainRequest request = field_->request();
    if (request.length) request.length = length;
    const auto there = std::make_shared<const TrainField>(field_->oscillator(), request, N);
    const auto mesh = equidistribute(solution_.mesh(), solution_.rough(), solution_.mesh().size() - 1);
    TrainSolution s{PeriodicEquations(mesh, there), {}};
    s.x = s.equations.fill(solution_.equations, solution_.x);
    if (!solve(s)) return false;
    field_ = there;
    solution_ = std::move(s);
    return true;
  }

 private:
  static SharedTrain at(const Train& plain, TrainRequest request, double N) {
    if (request.length) request.length = plain.length;
    return std::make_shared<const TrainField>(plain.oscillator, request, N);
  }
  static bool solve(TrainSolution& s) {
    return solve_train_on_mesh(s) &&
           ranges(s.x.data(), points_on(s.mesh()), s.equations.dim())[0] > 1e-6 * s.equations.field().unit(0);
  }

  SharedTrain field_;
  TrainSolution solution_;
};

// From N, L where the profile stands to others, in steps of either's logarithm that adapt. False where it
// does not get there.
bool lead(ViscousProfile& profile, double N, double L) {
  const double from[] = {std::log(profile.N()), std::log(profile.L())}, to[] = {std::log(N), std::log(L)};
  double done = 0,
         step = std::min(1., 0.7 / std::max({std::abs(to[0] - from[0]), 5 * std::abs(to[1] - from[1]), 0.7}));
  for (int k = 0; done < 1; ++k) {
    if (k == 400 || step < 1e-4) return false;
    const double next = std::min(1., done + step);
    const auto at = [&](int i) { return std::exp(from[i] + next * (to[i] - from[i])); };
    if (profile.move(next == 1 ? N : at(0), next == 1 ? L : at(1))) {
      done = next;
      step *= 1.4;
    } else {
      step /= 2;
    }
  }
  return true;
}

// A profile at a viscosity so small that the plain train is nearly one.
std::optional<ViscousProfile> begin(const Scene& scene, const Train& plain, const TrainRequest& request) {
  const double V2 = plain.speed * plain.speed, excess = V2 * plain.r2;  // V^2 - c^2
  double N = std::min(scene.N(), 0.01 * excess * excess / V2 / (scene.A() * scene.A()));
  for (int k = 0; k < 6; ++k, N /= 10) {
    ViscousProfile profile(plain, request, N);
    if (profile.solve()) return profile;
  }
  return std::nullopt;
}

std::string none_of(const TrainRequest& request) {
  const std::string what = request.length ? "of length " + rounded_text(*request.length, 8)
                                          : "at the speed " + rounded_text(*request.speed, 8);
  return fmt::format("no train of {}{}{}: ", request.pulses, request.pulses == 1 ? " pulse " : " pulses ",
                     what);
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

}  // namespace

Train solve_viscous_train(const Scene& scene, const TrainRequest& request, double tolerance) {
  const std::string none = none_of(request);
  const Train plain = plain_train(scene, request);
  std::optional<ViscousProfile> profile = begin(scene, plain, request);
  if (!profile) throw Failure(none + "Newton's method does not reach it from the train without viscosity");
  if (!lead(*profile, scene.N(), profile->L()))
    throw Failure(none + "followed from the train without viscosity it ends at model_nu " +
                  rounded_text(scene.nu * profile->N() / scene.N(), 6));
  if (request.length && plain.length != *request.length && !lead(*profile, scene.N(), *request.length))
    throw Failure(fmt::format("{}followed from longer rings it ends at length {:.6g}, V = {:.6g}", none,
                              profile->L(), profile->V()));
  const auto train = train_to_accuracy(profile->solution(), tolerance, none + "it");
  if (!train) throw Failure(none + "Newton's method does not converge on a finer mesh");
  return *train;
}

}  // namespace stickslip
