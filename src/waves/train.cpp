#include "stickslip/waves/train.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "numerics/mesh_solve.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "waves/train_equations.hpp"
#include "waves/viscous_train.hpp"

namespace stickslip {

void find_extrema(Train& train) {
  std::vector<double> psi;
  for (size_t i = 0; i < train.values.size(); i += size_t(train.oscillator->dim()))
    psi.push_back(train.values[i]);
  train.psi_max = extremum(psi, 1);
  train.psi_min = extremum(psi, -1);
}

Train pack(const TrainEquations& problem, const std::vector<double>& x) {
  Train train;
  const TrainSetting& setting = problem.setting();
  const TrainSetting::At at = setting.at(x[(problem.mesh().size() - 1) * problem.block()]);
  train.pulses = setting.request.pulses;
  train.length_given = bool(setting.request.length);
  train.speed = setting.request.speed ? *setting.request.speed : at.speed;
  train.period = at.T;
  train.length = setting.request.length ? *setting.request.length : double(train.pulses) * at.speed * at.T;
  train.r2 = at.r2;
  train.oscillator = setting.oscillator;
  train.method = &Collocation::gauss5();
  train.mesh = problem.mesh();
  train.nu = setting.N * setting.oscillator->A();
  std::vector<double> values(x.begin(), x.begin() + long(train.intervals() * problem.block()));
  if (setting.N > 0)
    set_viscous_values(train, std::move(values));
  else
    train.values = std::move(values);
  find_extrema(train);
  return train;
}

namespace {

// The train of a solution on a halved mesh, with its errors: `estimate` is the relative one of the unknown
// number.
Train finished(TrainEquations& problem, const std::vector<double>& x, double estimate) {
  Train train = pack(problem, x);
  std::vector<double> F(problem.size()), noise(problem.size());
  train.residual = problem.largest_residual(x, F);
  // round-off: what one more step of Newton's method would move q by, and a few units of the last place
  problem.linearise(x.data());
  problem.solve(F.data(), noise.data());
  train.error_estimate = (train.length_given ? std::abs(train.speed) : train.length) *
                         (estimate + 4 * std::abs(noise.back()) + 4e-15);
  return train;
}

// False where Newton's method does not converge.
bool solve_to(const TrainSetting& setting, const Orbit& start, double q, double tolerance, Train& train) {
  using Solution = MeshSolution<TrainEquations>;
  const auto solve = [](Solution& s) { return newton(s.equations, s.x, &s.last_step); };
  Solution s{TrainEquations(setting, start.mesh, q), {}};
  s.x = s.equations.fill([&](double phase, double* y) { start.at(phase, y); }, q);
  if (!solve(s)) return false;
  const auto change = [&](const Solution& a, const Solution& b) {
    const TrainSetting::At coarse = setting.at(a.q()), fine = setting.at(b.q());
    return std::abs(setting.request.speed ? coarse.T / fine.T - 1 : coarse.speed / fine.speed - 1);
  };
  auto found = solve_to_accuracy<TrainEquations>(solve, std::move(s),
                                                 {tolerance, 12, {0}, units_of_psi, change, "the train"});
  if (found) train = finished(found->solution.equations, found->solution.x, found->estimate);
  return bool(found);
}

double cubic_shortest(const Scene& scene) {
  const double a2 = 1 - scene.s_delta() / scene.gamma, w2 = scene.v * scene.v / a2;
  if (!(a2 > 0) || w2 >= 1) return 0;
  return scene.gamma * a2 * scene.c * (3 - (1 - w2) * std::log((4 - w2) / (1 - w2)));
}

bool plain_cubic(const Scene& scene) { return Friction::of(scene.friction)->van_der_pol; }

}  // namespace

void check_train_scene(const Scene& scene) {
  if (scene.form == Form::chain)
    throw UsageError(
        "model_form chain: travelling trains are solved for in the continuum only (the chain's obey an "
        "advance-delay equation); use model_form continuum");
  if (scene.spread > 0)
    throw UsageError("friction_spread " + rounded_text(scene.spread, 8) +
                     ": a train travels through a uniform medium only; set friction_spread to 0");
  (void)Oscillator(scene);  // refuses a law that jumps, and profiles
}

double shortest_pulse(const Scene& scene) {
  if (scene.nu > 0) return std::nan("");
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

Orbit orbit_at(const TrainSetting& setting, double r2) {
  try {
    return find_orbit(*setting.oscillator, r2, 1e-5);
  } catch (const Failure& e) {
    throw Failure(std::string("no train: ") + e.what());
  }
}

// The train from an integrated orbit; false where Newton's method does not reach it.
bool from_orbit(const TrainSetting& setting, const Orbit& orbit, double q, double tolerance, Train& train) {
  if (solve_to(setting, orbit, q, tolerance, train)) return true;
  // fronts so steep that Newton's method wants a better start
  for (double finer : {1e-7, 1e-9, 1e-11})
    if (solve_to(setting, find_orbit(*setting.oscillator, setting.at(q).r2, finer), q, tolerance, train))
      return true;
  return false;
}

// The fastest train of the length that is given; false where none is found down to V = c.
bool fastest_of_length(const TrainSetting& setting, double c, double tolerance, Train& train) {
  const double pulse = *setting.request.length / double(setting.request.pulses);
  // ln(V T/(length of a pulse)), from high speed down; the first change of sign is the fastest train. NaN
  // where nothing oscillates so slowly.
  Orbit orbit = orbit_at(setting, 1);
  const auto mismatch = [&](double q) {
    try {
      orbit = orbit_at(setting, setting.at(q).r2);
      return std::log(setting.at(q).speed * orbit.period / pulse);
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
      if (!std::isnan(q) && !std::isnan(mismatch(q)) && from_orbit(setting, orbit, q, tolerance, train))
        return true;
      // a jump of the period, not a root: on below it
      for (; low > floor && at_low <= 0; low -= .5) at_low = mismatch(low - .5);
    }
    if (ends || std::isnan(at_low)) return false;
    high = low;
    at_high = at_low;
    step = std::min(1., step * 1.5);
  }
  return false;
}

}  // namespace

Train solve_train(const Scene& scene, const TrainRequest& request, double tolerance) {
  check_train_scene(scene);
  check_request(scene, request);
  if (scene.nu > 0) return solve_viscous_train(scene, request, tolerance);
  const TrainSetting setting = TrainSetting::of(scene, request);
  Train train;
  if (request.speed) {
    const Orbit orbit = orbit_at(setting, setting.at(0).r2);
    if (!from_orbit(setting, orbit, std::log(orbit.period), tolerance, train))
      throw Failure("Newton's method does not converge to the train from the integrated orbit");
    return train;
  }
  if (fastest_of_length(setting, scene.c, tolerance, train)) return train;
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

}  // namespace stickslip
