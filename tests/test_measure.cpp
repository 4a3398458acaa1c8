// What a run measures: the wave speed off a ring, from fronts that cross many nodes between two samples.
#include <catch2/catch.hpp>

#include <cmath>
#include <vector>

#include "stickslip/measure.hpp"

using namespace stickslip;

TEST_CASE("the speed of a pulse train between ends is that of its fronts", "[measure][serial]") {
  Scene scene;
  scene.left = scene.right = End::free;
  scene.n = 1201;
  scene.length = 24;
  scene.v = 0.2;
  const double t_end = 100, period = 5.92;
  const double speed = GENERATE(1.09, -1.09, 4.88);
  const double thickness = GENERATE(0.05, 1.5);  // 1.5: smooth, every node is seen during its passage

  Measurement measurement(scene, t_end);
  for (const double t : measurement.times()) {
    std::vector<double> psi(static_cast<std::size_t>(scene.n));
    for (PetscInt i = 0; i < scene.n; ++i)
      psi[std::size_t(i)] = 2 * std::tanh(std::sin(2 * M_PI / period * (t - scene.x(i) / speed)) / thickness);
    measurement.sample(t, psi);
  }
  const Measurement::Result result = measurement.result();
  REQUIRE(result.wave_speed.has_value());
  // Passages are known to a sample's spacing s, off by at most s/2 in a stretch of passage that lasts the shorter of a
  // period and the way through half the length; a line fitted to it errs by no more than 3 (s/2)/duration.
  const double spacing = t_end / 4 / (4 * Measurement::quarter);
  const double duration = std::min(period, scene.length / 2 / std::abs(speed)) / 2;
  CHECK(*result.wave_speed == Approx(speed).epsilon(1.5 * spacing / duration));
  CHECK(result.regime == "stick-slip");
}

TEST_CASE("an oscillation in step has no wave speed", "[measure][serial]") {
  Scene scene;
  scene.left = scene.right = End::free;
  scene.n = 201;
  Measurement measurement(scene, 100);
  for (const double t : measurement.times()) {
    std::vector<double> psi(static_cast<std::size_t>(scene.n), 2 * std::sin(t));
    psi[0] = -1.5;
    measurement.sample(t, psi);
  }
  CHECK_FALSE(measurement.result().wave_speed.has_value());
}
