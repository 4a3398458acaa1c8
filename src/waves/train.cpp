#include "stickslip/waves/train.hpp"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

#include "stickslip/base/error.hpp"
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

}  // namespace stickslip
