// What a run measures while it goes on: wave speeds, the word for its motion, whatever its steps and ranks.

#include <cmath>
#include <complex>
#include <functional>
#include <random>
#include <vector>

#include "catch.hpp"
#include "output/field_watch.hpp"
#include "output/regime_classifier.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/base/vectors.hpp"
#include "stickslip/output/regime.hpp"
#include "stickslip/study/trial.hpp"
#include "study/simulate.hpp"

using namespace stickslip;

namespace {

// psi(x, t) shown to a Regime in equal steps up to t_end, as a run would that is to go to `planned`, by
// default t_end.
Measured measured(const Scene& scene, double t_end, long steps,
                  const std::function<double(double, double)>& psi, double growth = NAN, double planned = 0) {
  const Model model(PETSC_COMM_WORLD, scene);
  VecHandle u = model.create_vector();
  Regime regime(model, planned > 0 ? planned : t_end);
  regime.know(growth, growth);
  const std::function<void(double, Vec)> nowhere = [](double, Vec) {};
  for (long k = 0; k <= steps; ++k) {
    const double t = t_end * double(k) / double(steps),
                 before = k == 0 ? 0 : t_end * double(k - 1) / double(steps);
    double* a;
    SS_TRY(VecGetArray(u, &a));
    for (PetscInt i = 0; i < model.local(); ++i) {
      const double x = scene.x(model.first() + i), here = psi(x, t), dt = 1e-6;
      a[i * model.dof()] = here;
      // the force that goes with this motion, so that slopes are true
      a[i * model.dof() + 1] = (psi(x, t + dt) - psi(x, t - dt)) / (2 * dt) / scene.A() + scene.B() * here +
                               model.friction(i, here, 0).F;
    }
    SS_TRY(VecRestoreArray(u, &a));
    regime.step({PetscInt(k), before, t, u, 0, nowhere});
  }
  return regime.result(u);
}

}  // namespace

TEST_CASE("the speed of a pulse train between ends is that of its fronts", "[measure]") {
  Scene scene;
  scene.left = scene.right = End::free;
  scene.n = 1201;
  scene.length = 24;
  scene.v = 0.2;
  const double t_end = 100, period = 5.92;
  const double speed = GENERATE(1.09, -1.09, 4.88);
  const double thickness = GENERATE(0.05, 1.5);  // 1.5: smooth, every node is seen during its passage
  const long steps = 1024;
  const Measured result = measured(scene, t_end, steps, [&](double x, double t) {
    return 2 * std::tanh(std::sin(2 * M_PI / period * (t - x / speed)) / thickness);
  });
  REQUIRE(result.wave_speed.has_value());
  // Passages are known to a step s, off by at most s/2 in a stretch of passage that lasts the shorter of a
  // period and the way through half the length; a line fitted to it errs by no more than 3 (s/2)/duration.
  const double duration = std::min(period, scene.length / 2 / std::abs(speed)) / 2;
  CHECK(*result.wave_speed == Approx(speed).epsilon(1.5 * t_end / double(steps) / duration));
  CHECK(result.motion == Motion::stick_slip);
}

TEST_CASE("a motion that decays as fast as half of what sliding promises does not stand", "[measure]") {
  // Sliding's perturbations decay with `growth`; a motion that shrinks at 0.7 of that goes there, one at 0.3
  // of it does not. Both change by less in 20 times the run than what counts as standing.
  Scene scene;
  scene.n = 9;
  scene.v = 0.2;
  const double t_end = 100, growth = -4e-4, part = GENERATE(0.3, 0.7);
  const Measured result = measured(
      scene, t_end, 4096,
      [&](double, double t) { return 0.2 + std::exp(part * growth * t) * std::sin(2 * M_PI / 5 * t); },
      growth);
  CHECK((result.motion == Motion::stick_slip) == (part < 0.5));
}

TEST_CASE("an oscillation in step has no wave speed", "[measure]") {
  Scene scene;
  scene.left = scene.right = End::free;
  scene.n = 201;
  const Measured result =
      measured(scene, 100, 500, [](double x, double t) { return x == 0 ? -1.5 : 2 * std::sin(t); });
  CHECK_FALSE(result.wave_speed.has_value());
}

TEST_CASE("the speed of a train on a ring, from few long steps to many short ones", "[measure]") {
  Scene scene;
  scene.n = 240;
  scene.length = 60;
  scene.v = 0;
  const int pulses = 3;
  const double speed = 2.5, turns = 2 * M_PI * pulses / scene.length;
  const auto train = [&](double x, double t) { return 2 * std::tanh(3 * std::sin(turns * (speed * t - x))); };
  for (const auto& [t_end, steps] : {std::pair<double, long>{8, 17}, {60, 400}, {9000, 60000}}) {
    const Measured m = measured(scene, t_end, steps, train);
    CAPTURE(t_end, steps);
    CHECK(m.pulses == pulses);
    REQUIRE(m.wave_speed.has_value());
    CHECK(*m.wave_speed == Approx(speed).epsilon(1e-6));
    // half the range of 2 tanh(3 sin): its top is 2 tanh 3
    CHECK(*m.amplitude == Approx(2 * std::tanh(3.)).epsilon(steps == 17 ? 0.05 : 0.02));
  }
}

TEST_CASE("an amplitude that falls is told from one that stands, at any size of step", "[measure][serial]") {
  Scene scene;
  scene.n = 1;
  scene.length = 1;
  scene.v = 0.6;
  const long steps = GENERATE(60, 300, 20000);
  const double t_end = 90, rate = GENERATE(-0.02, -0.004, -5e-4, 0., 0.004);
  const double growth = GENERATE(-0.004, 0.004, double(NAN));
  const Measured m = measured(
      scene, t_end, steps, [&](double, double t) { return 0.6 + 0.5 * std::exp(rate * t) * std::sin(t); },
      growth);
  CAPTURE(steps, rate, growth, to_string(m.motion));
  REQUIRE(m.rate.has_value());
  // steps of 1.5 on an oscillation of frequency 1 leave (1.5)^4/384 in the cubic between them
  const double tolerance = steps == 60 ? 3e-3 : steps == 300 ? 3e-5 : 1e-8;
  // the largest of a stretch lies somewhere in it: half a period in a span of six
  CHECK(*m.rate == Approx(rate).epsilon(0.1).margin(tolerance));
  if (tolerance > std::abs(rate) / 3 && rate != 0) return;  // what such steps cannot tell
  // what falls beside sliding that repels it falls to something else; of this scene it does, if nothing else
  // is said
  if (rate < -1e-3) CHECK(m.motion == (growth < 0 ? Motion::decaying : Motion::undecided));
  if (rate > 0) CHECK(m.motion == Motion::growing);
  if (rate == 0 && steps > 60) CHECK(m.motion == Motion::stick_slip);
  if (m.motion == Motion::decaying) CHECK(*m.time_to_decide > t_end);
}

TEST_CASE("a million steps are judged as a thousand are, in the same memory", "[measure][serial]") {
  Scene scene;
  scene.n = 1;
  scene.length = 1;
  scene.v = 0.6;
  const Model model(PETSC_COMM_WORLD, scene);
  VecHandle u = model.create_vector();
  const std::function<void(double, Vec)> nowhere = [](double, Vec) {};
  const double t_end = 60000, rate = -2e-5;
  std::size_t kept[2];
  double rates[2], seconds = 0;
  for (const int many : {0, 1}) {
    const long steps = many ? 1000000 : 100000;  // of 0.06 and 0.6
    Regime regime(model, t_end);
    regime.know(rate, rate);
    // by a recurrence, so that the time is the judge's: psi - v is the imaginary part of z
    const std::complex<double> turn = std::exp(std::complex<double>(rate, 1) * (t_end / double(steps)));
    std::complex<double> z = 0.5;
    const double begin = processor_seconds();
    for (long k = 0; k <= steps; ++k, z *= turn) {
      const double t = t_end * double(k) / double(steps),
                   before = k == 0 ? 0 : t_end * double(k - 1) / double(steps);
      const double psi = 0.6 + z.imag(), slope = rate * z.imag() + z.real();
      {
        const Writing a(u);
        a[0] = psi;
        a[1] = slope / scene.A() + scene.B() * psi + model.friction(0, psi, 0).F;
      }
      regime.step({PetscInt(k), before, t, u, 0, nowhere});
    }
    if (many) seconds = processor_seconds() - begin;
    const Measured& m = regime.result(u);
    CHECK(m.motion == Motion::decaying);
    rates[many] = m.rate.value_or(0);
    Checkpoint c;
    Archive a = Archive::to(c, NodeRange::of(model));
    regime.archive(a);
    kept[many] = 0;
    for (const auto& [name, values] : c.arrays) kept[many] += values.size();
  }
  CHECK(rates[1] == Approx(rate).epsilon(0.01));
  CHECK(rates[0] == Approx(rates[1]).epsilon(0.01));
  CHECK(kept[1] <= kept[0] + 40);  // moments grow with the logarithm
  CHECK(kept[1] < 1200);
  CHECK(seconds < 5);  // 0.3 s on an idle machine
}

TEST_CASE("a few long steps do", "[measure][serial]") {
  Scene scene;
  scene.n = 1;
  scene.length = 1;
  scene.v = 0.6;
  const auto sinking = [](double, double t) { return 0.6 * (1 + 0.5 * std::exp(-0.3 * t)); };
  CHECK(measured(scene, 40, 17, sinking, -0.3).motion == Motion::sliding);
  CHECK(measured(scene, 4, 17, sinking, -0.3).motion != Motion::sliding);
  // two and a half periods say nothing final
  const Measured m = measured(
      scene, 17, 17, [](double, double t) { return 0.6 + 0.5 * std::sin(t); }, 0.1);
  CHECK(m.motion == Motion::undecided);
  CHECK(m.time_to_decide > 17);
}

TEST_CASE("a run that is stopped after any few steps is judged, and says nothing final",
          "[measure][serial]") {
  Scene scene;
  scene.n = 1;
  scene.length = 1;
  scene.v = 0.6;
  for (long steps = 0; steps <= 20; ++steps)
    for (const double planned : {1., 3., 100., 1e5}) {
      CAPTURE(steps, planned);
      const auto swinging = [](double, double t) { return 0.6 + 0.5 * std::sin(t); };
      const double t = 0.7 * double(std::max(1L, steps));
      const Motion motion = measured(scene, t, steps, swinging, 0.1, planned * t).motion;
      CHECK(motion != Motion::sliding);
      CHECK(motion != Motion::stick_slip);
    }
}

TEST_CASE("an oscillation that has arrived at its size no longer grows", "[measure][serial]") {
  Scene scene;
  scene.n = 1;
  scene.length = 1;
  scene.v = 0.6;
  const double growth = 0.1, arrival = 100;  // the amplitude of a supercritical oscillation: 0.5 from then on
  const auto size = [&](double t) { return 0.5 / std::sqrt(1 + std::exp(-2 * growth * (t - arrival))); };
  Motion last = Motion::undecided;
  for (const double t_end : {60., 90., 130., 140., 150., 170., 200., 400.}) {
    const Measured m = measured(
        scene, t_end, long(t_end * 5), [&](double, double t) { return 0.6 + size(t) * std::sin(t); }, growth);
    CAPTURE(t_end, to_string(m.motion));
    if (t_end < arrival)
      CHECK(m.motion == Motion::growing);
    else
      CHECK(m.motion != Motion::growing);
    if (last == Motion::stick_slip || t_end > 180) CHECK(m.motion == Motion::stick_slip);
    last = m.motion;
  }
}

TEST_CASE("passes over a field give what a plain loop does", "[measure][serial]") {
  std::mt19937 random(20);
  std::uniform_real_distribution<double> any(-1, 1);
  for (int scene = 0; scene < 40; ++scene) {
    const int dof = scene % 2 + 2;
    const PetscInt count = 1 + PetscInt(random() % 1500);
    const double smooth = any(random) < 0 ? 1 : 200, depth = 0.3 * std::abs(any(random)),
                 level = 0.2 * any(random);
    const auto size = std::size_t(count);
    std::vector<double> u(size * std::size_t(dof)), low(size), high(size);
    for (std::size_t i = 0; i < size; ++i) {
      for (int d = 0; d < dof; ++d) u[i * std::size_t(dof) + std::size_t(d)] = any(random);
      if (smooth > 1) u[i * std::size_t(dof)] = std::sin(double(i) / smooth) + 0.1 * u[i * std::size_t(dof)];
      low[i] = 0.5 * any(random);
      high[i] = low[i] + 0.2;
    }
    const FieldRange field{u.data(), count, dof};
    double least = HUGE_VAL, largest = -HUGE_VAL, psi_sum = 0, steepest = 0, range = 0;
    Passages passages;
    for (std::size_t i = 0; i < size; ++i) {
      const double psi = u[i * std::size_t(dof)], off = psi - level;
      least = std::min(least, psi);
      largest = std::max(largest, psi);
      psi_sum += psi;
      if (i > 0) steepest = std::max(steepest, std::abs(psi - u[(i - 1) * std::size_t(dof)]));
      range = std::max(range, std::max(high[i], psi) - std::min(low[i], psi));
      passages.add(off < -depth ? -1 : off > depth ? 1 : 0);
    }
    CAPTURE(scene, count, dof, depth, level);
    const FieldSums sums = sums_of(field);
    CHECK(sums.low == least);
    CHECK(sums.high == largest);
    CHECK(sums.psi == Approx(psi_sum).margin(1e-13 * double(count)));
    const Fronts fronts = fronts_of(field, level, depth);
    CHECK(fronts.passages.first == passages.first);
    CHECK(fronts.passages.last == passages.last);
    CHECK(fronts.passages.up == passages.up);
    CHECK(fronts.steepest == Approx(steepest).margin(1e-15));  // differences of psi less the level
    CHECK(widest(field, low.data(), high.data()).range == range);
    CHECK(widest(field, nullptr, nullptr).range == 0);
    const Extremes extremes = widen(field, low.data(), high.data());
    CHECK(extremes.low == least);
    CHECK(extremes.high == largest);
    double widened = 0;
    for (std::size_t i = 0; i < size; ++i) widened = std::max(widened, high[i] - low[i]);
    CHECK(widened == range);
  }
}

TEST_CASE("a quarter of any number of steps has the amplitude of its nodes", "[measure]") {
  Scene scene;
  scene.n = 240;
  scene.length = 60;
  const auto psi = [](double x, double t) { return std::sin(3 * x) * std::cos(7 * t) + 0.3 * t * x / 60; };
  for (const long steps : {1, 2, 3, 4, 5, 7, 8, 12, 40}) {
    double amplitude = 0;
    for (PetscInt i = 0; i < scene.n; ++i) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (long k = 0; k <= steps; ++k) {
        const double t = 4 * double(k) / double(steps);
        if (t < 3) continue;
        low = std::min(low, psi(scene.x(i), t));
        high = std::max(high, psi(scene.x(i), t));
      }
      amplitude = std::max(amplitude, (high - low) / 2);
    }
    const Model model(PETSC_COMM_WORLD, scene);
    VecHandle u = model.create_vector();
    FieldWatch watch(model, 4);
    const std::function<void(double, Vec)> nowhere = [](double, Vec) {};
    for (long k = 0; k <= steps; ++k) {
      const double t = 4 * double(k) / double(steps);
      {
        const Writing a(u);
        for (PetscInt i = 0; i < model.local(); ++i) a[i * model.dof()] = psi(scene.x(model.first() + i), t);
      }
      watch.step({PetscInt(k), 4 * double(k - 1) / double(steps), t, u, 0, nowhere});
    }
    CAPTURE(steps);
    CHECK(*watch.result().amplitude == amplitude);
  }
}

TEST_CASE(
    "every step of a run is seen once, also where it is prolonged, and the run ends where it is told to",
    "[measure]") {
  struct Seen : Observer {
    std::vector<double> begin, end;
    void step(const ObservedStep& step) override {
      begin.push_back(step.t_before);
      end.push_back(step.t);
    }
  };
  Scene scene;
  scene.n = 16;
  const Model model(PETSC_COMM_WORLD, scene);
  VecHandle u = model.create_vector();
  SS_TRY(VecSet(u, 0.3));
  Integrator integrator(model, MethodSpec(), u);
  Seen seen, also;
  for (const double t : {0., 1., 3.}) simulate(integrator, u, {t, 2 * t + 1}, {&seen, &also});
  CHECK(seen.begin.front() == 0);
  CHECK(seen.end.front() == 0);
  for (std::size_t k = 1; k < seen.end.size(); ++k) {
    CHECK(seen.begin[k] == seen.end[k - 1]);
    CHECK(seen.end[k] > seen.begin[k]);
  }
  CHECK(seen.end.back() == 7);
  CHECK(also.end == seen.end);
  double watching = 0;
  Seen few;
  const auto stop = [&](const Integrator::Step&) {
    return few.end.size() == 3 ? Integrator::Verdict::stop : Integrator::Verdict::go_on;
  };
  Integrator another(model, MethodSpec(), u);
  simulate(another, u, {0, 50, 1000, 0, &watching}, {&few}, stop);
  CHECK(few.end.size() == 3);
  CHECK(another.report().stop == Stop::asked);
  CHECK(watching > 0);
}
