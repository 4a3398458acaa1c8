#include "stickslip/waves/branch.hpp"

#include <algorithm>
#include <cmath>

#include "base/pulse.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/continuation.hpp"
#include "waves/train_field.hpp"

namespace stickslip {

namespace {

// The trains of a family. The places are (z(0), q, lambda), each over its scale.
class TrainPath : public BranchPath {
 public:
  TrainPath(std::function<TrainCase(double)> cases, const Train& first, double from, double range)
      : z_scale_(ranges(first.values.data(), points_on(first.mesh), first.oscillator->dim())[1]),
        range_(range),
        cases_(std::move(cases)), there_{{PeriodicEquations(first.mesh, fields_of(cases_), from, range),
                                          {}},
                                         {}},
        here_(there_) {
    there_.x = there_.equations.fill(profile_of(first), TrainField(cases_(from)).number_of(first));
  }

  void go(double length, const Place& row, double right) override {
    there_ = here_;
    for (size_t k = 0; k < there_.x.size(); ++k) there_.x[k] += length * there_.t[k];
    const auto solve = [conditions = conditions(row, right)](auto& s) { return newton(s, conditions, 10); };
    solve_on_suiting_mesh(solve, {1e-9, 60}, there_);
  }
  Place place() const override { return place_of(there_.x); }
  Place tangent(const Place& row) override {
    there_.t = there_.equations.tangent(there_.x, conditions(row, 0));
    const Place t = place_of(there_.t);
    const double length = std::sqrt(dot(t, t));
    for (double& value : there_.t) value /= length;
    return place_of(there_.t);
  }
  void accept() override { here_ = there_; }

  double value() const { return there_.x.back(); }
  // The candidate, before its tangent is asked for; and its dpsi/dt at phase 0.
  Train train() {
    Train train = pack(field(), there_);
    train.error_estimate = 1e-9 * (train.length_given ? std::abs(train.speed) : train.length);
    return train;
  }
  double slope() const {
    double dy[train_max_dim + 1];
    field().placed(there_.q()).rates(there_.x.data(), dy);
    return dy[0];
  }

 private:
  struct Stand : TrainSolution {
    std::vector<double> t;  // tangent in all unknowns, of length 1 in the places
  };
  TrainField field() const { return TrainField(cases_(value())); }
  std::vector<Condition> conditions(const Place& row, double right) const {
    return train_conditions(there_.equations.dim(), {row[0] / z_scale_, row[1], row[2] / range_}, right);
  }
  Place place_of(const std::vector<double>& x) const {
    return {x[1] / z_scale_, x[x.size() - 2], x.back() / range_};
  }

  double z_scale_, range_;
  std::function<TrainCase(double)> cases_;
  Stand there_, here_;
};

class TrainWalk : public Continuation {
 public:
  TrainWalk(TrainPath& path, const Train& first, const std::string& name, double from, double to, int steps)
      : Continuation(path, name, from, to, steps), path_(path), heading_(to > from ? 1 : -1) {
    branch_.points.push_back({from, first, false});
  }
  Branch follow(int steps) {
    try {
      branch_.end = Continuation::follow().value_or("wave_steps " + std::to_string(steps) + " taken");
    } catch (const Interrupted& e) {  // the next beat tells it again
      branch_.end = std::string("stopped by ") + e.what();
    }
    return branch_;
  }
  bool begins_along_parameter() const { return !(std::abs(t_[0]) + std::abs(t_[1]) > 0); }

 private:
  double value() const override { return path_.value(); }
  End reached(double) override {
    next_ = {value(), path_.train(), false};
    return std::nullopt;
  }
  // psi passes v at phase 0 as it did at the beginning where the orbit is a true one; past the Hopf point the
  // branch repeats itself half a turn on.
  End turned(double, const Place& tangent) override {
    const Train &first = branch_.points.front().train, &train = next_.train;
    const auto range = [](const Train& of) { return of.psi_max - of.psi_min; };
    if (first.oscillator->side() * path_.slope() > 0 && range(train) >= 1e-3 * range(first)) {
      // A canard's parameter stands still to the last digit: only a change of direction beyond round-off is
      // a fold.
      next_.fold = tangent.back() * heading_ < -1e-9;
      return std::nullopt;
    }
    // lambda is even in the amplitude: extrapolate to zero from the last two points
    const BranchPoint& last = branch_.points.back();
    const double a1 = std::pow(range(last.train), 2), a2 = std::pow(range(train), 2);
    const double hopf = a1 != a2 ? (next_.value * a1 - last.value * a2) / (a1 - a2) : next_.value;
    return "the amplitude vanishes at " + name_ + " = " + rounded_text(hopf, 8) +
           ", where sliding becomes stable";
  }
  End accepted() override {
    if (next_.fold) heading_ = -heading_;
    branch_.points.push_back(next_);
    return std::nullopt;
  }
  std::string stuck(const std::string&) override {
    return "no train is found beyond " + name_ + " = " + rounded_text(branch_.points.back().value, 12);
  }

  TrainPath& path_;
  Branch branch_;
  BranchPoint next_{};
  double heading_;
};

// Throws Failure for an option that does not enter a train of given length.
void check_that_it_enters(const TrainFamily& family, double from, double to) {
  const TrainField start(family.at(from)), moved(family.at(from + .01 * (to - from)));
  if (moved.oscillator()->A() == start.oscillator()->A() && moved.anchor() == start.anchor())
    throw Failure("wave_continue " + family.name + ": this option does not enter the train");
}

}  // namespace

Branch continue_train(const TrainFamily& family, double from, double to, int steps) {
  const TrainCase asked = family.at(from);
  (void)TrainField(asked);  // refuses what has no trains
  const Train first = solve_train(asked.scene, asked.request);
  TrainPath path(family.at, first, from, std::abs(to - from));
  TrainWalk walk(path, first, family.name, from, to, steps);
  try {
    walk.begin();
  } catch (const Failure&) {
    throw Failure("wave_continue " + family.name +
                  ": the train does not change with it, or turns back at once");
  }
  if (walk.begins_along_parameter() && !asked.request.speed) check_that_it_enters(family, from, to);
  return walk.follow(steps);
}

}  // namespace stickslip
