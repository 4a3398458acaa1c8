#include "stickslip/waves/branch.hpp"

#include <algorithm>
#include <cmath>

#include "numerics/mesh_solve.hpp"
#include "stickslip/base/error.hpp"
#include "waves/train_equations.hpp"

namespace stickslip {

namespace {

// (z(0), q, lambda) of a vector of unknowns.
std::vector<double> place(const TrainEquations& problem, const std::vector<double>& x) {
  const size_t last = problem.mesh().size() - 1;
  return {x[1], x[last * problem.block()], x[last * problem.block() + 1]};
}

// The walk along a branch: where it stands, and which way it goes.
class BranchWalk {
 public:
  BranchWalk(const TrainFamily& family, double from, double to);

  // Takes a step of at most `longest` and adds its point to the branch. False where the branch ends; `end`
  // says why.
  bool step(double longest, Branch& branch);
  const Train& first() const { return first_; }
  double value() const { return x_.back(); }
  void begin(double longest) { ds_ = longest / 2; }
  void shorten() { ds_ /= 2; }
  bool too_short() const { return ds_ < 1e-9; }

 private:
  TrainEquations problem_on(const std::vector<double>& mesh, double q, double lambda) const;
  // Tangent in all unknowns, of length 1 in the scaled (z, q, lambda), on the side of `row`.
  std::vector<double> tangent_at(TrainEquations& problem, const std::vector<double>& x,
                                 const std::vector<double>& row) const;
  // The solution near the tangent's end with `row` . place = right, on a mesh that suits it.
  TrainEquations solved(const std::vector<double>& row, double right, double length, std::vector<double>& y);
  bool vanished(const Train& train, const TrainEquations& problem, const std::vector<double>& y) const;

  std::string name_;
  double from_, to_;
  TrainEquations::Family family_;
  Train first_;
  double z_scale_, lambda_scale_;  // what the arclength is measured in
  std::unique_ptr<TrainEquations> problem_;
  std::vector<double> x_, t_;  // the point and its tangent
  double ds_ = 0, heading_;
};

BranchWalk::BranchWalk(const TrainFamily& family, double from, double to)
    : name_(family.name), from_(from), to_(to), heading_(to > from ? 1 : -1) {
  family_ = [at = family.at](double lambda) { return setting_of(at(lambda)); };
  const TrainSetting start = family_(from);
  const TrainCase asked = family.at(from);
  first_ = solve_train(asked.scene, asked.request);
  z_scale_ = ranges(first_.values.data(), points_on(first_.mesh), first_.oscillator->dim())[1];
  lambda_scale_ = std::abs(to - from);
  const double q = start.number_of(first_);
  problem_ = std::make_unique<TrainEquations>(problem_on(first_.mesh, q, from));
  x_ = problem_->fill(first_, q);
  x_.back() = from;
  try {  // begin along the parameter
    t_ = tangent_at(*problem_, x_, {0, 0, (to > from ? 1 : -1) / lambda_scale_});
  } catch (const Failure&) {
    throw Failure("wave_continue " + name_ + ": the train does not change with it, or turns back at once");
  }
  if (!(std::abs(place(*problem_, t_)[1]) + std::abs(place(*problem_, t_)[0]) > 0) && !asked.request.speed) {
    const TrainSetting moved = family_(from + .01 * (to - from));
    if (moved.oscillator->A() == start.oscillator->A() && moved.oscillator->v() == start.oscillator->v() &&
        moved.N == start.N)
      throw Failure("wave_continue " + name_ + ": this option does not enter the train");
  }
}

TrainEquations BranchWalk::problem_on(const std::vector<double>& mesh, double q, double lambda) const {
  TrainEquations problem(family_(lambda), mesh, q);
  problem.extend(family_, lambda_scale_, {0, 0, 1}, lambda);
  return problem;
}

std::vector<double> BranchWalk::tangent_at(TrainEquations& problem, const std::vector<double>& x,
                                           const std::vector<double>& row) const {
  problem.extend(family_, lambda_scale_, row, 0);
  problem.linearise(x.data());
  std::vector<double> rhs(x.size()), t(x.size());
  rhs.back() = 1;
  problem.solve(rhs.data(), t.data());
  const std::vector<double> p = place(problem, t);
  const double length = std::hypot(p[0] / z_scale_, std::hypot(p[1], p[2] / lambda_scale_));
  for (double& value : t) value /= length;
  return t;
}

TrainEquations BranchWalk::solved(const std::vector<double>& row, double right, double length,
                                  std::vector<double>& y) {
  using Solution = MeshSolution<TrainEquations>;
  Solution s{*problem_, x_};
  s.equations.extend(family_, lambda_scale_, row, right);
  for (size_t i = 0; i < x_.size(); ++i) s.x[i] += length * t_[i];
  const MeshSolver<TrainEquations> solver{
      [&](const std::vector<double>& mesh, const Solution& near) {
        TrainEquations problem(family_(near.x.back()), mesh, near.q());
        problem.extend(family_, lambda_scale_, row, right);
        return problem;
      },
      [](Solution& at) { return newton(at.equations, at.x, nullptr, 10); }};
  solve_on_suiting_mesh(solver, {1e-9, 60}, s);
  y = std::move(s.x);
  return std::move(s.equations);
}

// psi passes y[0] = v as it did at the beginning where the orbit is a true one; past the Hopf point the
// branch repeats itself half a turn on.
bool BranchWalk::vanished(const Train& train, const TrainEquations& problem,
                          const std::vector<double>& y) const {
  double slope[train_max_dim + 1];
  problem.setting().rhs(problem.setting().at(y[y.size() - 2]), y.data(), slope, nullptr);
  return first_.oscillator->side() * slope[0] <= 0 ||
         train.psi_max - train.psi_min < 1e-3 * (first_.psi_max - first_.psi_min);
}

bool BranchWalk::step(double longest, Branch& branch) {
  const std::vector<double> here = place(*problem_, x_), direction = place(*problem_, t_);
  const std::vector<double> row = {direction[0] / (z_scale_ * z_scale_), direction[1],
                                   direction[2] / (lambda_scale_ * lambda_scale_)};  // of the arclength
  // the last step goes to the end value exactly
  const double ahead = direction[2] != 0 ? (to_ - here[2]) / direction[2] : -1;
  const bool arrive = ahead > 0 && ahead <= 1.5 * ds_;
  const double length = arrive ? ahead : ds_;
  double right = arrive ? to_ : length;
  if (!arrive)
    for (size_t i = 0; i < 3; ++i) right += row[i] * here[i];
  std::vector<double> y;
  TrainEquations better = solved(arrive ? std::vector<double>{0, 0, 1} : row, right, length, y);
  const std::vector<double> there = place(better, y);
  const double moved = std::hypot((there[0] - here[0]) / z_scale_,
                                  std::hypot(there[1] - here[1], (there[2] - here[2]) / lambda_scale_));
  if (moved > 2 * length) throw Failure("the step left the branch");
  const std::vector<double> t_next = tangent_at(better, y, row), new_direction = place(better, t_next);
  // turning by more than a quarter of a right angle: the step was too long to trust
  double cosine = 0;
  for (size_t i = 0; i < 3; ++i) cosine += row[i] * new_direction[i];
  if (cosine < .92 && ds_ > 1e-4 && !arrive) throw Failure("the branch turns within the step");
  std::vector<double> F(better.size());
  Train train = pack(better, y);
  train.residual = better.largest_residual(y, F);
  train.error_estimate = 1e-9 * (train.length_given ? std::abs(train.speed) : train.length);
  if (vanished(train, better, y)) {
    // lambda is even in the amplitude: extrapolate to zero from the last two points
    const BranchPoint& last = branch.points.back();
    const double a1 = std::pow(last.train.psi_max - last.train.psi_min, 2);
    const double a2 = std::pow(train.psi_max - train.psi_min, 2);
    const double hopf = a1 != a2 ? (there[2] * a1 - last.value * a2) / (a1 - a2) : there[2];
    branch.end =
        "the amplitude vanishes at " + name_ + " = " + rounded_text(hopf, 8) +
        (train.nu > 0 ? ", where sliding becomes stable to this wave" : ", where sliding becomes stable");
    return false;
  }
  // A canard's parameter stands still to the last digit: only a change of direction beyond round-off is a
  // fold.
  const bool fold = new_direction[2] * heading_ < -1e-9 * lambda_scale_;
  if (fold) heading_ = -heading_;
  *problem_ = better;
  x_ = y;
  t_ = t_next;
  branch.points.push_back({there[2], train, fold});
  if (arrive) {
    branch.end = "reached " + name_ + " = " + rounded_text(to_, 8);
    return false;
  }
  if ((there[2] - from_) * (to_ - from_) < 0) {
    branch.end = "the branch came back past its start, " + name_ + " = " + rounded_text(from_, 8);
    return false;
  }
  if (cosine > .98) ds_ = std::min(longest, 1.4 * ds_);
  return true;
}

}  // namespace

Branch continue_train(const TrainFamily& family, double from, double to, int steps) {
  BranchWalk walk(family, from, to);
  Branch branch;
  branch.points.push_back({from, walk.first(), false});
  const double longest = std::max(.02, std::min(.2, 4. / steps));
  walk.begin(longest);
  while (branch.points.size() <= size_t(steps)) {
    if (walk.too_short()) {
      branch.end = "no train is found beyond " + family.name + " = " + rounded_text(walk.value(), 12);
      return branch;
    }
    try {
      if (!walk.step(longest, branch)) return branch;
    } catch (const Error&) {
      walk.shorten();
    }
  }
  branch.end = "wave_steps " + std::to_string(steps) + " taken";
  return branch;
}

}  // namespace stickslip
