#include "stickslip/waves/branch.hpp"

#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/continuation.hpp"
#include "waves/train_field.hpp"

namespace stickslip {

namespace {

struct TrainLook : Look {
  Train train;
};

// The trains of a family. The places are (z(0), q, lambda), each over its scale.
class Trains : public Family {
 public:
  Trains(std::function<TrainCase(double)> cases, const Train& first, double from, double range)
      : z_scale_(ranges(first.values.data(), points_on(first.mesh), first.oscillator->dim())[1]),
        range_(range), least_(1e-3 * (first.psi_max - first.psi_min)), cases_(std::move(cases)),
        there_{{PeriodicEquations(first.mesh, fields_of(cases_), from, range), {}}, {}}, here_(there_) {
    there_.x = there_.equations.fill(profile_of(first), TrainField(cases_(from)).number_of(first));
  }

  void solve(double length, const Place& row, double right) override {
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
  // psi passes v at phase 0 as it did at the beginning where the orbit is a true one; past the Hopf point the
  // branch repeats itself half a turn on.
  std::shared_ptr<Look> look() override {
    auto seen = std::make_shared<TrainLook>();
    Train& train = seen->train = pack(field(), there_);
    train.error_estimate = 1e-9 * (train.length_given ? std::abs(train.speed) : train.length);
    double dy[train_max_dim];
    field().placed(there_.q()).rates(there_.x.data(), dy);
    const double range = train.psi_max - train.psi_min;
    const bool true_one = train.oscillator->side() * dy[0] > 0 && range >= least_;
    seen->value = there_.x.back();
    seen->period = train.period;
    seen->amplitude = (true_one ? 1 : -1) * range / 2;
    return seen;
  }
  void accept() override { here_ = there_; }
  Words words() const override { return {"train", "wave_steps", ", where sliding becomes stable"}; }

 private:
  struct Stand : TrainSolution {
    std::vector<double> t;  // tangent in all unknowns, of length 1 in the places
  };
  TrainField field() const { return TrainField(cases_(there_.x.back())); }
  std::vector<Condition> conditions(const Place& row, double right) const {
    return train_conditions(there_.equations.dim(), {row[0] / z_scale_, row[1], row[2] / range_}, right);
  }
  Place place_of(const std::vector<double>& x) const {
    return {x[1] / z_scale_, x[x.size() - 2], x.back() / range_};
  }

  double z_scale_, range_, least_;  // of psi, which is not nothing
  std::function<TrainCase(double)> cases_;
  Stand there_, here_;
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
  Trains trains(family.at, first, from, std::abs(to - from));
  const std::string option = "wave_continue " + family.name + ": ";
  Place along;
  try {
    along = trains.tangent({0, 0, to > from ? 1. : -1.});
  } catch (const Failure&) {
    throw Failure(option + "the train does not change with it, or turns back at once");
  }
  if (!(std::abs(along[0]) + std::abs(along[1]) > 0) && !asked.request.speed)
    check_that_it_enters(family, from, to);
  Followed followed = follow(trains, {family.name, from, to, steps});
  Branch branch{{}, std::move(followed.special), std::move(followed.end)};
  for (const std::shared_ptr<Look>& look : followed.points)
    branch.points.push_back({look->value, std::move(static_cast<TrainLook&>(*look).train), false});
  branch.points.front().train = first;
  for (const SpecialPoint& special : branch.special)
    if (special.kind == "fold" && special.after + 1 < branch.points.size())
      branch.points[special.after + 1].fold = true;
  return branch;
}

const Train& train_at(const SpecialPoint& point) { return static_cast<const TrainLook&>(*point.there).train; }

}  // namespace stickslip
