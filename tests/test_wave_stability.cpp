#include <cmath>

#include "catch.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/model.hpp"
#include "stickslip/waves/wave_stability.hpp"

using namespace stickslip;
using Complex = std::complex<double>;

namespace {

Scene scene_of(double v, double delta = 0) {
  Scene scene;
  scene.delta = delta;
  scene.v = v;
  return scene;
}

// Classical Runge-Kutta steps of the semi-discrete system.
void advance(const Model& model, Vec u, double time, int steps) {
  const double dt = time / steps;
  VecHandle k = model.create_vector(), w = model.create_vector(), sum = model.create_vector();
  for (int i = 0; i < steps; ++i) {
    SS_TRY(VecCopy(u, sum));
    const double at[] = {dt / 2, dt / 2, dt, 0}, weight[] = {dt / 6, dt / 3, dt / 3, dt / 6};
    SS_TRY(VecCopy(u, w));
    for (int s = 0; s < 4; ++s) {
      model.rhs(Part::full, w, k);
      SS_TRY(VecAXPY(sum, weight[s], k));
      if (s < 3) SS_TRY(VecWAXPY(w, at[s], k, u));
    }
    SS_TRY(VecCopy(sum, u));
  }
}

// Two multipliers of one turn of a train on its ring, from the full equations: two runs from nearby starts,
// whose difference after k turns obeys d_{k+1} = p d_k + q d_{k-1}. What does not change (a shift of the
// train) is taken out first by differences of differences.
struct Measured {
  double growth, frequency;
};
Measured measured_growth(Scene scene, const Train& train, int turns, int skip) {
  scene.n = 192;
  scene.length = train.length;
  scene.order = 8;
  const Model model(PETSC_COMM_SELF, scene);
  VecHandle u = model.create_vector(), w = model.create_vector();
  for (Vec vec : {u.get(), w.get()}) {
    double* a;
    SS_TRY(VecGetArray(vec, &a));
    for (PetscInt i = 0; i < scene.n; ++i) {
      const double x = scene.x(i) / scene.length;
      a[2 * i] = train.psi_at(-x) + (vec == w.get() ? 1e-6 * std::cos(2 * M_PI * x) : 0);
      a[2 * i + 1] = train.eta_at(-x) + (vec == w.get() ? 1e-6 * std::sin(4 * M_PI * x) : 0);
    }
    SS_TRY(VecRestoreArray(vec, &a));
  }
  std::vector<std::vector<double>> difference;
  for (int k = 0; k <= turns; ++k) {
    if (k > 0)
      for (Vec vec : {u.get(), w.get()}) advance(model, vec, train.period, 400);
    const double *a, *b;
    SS_TRY(VecGetArrayRead(u, &a));
    SS_TRY(VecGetArrayRead(w, &b));
    std::vector<double> d;
    for (PetscInt i = 0; i < 2 * scene.n; ++i) d.push_back(b[i] - a[i]);
    SS_TRY(VecRestoreArrayRead(u, &a));
    SS_TRY(VecRestoreArrayRead(w, &b));
    difference.push_back(d);
  }
  double a11 = 0, a12 = 0, a22 = 0, b1 = 0, b2 = 0;
  for (int k = skip; k + 3 <= turns; ++k)
    for (size_t i = 0; i < difference[0].size(); ++i) {
      const double e0 = difference[size_t(k) + 1][i] - difference[size_t(k)][i];
      const double e1 = difference[size_t(k) + 2][i] - difference[size_t(k) + 1][i];
      const double e2 = difference[size_t(k) + 3][i] - difference[size_t(k) + 2][i];
      a11 += e1 * e1;
      a12 += e1 * e0;
      a22 += e0 * e0;
      b1 += e2 * e1;
      b2 += e2 * e0;
    }
  const double det = a11 * a22 - a12 * a12, p = (b1 * a22 - b2 * a12) / det, q = (a11 * b2 - a12 * b1) / det;
  const Complex root = p / 2 + std::sqrt(Complex(p * p / 4 + q, 0));
  return {std::log(std::abs(root)) / train.period, std::abs(std::arg(root)) / train.period};
}

}  // namespace

TEST_CASE("a fast train has the Floquet multipliers of the uniform oscillation",
          "[wave][stability][serial]") {
  // gamma = 3, v = 0: unstable to 0 < c^2 k^2 < 1.122, largest multiplier 1.302 at c^2 k^2 = 0.485
  const Train train = solve_train(scene_of(0), {1, {}, 20.});
  const TrainSpectrum endless = infinite_train_stability(train);
  CHECK_FALSE(endless.infinite_stable);
  CHECK(std::exp(endless.infinite_growth * train.period) == Approx(1.302).margin(2e-3));
  CHECK(std::pow(endless.infinite_frequency / 20, 2) == Approx(.485).margin(5e-3));
  // at v = 0.9 there is no unstable band
  CHECK(infinite_train_stability(solve_train(scene_of(.9), {1, {}, 6.})).infinite_growth < 2e-5);
}

TEST_CASE("the Bloch factors at lambda = 0 are those of the orbit", "[wave][stability][serial]") {
  const Train train = solve_train(scene_of(.5), {1, {}, 3.});
  const auto factors = bloch_factors(train, 0);
  CHECK(std::abs(factors[0] - 1.) < 1e-11);
  CHECK(std::abs(factors[1]) == Approx(find_orbit(*train.oscillator, train.r2).multiplier).margin(1e-12));
}

TEST_CASE("an unstable train is left at the computed rate", "[wave][stability][serial]") {
  const Scene scene = scene_of(.5);
  const Train train = solve_train(scene, {1, 10., {}});
  const TrainSpectrum spectrum = train_spectrum(train, 6);
  REQUIRE(spectrum.modes.size() == 6);
  CHECK_FALSE(spectrum.stable);
  CHECK(spectrum.complete);
  CHECK(spectrum.translation_error < 1e-9);
  for (const TrainMode& mode : spectrum.modes) CHECK(mode.resolved);
  const Measured seen = measured_growth(scene, train, 24, 8);
  CHECK(seen.growth == Approx(spectrum.growth_rate).epsilon(2e-2));
  CHECK(seen.growth > .02);
  const double turn = std::remainder(spectrum.modes[0].lambda.imag() * train.period, 2 * M_PI);
  CHECK(seen.frequency == Approx(std::abs(turn) / train.period).epsilon(5e-3));
}

TEST_CASE("a stable train draws perturbations in at the computed rate", "[wave][stability][serial]") {
  {
    const double delta = .2;
    const Scene scene = scene_of(.95 * std::sqrt(1 - delta / 3), delta);
    const Train train = solve_train(scene, {1, 12.5, {}});
    const TrainSpectrum spectrum = train_spectrum(train, 3);
    CHECK(spectrum.stable);
    CHECK(spectrum.complete);
    CHECK(spectrum.growth_rate < -.003);
    const Measured seen = measured_growth(scene, train, 20, 8);
    CHECK(seen.growth == Approx(spectrum.growth_rate).margin(1e-3));
  }
}

TEST_CASE("a ring of n pulses has the modes of one pulse among its own", "[wave][stability][serial]") {
  const Scene scene = scene_of(.5);
  const TrainSpectrum one = train_spectrum(solve_train(scene, {1, 10., {}}), 5);
  const TrainSpectrum three = train_spectrum(solve_train(scene, {3, 30., {}}), 24);
  CHECK(three.complete);
  CHECK(three.growth_rate >= one.growth_rate - 1e-9);
  CHECK(three.growth_rate <= three.infinite_growth + 1e-9);
  for (size_t i = 0; i < 2; ++i) {
    double nearest = 1;
    for (const TrainMode& mode : three.modes)
      nearest = std::min(nearest, std::abs(mode.lambda - one.modes[i].lambda));
    CHECK(nearest < 1e-9);
  }
  // the spectrum of a real problem: conjugates in pairs, m with n - m
  for (const TrainMode& mode : three.modes) {
    double nearest = 1;
    for (const TrainMode& other : three.modes)
      if ((other.bloch + mode.bloch) % 3 == 0)
        nearest = std::min(nearest, std::abs(other.lambda - std::conj(mode.lambda)));
    if (&mode != &three.modes.back()) CHECK(nearest < 1e-8);
  }
}

TEST_CASE("damping scales out of the spectrum of a train", "[wave][stability][serial]") {
  const double a2 = 1 - .2 / 3;
  Scene plain = scene_of(.5 / std::sqrt(a2));
  plain.gamma = 3 * a2;
  const TrainSpectrum one = train_spectrum(solve_train(scene_of(.5, .2), {1, 10., {}}), 3);
  const TrainSpectrum other = train_spectrum(solve_train(plain, {1, 10., {}}), 3);
  CHECK(one.growth_rate == Approx(other.growth_rate).epsilon(1e-8));
}
