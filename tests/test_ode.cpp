#include <catch2/catch.hpp>
#include <cmath>

#include "stickslip/error.hpp"
#include "stickslip/ode.hpp"

using namespace stickslip;

namespace {

// Carries (psi, eta, state) over one period of the semi-discrete system of one node by the classical Runge-Kutta
// method: another method, and the equations before they are put in the oscillator's form.
std::vector<double> one_period(const Scene& s, std::vector<double> y, double period, int steps) {
  dispatch_friction(s.friction, [&](auto friction) {
    auto rhs = [&](const std::vector<double>& u) {
      const double F = friction.force(u[0], u[2]);
      return std::vector<double>{s.A() * (u[1] - s.B() * u[0] - F), s.K0() * (s.v - u[0]) - s.s_delta() * (u[1] - F),
                                 friction.rate(u[0], u[2])};
    };
    auto moved = [](const std::vector<double>& u, const std::vector<double>& k, double h) {
      return std::vector<double>{u[0] + h * k[0], u[1] + h * k[1], u[2] + h * k[2]};
    };
    const double h = period / steps;
    for (int i = 0; i < steps; ++i) {
      const auto k1 = rhs(y), k2 = rhs(moved(y, k1, h / 2)), k3 = rhs(moved(y, k2, h / 2)), k4 = rhs(moved(y, k3, h));
      for (size_t j = 0; j < 3; ++j) y[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    }
  });
  return y;
}

void closes(const Scene& scene, int steps, double tolerance) {
  const Orbit orbit = uniform_orbit(scene);
  // begin where the motion is slow, so that the error of the check itself stays small
  const size_t i = orbit.psi.size() / 4;
  const std::vector<double> start{orbit.psi[i], orbit.eta[i], orbit.state.empty() ? 0 : orbit.state[i]};
  const auto end = one_period(scene, start, orbit.period, steps);
  CHECK(end[0] == Approx(start[0]).margin(tolerance));
  CHECK(end[1] == Approx(start[1]).margin(tolerance));
  CHECK(end[2] == Approx(start[2]).margin(tolerance));
  // halfway round, the dense orbit agrees too
  const auto half = one_period(scene, start, orbit.period / 2, steps / 2);
  CHECK(half[0] == Approx(orbit.psi_at(.75)).margin(tolerance));
  CHECK(half[1] == Approx(orbit.eta_at(.75)).margin(tolerance));
}

}  // namespace

TEST_CASE("collocation tableaux integrate polynomials exactly", "[ode][serial]") {
  for (const Tableau& t : {Tableau::gauss(3), Tableau::gauss(5), Tableau::radau(5)}) {
    const int order = t.c.back() == 1 ? 2 * t.s - 1 : 2 * t.s;
    for (int power = 0; power < order; ++power) {
      double sum = 0;
      for (int j = 0; j < t.s; ++j) sum += t.b[size_t(j)] * std::pow(t.c[size_t(j)], power);
      CHECK(sum == Approx(1. / (power + 1)).epsilon(1e-13));
    }
    double sum = 0;  // and not one power more
    for (int j = 0; j < t.s; ++j) sum += t.b[size_t(j)] * std::pow(t.c[size_t(j)], order);
    CHECK(std::abs(sum * (order + 1) - 1) > 1e-7);
    for (int i = 0; i < t.s; ++i)
      for (int power = 0; power < t.s; ++power) {
        double row = 0;
        for (int j = 0; j < t.s; ++j) row += t.a[size_t(i * t.s + j)] * std::pow(t.c[size_t(j)], power);
        CHECK(row == Approx(std::pow(t.c[size_t(i)], power + 1) / (power + 1)).margin(1e-14));
      }
  }
}

TEST_CASE("van der Pol periods", "[ode][serial]") {
  Scene scene;
  scene.delta = 0;
  scene.v = 0;
  const double known[][2] = {{1, 6.66328686}, {3, 8.85909550}, {5, 11.61223067}, {10, 19.07836957}};
  for (auto& k : known) {
    scene.gamma = k[0];
    CHECK(uniform_orbit(scene).period == Approx(k[1]).epsilon(2e-9));
  }
  // small and large gamma: 2 pi (1 + mu^2/16 - 5 mu^4/3072), and (3 - 2 ln 2) mu + 7.014... mu^(-1/3) - ...
  scene.gamma = .1;
  CHECK(uniform_orbit(scene).period == Approx(2 * M_PI * (1 + .01 / 16 - 5e-4 / 3072)).epsilon(1e-8));
  scene.gamma = 1e4;
  const double mu = scene.gamma, a1 = 2.338107410459767;
  const double asymptotic =
      (3 - 2 * std::log(2.)) * mu + 3 * a1 * std::cbrt(1 / mu) - 2. / 3 * std::log(mu) / mu - 1.3246 / mu;
  CHECK(uniform_orbit(scene).period == Approx(asymptotic).epsilon(1e-9));
}

TEST_CASE("the period does not depend on the tolerance beyond it", "[ode][serial]") {
  Scene scene;
  scene.v = .5;
  const Oscillator oscillator(scene);
  const double best = find_orbit(oscillator, .05, 1e-13).period;
  for (double tolerance : {1e-5, 1e-7, 1e-9, 1e-11})
    CHECK(std::abs(find_orbit(oscillator, .05, tolerance).period / best - 1) < tolerance);
}

TEST_CASE("a uniform oscillation closes under another method", "[ode][serial]") {
  SECTION("cubic, both signs") {
    Scene scene;
    closes(scene, 20000, 1e-9);
    scene.derived_sign = false;
    closes(scene, 20000, 1e-9);
    scene.v = -.7;
    closes(scene, 20000, 1e-9);
  }
  SECTION("chain with viscosity") {
    Scene scene;
    scene.form = Form::chain;
    scene.zeta = .1;
    closes(scene, 20000, 1e-9);
  }
  SECTION("regularised carlson-langer") {
    Scene scene;
    scene.friction.law = Law::carlson_langer;
    scene.friction.regularised = true;
    scene.friction.eps = .05;
    closes(scene, 100000, 1e-8);
  }
  SECTION("with a state") {
    Scene scene;
    scene.friction.state = StateLaw::healing;
    scene.friction.tau_inf = 1.5;
    closes(scene, 50000, 1e-8);
  }
}

TEST_CASE("damping scales out of the period", "[ode][serial]") {
  for (bool derived : {true, false}) {
    Scene damped;
    damped.derived_sign = derived;
    damped.v = .4;
    const double a2 = 1 - damped.s_delta() / damped.gamma;
    Scene plain = damped;
    plain.delta = 0;
    plain.gamma *= a2;
    plain.v /= std::sqrt(a2);
    const Orbit one = uniform_orbit(damped), other = uniform_orbit(plain);
    CHECK(one.period == Approx(other.period).epsilon(1e-12));
    CHECK(one.psi[60] == Approx(std::sqrt(a2) * other.psi[60]).epsilon(1e-10));
  }
}

TEST_CASE("an oscillation exists up to the threshold and not beyond", "[ode][serial]") {
  Scene scene;
  const double critical = std::sqrt(1 - scene.delta / scene.gamma);
  scene.v = critical - 1e-5;
  // at the Hopf point the frequency is 1
  CHECK(uniform_orbit(scene).period == Approx(2 * M_PI).epsilon(1e-3));
  scene.v = critical;
  CHECK_THROWS_AS(uniform_orbit(scene), Failure);
  scene.v = -1.5;
  CHECK_THROWS_AS(uniform_orbit(scene), Failure);
  scene.friction.law = Law::carlson_langer;
  CHECK_THROWS_AS(uniform_orbit(scene), UsageError);
  scene.friction.regularised = true;
  scene.friction.eps = .1;
  scene.v = .01;  // below the velocity of the regularisation friction grows with velocity
  CHECK_THROWS_AS(uniform_orbit(scene), Failure);
}
