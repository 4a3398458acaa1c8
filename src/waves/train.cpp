#include "stickslip/waves/train.hpp"

#include <algorithm>
#include <cmath>

#include "numerics/kinks.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/numerics/roots.hpp"
#include "waves/train_equations.hpp"
#include "waves/viscous_train.hpp"

namespace stickslip {

namespace {

constexpr int stages = train_stages;

// The largest psi (sign 1) or the least (-1): the best point, then the polynomials' own extremum beside it.
double extremum(const Train& train, int sign) {
  const size_t d = size_t(train.oscillator->dim()), n = train.intervals();
  size_t best = 0;
  for (size_t i = 0; i < train.values.size(); i += d)
    if (sign * train.values[i] > sign * train.values[best]) best = i;
  const size_t interval = best / (d * (stages + 1));
  double value = train.values[best];
  for (size_t i : {interval, (interval + n - 1) % n, (interval + 1) % n}) {
    const double h = train.mesh[i + 1] - train.mesh[i];
    // flat on top: a place known to 1e-9 tells the value to the last digit
    const Least least =
        find_least([&](double part) { return -sign * train.psi_at(train.mesh[i] + part * h); }, 0, 1, 1e-9,
                   [](double) { return false; });
    value = sign * std::max(sign * value, -least.value);
  }
  return value;
}

}  // namespace

void find_extrema(Train& train) {
  train.psi_max = extremum(train, 1);
  train.psi_min = extremum(train, -1);
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

// The largest change of psi at the points of the finer mesh.
double change_of_profile(const TrainEquations& problem, const std::vector<double>& x,
                         const TrainEquations& finer, const std::vector<double>& y) {
  const std::vector<double> coarse = finer.fill(problem, x);
  double change = 0;
  for (size_t i = 0; i + 1 < y.size(); i += size_t(finer.dim()))
    change = std::max(change, std::abs(coarse[i] - y[i]));
  return change;
}

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

Kinks kinks_along(const TrainEquations& problem, const std::vector<double>& x) {
  const TrainSetting::At at = problem.setting().at(x.back());
  return kinks_of(problem.mesh(), x.data(), problem.dim(), {0}, [&](const double* y, double* J) {
    double dy[train_max_dim + 1];
    problem.setting().rhs(at, y, dy, J);
  });
}

// Solves on a mesh that suits the profile, then on that mesh halved; refines until the answer is good enough.
// False where Newton's method does not converge.
bool solve_to(const TrainSetting& setting, const Orbit& start, double q, double tolerance, Train& train) {
  TrainEquations problem(setting, start.mesh, q);
  std::vector<double> x = problem.fill([&](double phase, double* y) { start.at(phase, y); }, q);
  if (!newton(problem, x)) return false;
  double least = 12;
  for (int round = 0; round < 12; ++round) {
    // the profile to 1e-9 of its range or the tolerance asked for, whichever is finer, within reason
    const std::vector<double> rough = roughness(problem.mesh(), x.data(), problem.dim());
    const double wanted = intervals_for(problem.mesh(), rough, std::max(tolerance, 1e-12) * 10);
    const size_t intervals = size_t(std::min(20000., std::max(least, .5 * wanted)));
    least = 1.5 * double(intervals);  // should there be a next round
    TrainEquations better(setting, equidistribute(problem.mesh(), rough, intervals), x.back());
    std::vector<double> guess = better.fill(problem, x);
    if (!newton(better, guess)) continue;  // too coarse
    problem = better;
    x = guess;
    const double gain = settle_on_kinks({[&]() -> const std::vector<double>& { return problem.mesh(); },
                                         [&] { return kinks_along(problem, x); },
                                         [&](std::vector<double> mesh) {
                                           TrainEquations moved(setting, std::move(mesh), x.back());
                                           std::vector<double> y = moved.fill(problem, x);
                                           if (!newton(moved, y)) return false;
                                           problem = std::move(moved);
                                           x = std::move(y);
                                           return true;
                                         }});
    TrainEquations finer(setting, halved(problem.mesh()), x.back());
    std::vector<double> y = finer.fill(problem, x);
    double last_step = 0;
    if (!newton(finer, y, &last_step)) continue;
    const double profile = change_of_profile(problem, x, finer, y);
    const TrainSetting::At coarse = setting.at(x.back()), fine = setting.at(y.back());
    const double estimate =
        std::abs(setting.request.speed ? coarse.T / fine.T - 1 : coarse.speed / fine.speed - 1) / gain;
    if (estimate <= tolerance && profile / 32 <= std::max({1e-9, tolerance, last_step})) {
      train = finished(finer, y, estimate);
      return true;
    }
    if (round == 11 || finer.mesh().size() > 40000)
      throw Failure("the train needs more than " + std::to_string(finer.mesh().size()) + " mesh intervals");
  }
  return false;
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
  const std::string none = "no train of " + std::to_string(request.pulses) +
                           (request.pulses == 1 ? " pulse" : " pulses") + " on a ring of length " +
                           rounded_text(*request.length, 8);
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
  throw Failure(none + ": as V falls to c a pulse still takes " + rounded_text(l, 8) + ", so that " + fits);
}

}  // namespace stickslip
