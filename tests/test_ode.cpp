#include <cmath>

#include "catch.hpp"
#include "cycles/stick_motion.hpp"
#include "shared.hpp"
#include "stickslip/base/error.hpp"
#include "stickslip/model/oscillator.hpp"
#include "stickslip/numerics/collocation.hpp"

using namespace stickslip;

namespace {

// Carries (psi, eta, state) over one period of the semi-discrete system of one node by the classical
// Runge-Kutta method: another method, and the equations before they are put in the oscillator's form.
std::vector<double> one_period(const Scene& s, std::vector<double> y, double period, int steps) {
  with_friction(s.friction, [&](const Friction& friction) {
    auto rhs = [&](const std::vector<double>& u) {
      const double F = friction.force(u[0], u[2]);
      return std::vector<double>{s.A() * (u[1] - s.B() * u[0] - F),
                                 s.K0() * (s.v - u[0]) - s.s_delta() * (u[1] - F), friction.rate(u[0], u[2])};
    };
    auto moved = [](const std::vector<double>& u, const std::vector<double>& k, double h) {
      return std::vector<double>{u[0] + h * k[0], u[1] + h * k[1], u[2] + h * k[2]};
    };
    const double h = period / steps;
    for (int i = 0; i < steps; ++i) {
      const auto k1 = rhs(y), k2 = rhs(moved(y, k1, h / 2)), k3 = rhs(moved(y, k2, h / 2)),
                 k4 = rhs(moved(y, k3, h));
      for (size_t j = 0; j < 3; ++j) y[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
    }
  });
  return y;
}

void closes(const Scene& scene, int steps, double tolerance) {
  const Orbit orbit = uniform_orbit(scene);
  // begin where the motion is slow, so that the error of the check itself stays small
  const std::vector<double> start{orbit.psi_at(.25), orbit.eta_at(.25), orbit.state_at(.25)};
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

TEST_CASE("collocation points are zeros to the last digit", "[ode][serial]") {
  // P_5: 0 and (1/3) sqrt(5 -+ 2 sqrt(10/7)); the Radau points of order 5: (4 -+ sqrt 6)/10 and 1
  const std::vector<double> g = Tableau::gauss(5).c, r = Tableau::radau(3).c;
  const double inner = std::sqrt(5 - 2 * std::sqrt(10. / 7)) / 3,
               outer = std::sqrt(5 + 2 * std::sqrt(10. / 7)) / 3;
  const double gauss[] = {(1 - outer) / 2, (1 - inner) / 2, .5, (1 + inner) / 2, (1 + outer) / 2};
  for (size_t i = 0; i < 5; ++i) CHECK(std::abs(g[i] - gauss[i]) < 3e-16);
  const double radau[] = {(4 - std::sqrt(6.)) / 10, (4 + std::sqrt(6.)) / 10, 1};
  for (size_t i = 0; i < 3; ++i) CHECK(std::abs(r[i] - radau[i]) < 3e-16);
}

TEST_CASE("a step in which one unknown of several is no number is not within the tolerance",
          "[ode][serial]") {
  for (const int bad : {0, 1, 2}) {
    const auto f = [&](const double* y, double* rates) {
      for (int k = 0; k < 3; ++k) rates[k] = k == bad ? std::sqrt(.01 - y[k]) : -y[k];  // leaves its domain
    };
    const double y[3] = {0, 0, 0}, scales[3] = {1, 1, 1};
    double f0[3], into[3];
    f(y, f0);
    Extrapolation method(3);
    CHECK(method.step(f, y, f0, 1e-3, 3, 1e-10, scales, into) <= 1);
    const double error = method.step(f, y, f0, 1, 3, 1e-10, scales, into);
    CHECK(!(error <= 1));
    CHECK(Extrapolation::next(1, error) == Approx(1. / 8));
  }
}

TEST_CASE("interpolation through points is exact for polynomials, its derivative too",
          "[interpolation][serial]") {
  const Lagrange l({-.3, .1, .2, .9, 1.4});
  for (const double at : {-.5, .1, .77, 2.}) {
    double w[5], dw[5], top = 0, value = 0, slope = 0;
    l.weights(at, w);
    l.derivative_weights(at, dw);
    for (size_t i = 0; i < 5; ++i) {
      const double f = 2 * std::pow(l.points()[i], 4) - l.points()[i];
      value += w[i] * f;
      slope += dw[i] * f;
      top += l.leading()[i] * f;
    }
    CHECK(value == Approx(2 * std::pow(at, 4) - at).margin(1e-12));
    CHECK(slope == Approx(8 * std::pow(at, 3) - 1).margin(1e-11));
    CHECK(top == Approx(2.).epsilon(1e-12));
  }
}

TEST_CASE("interpolation on a grid: centred, shifted, periodic, mirrored", "[interpolation][serial]") {
  const auto value = [](const std::vector<std::pair<PetscInt, double>>& row, auto&& f) {
    double sum = 0;
    for (const auto& [node, weight] : row) sum += weight * f(double(node));
    return sum;
  };
  const auto cubic = [](double x) { return x * x * x - 5 * x; };
  const auto even = [](double x) { return x * x * (1 - x * x / 50); };
  const auto ring = [](double x) { return std::sin(2 * M_PI * x / 40); };
  for (const double at : {0., .2, .5, 3.4, 3.6, 7.9, 9.}) {
    CHECK(value(grid_interpolation(10, GridEnd::one_sided, GridEnd::one_sided, 4, at), cubic) ==
          Approx(cubic(at)).margin(1e-11));
    CHECK(value(grid_interpolation(30, GridEnd::mirrored, GridEnd::one_sided, 5, at), even) ==
          Approx(even(at)).margin(1e-11));
  }
  for (const double at : {.1, 19.5, 39.7, 40.})
    CHECK(value(grid_interpolation(40, GridEnd::periodic, GridEnd::periodic, 10, at), ring) ==
          Approx(ring(at)).margin(1e-8));  // (pi/20)^10 10!/(4^10 10!)
  const auto row = grid_interpolation(10, GridEnd::one_sided, GridEnd::one_sided, 4, 3.4);
  CHECK((row.front().first == 2 && row.back().first == 5));
  CHECK(grid_interpolation(10, GridEnd::one_sided, GridEnd::one_sided, 5, 4).size() == 1);
  CHECK(grid_interpolation(3, GridEnd::one_sided, GridEnd::one_sided, 9, 1.5).size() == 3);
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
    scene.friction.law = Law("carlson-langer");
    scene.friction.regularised = true;
    scene.friction.eps = .05;
    closes(scene, 100000, 1e-8);
  }
  SECTION("with a state") {
    Scene scene;
    scene.friction.state = StateLaw("contact-age");  // healing needs a threshold, which the cubic lacks
    scene.friction.values["state_b"] = 0.3;
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
    CHECK(one.psi_at(.23) == Approx(std::sqrt(a2) * other.psi_at(.23)).epsilon(1e-10));
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
  scene.friction.law = Law("carlson-langer");
  CHECK_THROWS_AS(uniform_orbit(scene), UsageError);
  scene.friction.regularised = true;
  scene.friction.eps = .1;
  scene.v = .01;  // below the velocity of the regularisation friction grows with velocity
  CHECK_THROWS_AS(uniform_orbit(scene), Failure);
}
