#include "waves/train_field.hpp"

#include <cmath>

#include "stickslip/base/error.hpp"

namespace stickslip {

namespace {

using std::size_t;

const TrainCase& checked(const TrainCase& asked) {
  const TrainRequest& request = asked.request;
  refuse_viscosity(asked.scene);
  if (request.speed && !(std::abs(*request.speed) > asked.scene.c)) throw Failure("V comes down to c");
  if (request.length && !(*request.length > 0)) throw Failure("the length vanishes");
  return asked;
}

}  // namespace

TrainField::TrainField(const TrainCase& asked) : TrainField(checked(asked).scene, asked.request) {}

TrainField::TrainField(std::shared_ptr<const Oscillator> oscillator, const TrainRequest& request)
    : oscillator_(std::move(oscillator)), request_(request) {
  if (!request.speed) return;
  const double V = std::abs(*request.speed), c = std::sqrt(oscillator_->c2());
  speed_ = V;
  r2_ = (V - c) * (V + c) / (V * V);
}

TrainField TrainField::placed(double q) const {
  TrainField there(*this);
  if (request_.speed) return there;
  const double c2 = oscillator_->c2(), Y2 = std::exp(2 * q);
  there.speed_ = std::sqrt(c2 + Y2);
  there.r2_ = Y2 / (c2 + Y2);
  there.r2_q_ = 2 * there.r2_ * (c2 / (c2 + Y2));
  there.speed_q_ = there.speed_ * there.r2_;
  return there;
}

double TrainField::number_of(const Train& train) const {
  const double V = std::abs(train.speed), c = std::sqrt(oscillator_->c2());
  return request_.speed ? std::log(train.period) : .5 * std::log((V - c) * (V + c));
}

VectorField::Period TrainField::period(double q) const {
  if (request_.speed) return VectorField::period(q);
  const double T = *request_.length / (double(request_.pulses) * speed_);
  return {T, -T * r2_};
}

void TrainField::add_slope(const double*, const double* f, double* slope) const {
  if (request_.speed) return;
  slope[0] += -r2_q_ / r2_ * f[0];
}

VectorField::Stiff TrainField::stiff() const {
  return {0, oscillator_->A() / r2_};
}

std::vector<Condition> train_conditions(int dim) {
  Condition phase;
  phase.y0.assign(dim, 0.);
  phase.y0[0] = 1;
  return {phase};
}

std::vector<Condition> train_conditions(int dim, const std::vector<double>& row, double right) {
  std::vector<Condition> conditions = train_conditions(dim);
  Condition along{std::vector<double>(dim), row[1], row[2], right};
  along.y0[1] = row[0];
  conditions.push_back(std::move(along));
  return conditions;
}

FieldFamily fields_of(std::function<TrainCase(double)> cases) {
  return [cases = std::move(cases)](double lambda) -> SharedField {
    return std::make_shared<const TrainField>(cases(lambda));
  };
}

std::function<void(double, double*)> profile_of(const Train& train) {
  return [&train](double phase, double* y) { train.at(phase, y); };
}

Train pack(const TrainField& family, const TrainSolution& solution) {
  const double q = solution.q();
  const TrainField field = family.placed(q);
  const TrainRequest& request = field.request();
  Train train;
  train.pulses = request.pulses;
  train.length_given = bool(request.length);
  train.speed = request.speed ? *request.speed : field.speed();
  train.period = field.period(q).T;
  train.length = request.length ? *request.length : double(train.pulses) * field.speed() * train.period;
  train.r2 = field.r2();
  train.oscillator = field.oscillator();
  train.method = &Collocation::gauss5();
  train.mesh = solution.mesh();
  train.values.assign(solution.x.begin(), solution.x.end() - solution.equations.parameters());
  find_extrema(train);
  train.residual = solution.residual;
  return train;
}

bool newton(TrainSolution& s, const std::vector<Condition>& conditions, int most) {
  const PeriodicEquations::Newton found = s.equations.newton(s.x, conditions, most);
  s.last_step = found.last_step;
  s.residual = found.residual;
  return found.converged;
}

bool solve_train_on_mesh(TrainSolution& s) {
  try {
    return newton(s, train_conditions(s.equations.dim()));
  } catch (const Failure&) {
    return false;
  }
}

std::optional<Train> train_to_accuracy(TrainSolution start, double tolerance, const std::string& what) {
  const auto field = static_cast<const TrainField&>(start.equations.field());
  const auto change = [&](const TrainSolution& coarse, const TrainSolution& fine) {
    const TrainField a = field.placed(coarse.q()), b = field.placed(fine.q());
    return std::abs(field.request().speed ? a.period(coarse.q()).T / b.period(fine.q()).T - 1
                                          : a.speed() / b.speed() - 1);
  };
  // of the profile psi alone, against a quarter of its scale
  const std::vector<double> units{field.unit(0) / 4, HUGE_VAL, HUGE_VAL, HUGE_VAL};
  auto found = solve_to_accuracy<PeriodicEquations>(
      solve_train_on_mesh, std::move(start),
      {tolerance, 12, {{0}, field.oscillator()->joints()}, units, change, what});
  if (!found) return std::nullopt;
  // round-off: what one more step of Newton's method would move q by, and a few units of the last place
  TrainSolution& solution = found->solution;
  const PeriodicEquations::Step more = solution.equations.step(solution.x, train_conditions(field.dim()));
  solution.residual = more.residual;
  Train train = pack(field, solution);
  train.error_estimate = (train.length_given ? std::abs(train.speed) : train.length) *
                         (found->estimate + 4 * std::abs(more.dx.back()) + 4e-15);
  return train;
}

}  // namespace stickslip
