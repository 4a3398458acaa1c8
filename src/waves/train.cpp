
#include "stickslip/waves/train.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
#include "stickslip/numerics/continuation.hpp"
#include "stickslip/numerics/roots.hpp"
#include "waves/train_field.hpp"

namespace stickslip {

void find_extrema(Train& train) {
  std::vector<double> psi;
  for (size_t i = 0; i < train.values.size(); i += size_t(train.oscillator->dim()))
    psi.push_back(train.values[i]);
  train.psi_max = extremum(psi, 1);
  train.psi_min = extremum(psi, -1);
}

namespace {

double cubic_shortest(const Scene& scene) {
  const double a2 = 1 - scene.s_delta() / scene.gamma, w2 = scene.v * scene.v / a2;
  if (!(a2 > 0) || w2 >= 1) return 0;
  return scene.gamma * a2 * scene.c * (3 - (1 - w2) * std::log((4 - w2) / (1 - w2)));
}

bool plain_cubic(const Scene& scene) { return Friction::of(scene.friction)->van_der_pol; }

}  // namespace

void refuse_viscosity(const Scene& scene) {
  if (scene.nu > 0)
    throw UsageError("model_nu " + rounded_text(scene.nu, 8) +
                     ": trains are solved for without viscosity between neighbours; set model_nu to 0, or "
                     "let a run settle on one");
}

void check_train_scene(const Scene& scene) {
  if (scene.form == Form::chain)
    throw UsageError(
        "model_form chain: travelling trains are solved for in the continuum only (the chain's obey an "
        "advance-delay equation); use model_form continuum");
  if (scene.spread > 0)
    throw UsageError("friction_spread " + rounded_text(scene.spread, 8) +
                     ": a train travels through a uniform medium only; set friction_spread to 0");
  refuse_viscosity(scene);
  (void)Oscillator(scene);  // refuses a law that jumps, and profiles
}

double shortest_pulse(const Scene& scene) {
  return plain_cubic(scene) ? cubic_shortest(scene) : scene.c == 0 ? 0 : std::nan("");
}

namespace {

void check_request(const Scene& scene, const TrainRequest& request) {
  if (request.pulses < 1)
    throw UsageError("wave_pulses " + std::to_string(request.pulses) + ": at least 1 is needed");
  if (bool(request.length) == bool(request.speed))
    throw UsageError("wave_length and wave_speed: exactly one of the two is needed");
  if (request.length && !(*request.length > 0))
    throw UsageError("wave_length " + rounded_text(*request.length, 8) + ": a positive length is needed");
  const double c = scene.c;
  if (request.speed && !(std::abs(*request.speed) > c))
    throw UsageError("wave_speed " + rounded_text(*request.speed, 8) +
                     ": periodic waves need a speed beyond c, |V| > model_c = " + rounded_text(c, 8));
}

Orbit orbit_at(const TrainField& field, double r2) {
  try {
    return find_orbit(*field.oscillator(), r2, 1e-5);
  } catch (const Failure& e) {
    throw Failure(std::string("no train: ") + e.what());
  }
}

// The train from an integrated orbit; nothing where Newton's method does not reach it.
std::optional<Train> from_orbit(const SharedTrain& field, const Orbit& orbit, double q, double tolerance) {
  const auto from = [&](const Orbit& start) -> std::optional<Train> {
    TrainSolution s{PeriodicEquations(start.mesh, field), {}};
    s.x = s.equations.fill([&](double phase, double* y) { start.at(phase, y); }, q);
    if (!solve_train_on_mesh(s)) return std::nullopt;
    return train_to_accuracy(std::move(s), tolerance, "the train");
  };
  if (auto train = from(orbit)) return train;
  // fronts so steep that Newton's method wants a better start
  for (double finer : {1e-7, 1e-9, 1e-11})
    if (auto train = from(find_orbit(*field->oscillator(), field->placed(q).r2(), finer))) return train;
  return std::nullopt;
}

// The fastest train of the length that is given; nothing where none is found down to V = c.
std::optional<Train> fastest_of_length(const SharedTrain& field, double c, double tolerance) {
  const double pulse = *field->request().length / double(field->request().pulses);
  // ln(V T/(length of a pulse)), from high speed down; the first change of sign is the fastest train. NaN
  // where nothing oscillates so slowly.
  Orbit orbit = orbit_at(*field, 1);
  const auto mismatch = [&](double q) {
    try {
      const TrainField there = field->placed(q);
      orbit = orbit_at(there, there.r2());
      return std::log(there.speed() * orbit.period / pulse);
    } catch (const Failure&) {
      return std::nan("");
    }
  };
  double high = std::log(pulse / orbit.period), at_high = mismatch(high);
  while (!(at_high > 0)) at_high = mismatch(high += .5);
  const double floor = std::log(std::max(c, 1e-30)) - 14;  // V/c - 1 = 3e-13
  for (double step = .5; high > floor;) {
    double low = high - step, at_low = mismatch(low);
    const bool ends = std::isnan(at_low);
    if (ends) {
      low = last_place([&](double q) { return !std::isnan(mismatch(q)); }, high, low, 1e-6);
      at_low = mismatch(low);
    }
    if (at_low <= 0) {
      const double q = find_root(mismatch, {low, at_low, high, at_high}, 1e-5 * std::max(1., std::abs(high)));
      if (!std::isnan(q) && !std::isnan(mismatch(q)))
        if (auto train = from_orbit(field, orbit, q, tolerance)) return train;
      // a jump of the period, not a root: on below it
      for (; low > floor && at_low <= 0; low -= .5) at_low = mismatch(low - .5);
    }
    if (ends || std::isnan(at_low)) return std::nullopt;
    high = low;
    at_high = at_low;
    step = std::min(1., step * 1.5);
  }
  return std::nullopt;
}

}  // namespace

Train solve_train(const Scene& scene, const TrainRequest& request, double tolerance) {
  check_train_scene(scene);
  check_request(scene, request);
  const auto field = std::make_shared<const TrainField>(scene, request);
  if (request.speed) {
    const Orbit orbit = orbit_at(*field, field->r2());
    if (auto train = from_orbit(field, orbit, std::log(orbit.period), tolerance)) return *train;
    throw Failure("Newton's method does not converge to the train from the integrated orbit");
  }
  if (auto train = fastest_of_length(field, scene.c, tolerance)) return *train;
  const std::string none = fmt::format("no train of {}{} on a ring of length {:.8g}", request.pulses,
                                       request.pulses == 1 ? " pulse" : " pulses", *request.length);
  double l = shortest_pulse(scene);
  if (std::isnan(l)) {
    try {
      l = scene.c * find_orbit(Oscillator(scene), 2e-12, 1e-8).period;
    } catch (const Failure&) {
      throw Failure(none +
                    " was found, and none is left as V falls to c: wave_speed shows which speeds have one");
    }
  }
  const double most = std::ceil(*request.length / l) - 1;
  const std::string fits =
      most < 1 ? "none fits" : "at most " + rounded_text(most, 8) + (most == 1 ? " fits" : " fit");
  throw Failure(fmt::format("{}: as V falls to c a pulse still takes {:.8g}, so that {}", none, l, fits));
}

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

PeriodicEquations TrainSheet::equations(const SheetPlace& p) const {
  const auto cases = [at = family_.at, value2 = p.value2](double value) { return at(value, value2); };
  return {p.mesh, fields_of(cases), p.value(), value_scale_};
}

SheetPlace TrainSheet::place(const Train& train, double value, double value2) const {
  const double q = field(value, value2).number_of(train);
  SheetPlace p{train.mesh, {0, 0, q, value}, value2};
  p.x = equations(p).fill(profile_of(train), q);
  return p;
}

SheetChart TrainSheet::chart(const SheetPlace& p, double z_part, double q) const {
  const double length = std::hypot(z_part, q);
  SheetChart chart{z_part / length / z_scale_, q / length, 0};
  chart.origin = chart.alpha(p);
  return chart;
}

std::vector<double> TrainSheet::tangent(const SheetPlace& p, const SheetChart& chart) const {
  PeriodicEquations there = equations(p);
  return there.tangent(p.x, train_conditions(there.dim(), chart.row(), 0));
}

SheetChart TrainSheet::along(const SheetPlace& p, const SheetChart& side) const {
  const std::vector<double> t = tangent(p, side);
  return chart(p, t[1] / z_scale_, t[t.size() - 2]);
}

double TrainSheet::slope(const SheetPlace& p, const SheetChart& chart) const {
  return tangent(p, chart).back() / value_scale_;
}

std::optional<SheetPlace> TrainSheet::at(const SheetChart& chart, const SheetPlace& from, double alpha,
                                         double value2) const {
  try {
    const SheetPlace start{from.mesh, from.x, value2};
    TrainSolution s{equations(start), start.x};
    const auto conditions = train_conditions(s.equations.dim(), chart.row(), alpha + chart.origin);
    solve_on_suiting_mesh([&](auto& at) { return newton(at, conditions, 12); }, {1e-10, 60}, s);
    return SheetPlace{s.mesh(), s.x, value2};
  } catch (const Error&) {
    return std::nullopt;
  }
}

Train TrainSheet::train(const SheetPlace& p) const {
  return pack(field(p.value(), p.value2), {equations(p), p.x});
}

}  // namespace stickslip
